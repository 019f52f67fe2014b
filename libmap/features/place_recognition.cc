#include "libmap/features/place_recognition.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"

namespace libmap {

namespace {

// Index of the most similar column of `words` for each column of `vectors`; all are unit vectors.
std::vector<int> quantize(const Eigen::MatrixXf& vectors, const Eigen::MatrixXf& words) {
  constexpr Eigen::Index block = 256;
  std::vector<int> nearest(static_cast<std::size_t>(vectors.cols()), 0);
  for (Eigen::Index begin = 0; begin < vectors.cols(); begin += block) {
    const Eigen::Index count = std::min(block, vectors.cols() - begin);
    const Eigen::MatrixXf similarities = words.transpose() * vectors.middleCols(begin, count);
    for (Eigen::Index n = 0; n < count; ++n) {
      Eigen::Index best = 0;
      similarities.col(n).maxCoeff(&best);
      nearest[static_cast<std::size_t>(begin + n)] = static_cast<int>(best);
    }
  }
  return nearest;
}

Eigen::MatrixXf samples_of(const std::vector<FrameFeatures>& frames, std::size_t count,
                           RandomStream& random) {
  std::vector<std::pair<std::size_t, std::size_t>> all;
  for (std::size_t f = 0; f < frames.size(); ++f)
    for (std::size_t n = 0; n < frames[f].features.size(); ++n) all.emplace_back(f, n);
  count = std::min(count, all.size());
  for (std::size_t n = 0; n < count; ++n) std::swap(all[n], all[n + random.below(all.size() - n)]);
  all.resize(count);
  std::sort(all.begin(), all.end());
  Eigen::MatrixXf samples;
  Eigen::MatrixXf of_frame;
  std::size_t frame = frames.size();
  for (std::size_t n = 0; n < count; ++n) {
    if (all[n].first != frame) {
      frame = all[n].first;
      of_frame = descriptor_vectors(frames[frame]);
      if (n == 0) samples.resize(of_frame.rows(), static_cast<Eigen::Index>(count));
    }
    samples.col(static_cast<Eigen::Index>(n)) =
        of_frame.col(static_cast<Eigen::Index>(all[n].second));
  }
  return samples;
}

// k-means on the unit sphere.
Eigen::MatrixXf learn_words(const Eigen::MatrixXf& samples, const PlaceRecognitionOptions& options,
                            RandomStream& random) {
  const Eigen::Index count = std::min<Eigen::Index>(options.words, samples.cols());
  Eigen::MatrixXf words(samples.rows(), count);
  for (Eigen::Index n = 0; n < count; ++n)
    words.col(n) = samples.col(
        static_cast<Eigen::Index>(random.below(static_cast<std::size_t>(samples.cols()))));
  for (int round = 0; round < options.training_rounds; ++round) {
    const std::vector<int> nearest = quantize(samples, words);
    Eigen::MatrixXf sums = Eigen::MatrixXf::Zero(words.rows(), words.cols());
    for (std::size_t n = 0; n < nearest.size(); ++n)
      sums.col(nearest[n]) += samples.col(static_cast<Eigen::Index>(n));
    for (Eigen::Index n = 0; n < count; ++n)
      if (sums.col(n).norm() > 0.0F) words.col(n) = sums.col(n).normalized();
  }
  return words;
}

using Bag = std::map<int, double>;  // by word

std::vector<Bag> bags_of(const std::vector<FrameFeatures>& frames, const Eigen::MatrixXf& words) {
  std::vector<Bag> bags(frames.size());
  parallel_for(frames.size(), 4, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f)
      if (!frames[f].features.empty())
        for (const int word : quantize(descriptor_vectors(frames[f]), words)) bags[f][word] += 1.0;
  });
  std::map<int, double> frames_with;
  for (const Bag& bag : bags)
    for (const auto& [word, count] : bag) frames_with[word] += 1.0;
  const double all = static_cast<double>(frames.size());
  for (Bag& bag : bags) {
    double square = 0.0;
    for (auto& [word, count] : bag) {
      // Smoothed, so that words that occur in all frames keep a small weight.
      count *= std::log(1.0 + all / frames_with[word]);
      square += count * count;
    }
    for (auto& [word, weight] : bag) weight /= std::sqrt(square);
  }
  return bags;
}

// Appends the `count` most similar frames that are `wanted`.
template <typename Wanted>
void append_best(const std::vector<double>& cosine, std::size_t count, const Wanted& wanted,
                 std::vector<SimilarFrame>& similar) {
  std::vector<SimilarFrame> ranked;
  for (std::size_t other = 0; other < cosine.size(); ++other)
    if (cosine[other] > 0.0 && wanted(other)) ranked.push_back({other, cosine[other]});
  const auto kept = static_cast<std::ptrdiff_t>(std::min(count, ranked.size()));
  std::partial_sort(ranked.begin(), ranked.begin() + kept, ranked.end(),
                    [](const SimilarFrame& a, const SimilarFrame& b) {
                      return a.similarity != b.similarity ? a.similarity > b.similarity
                                                          : a.frame < b.frame;
                    });
  similar.insert(similar.end(), ranked.begin(), ranked.begin() + kept);
}

}  // namespace

std::vector<std::vector<SimilarFrame>> find_similar_frames(const std::vector<FrameFeatures>& frames,
                                                           std::size_t count,
                                                           const PlaceRecognitionOptions& options,
                                                           std::uint64_t seed,
                                                           const std::vector<std::size_t>& parts) {
  std::vector<std::vector<SimilarFrame>> similar(frames.size());
  RandomStream random(seed, 0);
  const Eigen::MatrixXf samples =
      samples_of(frames, static_cast<std::size_t>(options.training_samples), random);
  if (samples.cols() == 0 || count == 0) return similar;
  const std::vector<Bag> bags = bags_of(frames, learn_words(samples, options, random));
  std::map<int, std::vector<std::pair<std::size_t, double>>> frames_of_word;
  for (std::size_t f = 0; f < bags.size(); ++f)
    for (const auto& [word, weight] : bags[f]) frames_of_word[word].emplace_back(f, weight);
  parallel_for(frames.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f) {
      std::vector<double> cosine(frames.size(), 0.0);
      for (const auto& [word, weight] : bags[f])
        for (const auto& [other, other_weight] : frames_of_word.at(word))
          cosine[other] += weight * other_weight;
      append_best(
          cosine, count, [&](std::size_t other) { return other != f; }, similar[f]);
      if (!parts.empty())
        append_best(
            cosine, count, [&](std::size_t other) { return parts[other] != parts[f]; }, similar[f]);
    }
  });
  return similar;
}

}  // namespace libmap
