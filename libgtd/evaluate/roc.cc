#include "libgtd/evaluate/roc.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"
#include "libmap/core/text.h"

namespace libgtd {

namespace {

// All locations of one distinct score.
struct ScoreGroup {
  double score = 0.0;
  std::uint64_t positives = 0;
  std::uint64_t negatives = 0;
};

struct Sample {
  std::vector<ScoreGroup> groups;  // ascending
  std::uint64_t positives = 0;
  std::uint64_t negatives = 0;
};

Sample group_by_score(std::vector<std::pair<double, bool>> locations) {
  std::sort(locations.begin(), locations.end());
  Sample sample;
  for (const auto& [score, label] : locations) {
    if (sample.groups.empty() || sample.groups.back().score != score)
      sample.groups.push_back({score, 0, 0});
    ++(label ? sample.groups.back().positives : sample.groups.back().negatives);
    ++(label ? sample.positives : sample.negatives);
  }
  return sample;
}

Confusion counts_from(const Sample& sample, std::uint64_t positives_below,
                      std::uint64_t negatives_below) {
  Confusion counts;
  counts.true_positives = sample.positives - positives_below;
  counts.false_negatives = positives_below;
  counts.false_positives = sample.negatives - negatives_below;
  counts.true_negatives = negatives_below;
  return counts;
}

RocPoint point_at(const Sample& sample, double cutoff) {
  std::uint64_t positives_below = 0, negatives_below = 0;
  for (const ScoreGroup& group : sample.groups) {
    if (reaches_cutoff(group.score, cutoff)) break;
    positives_below += group.positives;
    negatives_below += group.negatives;
  }
  return {cutoff, counts_from(sample, positives_below, negatives_below)};
}

std::vector<RocPoint> points_at_scores(const Sample& sample) {
  std::vector<RocPoint> points;
  points.reserve(sample.groups.size());
  std::uint64_t positives_below = 0, negatives_below = 0;
  for (const ScoreGroup& group : sample.groups) {
    points.push_back({group.score, counts_from(sample, positives_below, negatives_below)});
    positives_below += group.positives;
    negatives_below += group.negatives;
  }
  return points;
}

// Number of pairs of a positive and a negative, counted twice if the positive scores higher and
// once for equal scores (Mann and Whitney 1947). Integers, so that the order of summation has no
// effect.
class PairCount {
 public:
  void add(std::uint64_t positives, std::uint64_t negatives) {
    twice_ += positives * (2 * negatives_below_ + negatives);
    negatives_below_ += negatives;
  }
  double auc(std::uint64_t positives, std::uint64_t negatives) const {
    return static_cast<double>(twice_) /
           (2.0 * static_cast<double>(positives) * static_cast<double>(negatives));
  }

 private:
  std::uint64_t twice_ = 0;
  std::uint64_t negatives_below_ = 0;
};

double trapezoid_auc(const Sample& sample) {
  PairCount pairs;
  for (const ScoreGroup& group : sample.groups) pairs.add(group.positives, group.negatives);
  return pairs.auc(sample.positives, sample.negatives);
}

double precision_at_half_recall(const Sample& sample) {
  std::uint64_t positives = 0;
  std::uint64_t negatives = 0;
  for (auto group = sample.groups.rbegin(); 2 * positives < sample.positives; ++group) {
    positives += group->positives;
    negatives += group->negatives;
  }
  return static_cast<double>(positives) / static_cast<double>(positives + negatives);
}

std::optional<double> calibration_error(const Sample& sample) {
  if (sample.groups.empty() || sample.groups.front().score < 0.0 ||
      sample.groups.back().score > 1.0)
    return std::nullopt;
  constexpr std::size_t bins = 10;
  std::array<double, bins> excess{};  // sum of label - score
  for (const ScoreGroup& group : sample.groups) {
    const auto bin = std::min(bins - 1, static_cast<std::size_t>(group.score * bins));
    const auto count = static_cast<double>(group.positives + group.negatives);
    excess[bin] += static_cast<double>(group.positives) - count * group.score;
  }
  double sum = 0.0;
  for (const double value : excess) sum += std::abs(value);
  return sum / static_cast<double>(sample.positives + sample.negatives);
}

void sum_upper(const std::vector<RocPoint>& points, AreaUnderCurve& auc) {
  const double pairs = static_cast<double>(points.front().counts.positives()) *
                       static_cast<double>(points.front().counts.negatives());
  std::uint64_t sum = 0;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Confusion& here = points[k].counts;
    const std::size_t next =
        k + 1 < points.size() ? points[k + 1].counts.false_positives : here.false_positives;
    const std::uint64_t fraction = std::uint64_t{here.false_positives - next} * here.true_positives;
    auc.upper_sum_terms.push_back(static_cast<double>(fraction) / pairs);
    sum += fraction;
  }
  auc.upper_sum = static_cast<double>(sum) / pairs;
  const Rate width = {points.front().counts.false_positives - points.back().counts.false_positives,
                      points.front().counts.negatives()};
  auc.upper_sum_width = width.value().value();
}

// Hyndman and Fan 1996, definition 7.
double quantile(const std::vector<double>& sorted, double probability) {
  const double position = probability * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(position);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return std::lerp(sorted[below], sorted[above], position - static_cast<double>(below));
}

class Bootstrap {
 public:
  explicit Bootstrap(const Sample& sample) : sample_(sample) {
    for (std::size_t g = 0; g < sample.groups.size(); ++g) {
      group_of_positive_.insert(group_of_positive_.end(), sample.groups[g].positives, g);
      group_of_negative_.insert(group_of_negative_.end(), sample.groups[g].negatives, g);
    }
  }

  // Each replicate has its own random stream, so that their order does not matter.
  double replicate(std::uint64_t seed, std::uint64_t index) const {
    libmap::RandomStream random(seed, index);
    const auto positives = draw(random, group_of_positive_);
    const auto negatives = draw(random, group_of_negative_);
    PairCount pairs;
    for (std::size_t g = 0; g < sample_.groups.size(); ++g) pairs.add(positives[g], negatives[g]);
    return pairs.auc(sample_.positives, sample_.negatives);
  }

 private:
  std::vector<std::uint64_t> draw(libmap::RandomStream& random,
                                  const std::vector<std::size_t>& groups) const {
    std::vector<std::uint64_t> drawn(sample_.groups.size(), 0);
    for (std::size_t i = 0; i < groups.size(); ++i) ++drawn[groups[random.below(groups.size())]];
    return drawn;
  }

  const Sample& sample_;
  std::vector<std::size_t> group_of_positive_, group_of_negative_;
};

std::optional<Interval> bootstrap_95(const Sample& sample, const RocOptions& options) {
  if (options.bootstrap_replicates == 0) return std::nullopt;
  const Bootstrap bootstrap(sample);
  std::vector<double> aucs(static_cast<std::size_t>(options.bootstrap_replicates));
  libmap::parallel_each(aucs.size(), 64, [&](std::size_t i) {
    aucs[i] = bootstrap.replicate(options.bootstrap_seed, i);
  });
  std::sort(aucs.begin(), aucs.end());
  return Interval{quantile(aucs, 0.025), quantile(aucs, 0.975)};
}

std::string why_no_area(const Sample& sample) {
  if (sample.positives + sample.negatives == 0)
    return "no location has both a label and a score: the area under the curve is not defined";
  const std::string number = std::to_string(sample.positives + sample.negatives);
  return "all " + number + " locations are labeled " + (sample.positives > 0 ? "true" : "false") +
         ": the area under the curve is not defined";
}

double squared(double value) { return value * value; }

}  // namespace

bool reaches_cutoff(double score, double cutoff) {
  return score >= cutoff - std::abs(cutoff) * 0x1.0p-24;
}

void RocOptions::check() const {
  if (cutoffs.empty()) throw libmap::Error("at least one cutoff is required", {.field = "cutoffs"});
  for (std::size_t k = 0; k < cutoffs.size(); ++k) {
    if (!std::isfinite(cutoffs[k]) || (k > 0 && !(cutoffs[k] > cutoffs[k - 1])))
      throw libmap::Error("not finite or not greater than the previous cutoff",
                          {.field = "cutoffs",
                           .value = libmap::to_text(cutoffs[k]),
                           .bound = "finite and ascending"});
  }
  if (!std::isfinite(rate_cutoff))
    throw libmap::Error("not finite", {.field = "rate_cutoff",
                                       .value = libmap::to_text(rate_cutoff),
                                       .bound = "a finite number"});
  if (bootstrap_replicates < 0)
    throw libmap::Error("out of range", {.field = "bootstrap_replicates",
                                         .value = std::to_string(bootstrap_replicates),
                                         .bound = ">= 0"});
}

std::optional<double> Rate::value() const {
  if (total == 0) return std::nullopt;
  return static_cast<double>(count) / static_cast<double>(total);
}

std::optional<Interval> Rate::wilson_95() const {
  if (total == 0) return std::nullopt;
  constexpr double z = 1.959963984540054;  // 0.975 quantile of the normal distribution
  const double n = static_cast<double>(total);
  const double p = static_cast<double>(count) / n;
  const double denominator = 1.0 + z * z / n;
  const double center = (p + z * z / (2.0 * n)) / denominator;
  const double half = z * std::sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n)) / denominator;
  // The interval includes the ends 0 and 1 exactly, without rounding errors.
  return Interval{count == 0 ? 0.0 : std::max(0.0, center - half),
                  count == total ? 1.0 : std::min(1.0, center + half)};
}

RocResult evaluate_roc(const std::vector<std::optional<bool>>& labels,
                       const std::vector<std::optional<double>>& scores,
                       const RocOptions& options) {
  options.check();
  if (labels.size() != scores.size())
    throw libmap::Error("number of scores differs from number of labels",
                        {.field = "scores",
                         .value = std::to_string(scores.size()),
                         .bound = std::to_string(labels.size())});
  RocResult result;
  std::vector<std::pair<double, bool>> locations;
  for (std::size_t i = 0; i < labels.size(); ++i) {
    if (!scores[i].has_value() || std::isnan(*scores[i])) {
      ++result.without_score;
    } else if (!labels[i].has_value()) {
      ++result.without_label;
    } else {
      locations.emplace_back(*scores[i], *labels[i]);
    }
  }
  const Sample sample = group_by_score(std::move(locations));
  for (const double cutoff : options.cutoffs) result.at_cutoffs.push_back(point_at(sample, cutoff));
  result.at_scores = points_at_scores(sample);
  result.at_rate_cutoff = point_at(sample, options.rate_cutoff);
  result.calibration_error = calibration_error(sample);
  if (sample.positives > 0) result.precision_at_half_recall = precision_at_half_recall(sample);
  if (sample.positives == 0 || sample.negatives == 0) {
    result.auc_note = why_no_area(sample);
    return result;
  }
  AreaUnderCurve auc;
  auc.trapezoid = trapezoid_auc(sample);
  sum_upper(result.at_cutoffs, auc);
  auc.trapezoid_bootstrap_95 = bootstrap_95(sample, options);
  result.auc = std::move(auc);
  return result;
}

std::optional<Kappa> cohens_kappa(const Confusion& counts) {
  const Rate evaluated_yes{counts.predicted_positives(), counts.size()};
  const Rate reference_yes{counts.positives(), counts.size()};
  const auto says_one_thing = [](const Rate& yes) {
    return yes.count == 0 || yes.count == yes.total;
  };
  if (says_one_thing(evaluated_yes) && says_one_thing(reference_yes) &&
      (evaluated_yes.count == 0) == (reference_yes.count == 0))
    return std::nullopt;
  const double n = static_cast<double>(counts.size());
  const auto fraction = [n](std::size_t count) { return static_cast<double>(count) / n; };
  // Cells p[evaluated][reference] and their sums over rows and columns; 1 is yes.
  const double p[2][2] = {{fraction(counts.true_negatives), fraction(counts.false_negatives)},
                          {fraction(counts.false_positives), fraction(counts.true_positives)}};
  const double evaluated[2] = {fraction(counts.predicted_negatives()), *evaluated_yes.value()};
  const double reference[2] = {fraction(counts.negatives()), *reference_yes.value()};
  const double po = fraction(counts.true_positives + counts.true_negatives);
  const double pe = evaluated[0] * reference[0] + evaluated[1] * reference[1];
  double sum = -squared(po * pe - 2.0 * pe + po);
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j)
      sum += p[i][j] * (i == j ? squared((1.0 - pe) - (reference[i] + evaluated[i]) * (1.0 - po))
                               : squared((1.0 - po) * (reference[i] + evaluated[j])));
  Kappa kappa;
  // Exact results are returned without rounding errors.
  if (counts.false_positives + counts.false_negatives == 0) {
    kappa.value = 1.0;
  } else if (!says_one_thing(evaluated_yes) && !says_one_thing(reference_yes)) {
    kappa.value = (po - pe) / (1.0 - pe);
    kappa.standard_error = std::sqrt(std::max(0.0, sum) / n) / squared(1.0 - pe);
  }
  const double half = 1.959963984540054 * kappa.standard_error;
  kappa.normal_95 = {std::max(-1.0, kappa.value - half), std::min(1.0, kappa.value + half)};
  return kappa;
}

}  // namespace libgtd
