#include "libmap/features/place_recognition.h"

#include <gtest/gtest.h>

#include "libmap/core/parallel.h"
#include "tests/libmap/features/synthetic_features.h"

namespace place_recognition_test {

using libmap::find_similar_frames;
using libmap::FrameFeatures;
using libmap::SimilarFrame;

constexpr std::size_t places = 4;
constexpr unsigned features = 40;

// A frame that shows a place, with `others` of its features replaced by unique ones.
FrameFeatures frame_at(unsigned place, unsigned others) {
  static unsigned next = 1000000;
  FrameFeatures frame;
  for (unsigned n = 0; n < features; ++n) {
    frame.features.emplace_back();
    std::mt19937 engine(n < others ? next++ : 1000 * place + n);
    for (int byte = 0; byte < 128; ++byte)
      frame.descriptors.push_back(static_cast<std::uint8_t>(engine() % 100));
  }
  return frame;
}

// Two frames per place, the second with some unique features; then a frame without features.
std::vector<FrameFeatures> scan() {
  std::vector<FrameFeatures> frames;
  for (unsigned n = 0; n < 2 * places; ++n)
    frames.push_back(frame_at(n % places, n < places ? 0 : 8));
  frames.emplace_back();
  return frames;
}

TEST(PlaceRecognition, TheSamePlaceIsMostSimilar) {
  const std::vector<FrameFeatures> frames = scan();
  const auto similar = find_similar_frames(frames, 3, {}, 1);
  ASSERT_EQ(similar.size(), frames.size());
  for (std::size_t f = 0; f < 2 * places; ++f) {
    ASSERT_FALSE(similar[f].empty());
    EXPECT_LE(similar[f].size(), 3U);
    EXPECT_EQ(similar[f][0].frame, (f + places) % (2 * places));
    EXPECT_GT(similar[f][0].similarity, 0.5);
    EXPECT_LE(similar[f][0].similarity, 1.0 + 1e-12);
    for (std::size_t n = 1; n < similar[f].size(); ++n) {
      EXPECT_LE(similar[f][n].similarity, similar[f][n - 1].similarity);
      EXPECT_LT(similar[f][n].similarity, 0.7 * similar[f][0].similarity);
      EXPECT_NE(similar[f][n].frame, f);
    }
  }
  EXPECT_TRUE(similar.back().empty()) << "a frame without features";
  EXPECT_TRUE(find_similar_frames(frames, 0, {}, 1)[0].empty());
  EXPECT_TRUE(find_similar_frames({FrameFeatures{}}, 3, {}, 1)[0].empty());
}

// The most similar frames first, then those of other parts, which may be less similar.
TEST(PlaceRecognition, OtherPartsAreAddedWhereThereAreParts) {
  const std::vector<FrameFeatures> frames = scan();
  std::vector<std::size_t> parts(frames.size(), 0);
  parts[2] = parts[3] = 1;
  const auto similar = find_similar_frames(frames, 1, {.words = 16}, 1, parts);
  for (std::size_t f = 0; f < 2 * places; ++f) {
    ASSERT_EQ(similar[f].size(), 2U) << "few words: some are in common";
    EXPECT_EQ(similar[f][0].frame, (f + places) % (2 * places));
    EXPECT_NE(parts[similar[f][1].frame], parts[f]);
  }
}

TEST(PlaceRecognition, SameForAnyNumberOfThreads) {
  const std::vector<FrameFeatures> frames = scan();
  const auto similar_with = [&](unsigned threads) {
    const libmap::ThreadLimit limit(threads);
    return find_similar_frames(frames, 5, {.words = 32, .training_samples = 100}, 7);
  };
  const auto one = similar_with(1);
  const auto three = similar_with(3);
  for (std::size_t f = 0; f < frames.size(); ++f) {
    ASSERT_EQ(one[f].size(), three[f].size());
    for (std::size_t n = 0; n < one[f].size(); ++n) {
      EXPECT_EQ(one[f][n].frame, three[f][n].frame);
      EXPECT_EQ(one[f][n].similarity, three[f][n].similarity);
    }
  }
}

}  // namespace place_recognition_test
