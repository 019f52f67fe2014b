#include "libgtd/evaluate/roc.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"
#include "tests/support/test_support.h"

namespace roc_test {

using graspmap_test::error_of;
using libgtd::evaluate_roc;
using libgtd::Rate;
using libgtd::RocOptions;
using libgtd::RocPoint;
using libgtd::RocResult;
using Labels = std::vector<std::optional<bool>>;
using Scores = std::vector<std::optional<double>>;

constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

RocOptions without_bootstrap() {
  RocOptions options;
  options.bootstrap_replicates = 0;
  return options;
}

struct Sample {
  Labels labels;
  Scores scores;
};

// Labels correlated with the scores, which have `levels` distinct values so that they tie. Some
// locations have no score. Both classes occur.
Sample random_sample(std::size_t size, int levels) {
  Sample sample{{true, false}, {0.5, 0.5}};
  while (sample.labels.size() < size) {
    const bool label = graspmap_test::uniform(0, 1) < 0.6;
    const double draw = graspmap_test::uniform(0, 1) + (label ? 0.2 : 0.0);
    sample.labels.emplace_back(label);
    if (graspmap_test::uniform(0, 1) < 0.1) {
      sample.scores.emplace_back(std::nullopt);
    } else {
      sample.scores.emplace_back(std::floor(draw * levels) / levels);
    }
  }
  return sample;
}

// Oracle: every pair of a positive and a negative.
double pair_count_auc(const Sample& sample) {
  double wins = 0, pairs = 0;
  for (std::size_t a = 0; a < sample.labels.size(); ++a) {
    for (std::size_t b = 0; b < sample.labels.size(); ++b) {
      if (!*sample.labels[a] || *sample.labels[b] || !sample.scores[a] || !sample.scores[b])
        continue;
      pairs += 1;
      wins += *sample.scores[a] > *sample.scores[b]    ? 1.0
              : *sample.scores[a] == *sample.scores[b] ? 0.5
                                                       : 0.0;
    }
  }
  return wins / pairs;
}

// Trapezoids under the curve through `points` (ascending cutoffs) and the corner (0, 0).
double trapezoids_under(const std::vector<RocPoint>& points) {
  double auc = 0;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const double tpr = *points[k].counts.true_positive_rate().value();
    const double fpr = *points[k].counts.false_positive_rate().value();
    const bool last = k + 1 == points.size();
    const double next_tpr = last ? 0 : *points[k + 1].counts.true_positive_rate().value();
    const double next_fpr = last ? 0 : *points[k + 1].counts.false_positive_rate().value();
    auc += (fpr - next_fpr) * (tpr + next_tpr) / 2;
  }
  return auc;
}

double trapezoid_of(const Sample& sample) {
  return evaluate_roc(sample.labels, sample.scores, without_bootstrap()).auc.value().trapezoid;
}

TEST(Roc, CountsOfASmallExampleByHand) {
  const Labels labels = {true, true, true, false, false, true};
  const Scores scores = {0.9, 0.4, 0.6, 0.6, 0.1, std::nullopt};
  RocOptions options = without_bootstrap();
  options.rate_cutoff = 0.6;
  const RocResult result = evaluate_roc(labels, scores, options);
  const libgtd::Confusion& counts = result.at_rate_cutoff.counts;
  EXPECT_EQ(counts.true_positives, 2u);
  EXPECT_EQ(counts.false_positives, 1u);
  EXPECT_EQ(counts.true_negatives, 1u);
  EXPECT_EQ(counts.false_negatives, 1u);
  EXPECT_EQ(counts.predicted_positives(), 3u);
  EXPECT_EQ(counts.predicted_negatives(), 2u);
  EXPECT_DOUBLE_EQ(*counts.true_positive_rate().value(), 2.0 / 3);
  EXPECT_DOUBLE_EQ(*counts.true_negative_rate().value(), 0.5);
  EXPECT_DOUBLE_EQ(*counts.false_positive_rate().value(), 0.5);
  EXPECT_DOUBLE_EQ(*counts.false_negative_rate().value(), 1.0 / 3);
  EXPECT_DOUBLE_EQ(*counts.positive_predictive_value().value(), 2.0 / 3);
  EXPECT_DOUBLE_EQ(*counts.accuracy().value(), 0.6);
  EXPECT_EQ(result.without_score, 1u);
  // Pairs: 0.9 beats both; 0.4 beats 0.1 alone; 0.6 ties with 0.6 and beats 0.1: 4.5 of 6.
  EXPECT_DOUBLE_EQ(result.auc->trapezoid, 0.75);
  ASSERT_EQ(result.at_scores.size(), 4u);
  EXPECT_EQ(result.at_scores.front().cutoff, 0.1);
  EXPECT_EQ(result.at_scores.front().counts.predicted_negatives(), 0u);
  EXPECT_EQ(result.at_scores.back().cutoff, 0.9);
  EXPECT_EQ(result.at_scores.back().counts.predicted_positives(), 1u);
}

TEST(Roc, AScoreThatIsTheCutoffReachesItHoweverItWasStored) {
  for (int tenths = 1; tenths <= 10; ++tenths) {
    const double cutoff = RocOptions().cutoffs[static_cast<std::size_t>(tenths - 1)];
    double summed = 0;
    for (int i = 0; i < tenths; ++i) summed += 0.1;
    const double single = static_cast<double>(static_cast<float>(cutoff));
    const double short_of_one = 1.0 - (1.0 - cutoff);
    RocOptions options = without_bootstrap();
    options.rate_cutoff = cutoff;
    const RocResult result =
        evaluate_roc({true, true, true, true, false},
                     {cutoff, summed, single, short_of_one, cutoff - 1e-6}, options);
    EXPECT_EQ(result.at_rate_cutoff.counts.true_positives, 4u) << cutoff;
    EXPECT_EQ(result.at_rate_cutoff.counts.false_positives, 0u) << cutoff;
  }
}

TEST(Roc, NegativeScoresAndCutoffs) {
  RocOptions options = without_bootstrap();
  options.rate_cutoff = -0.7;
  const double single = static_cast<double>(-0.7f);
  const RocResult result =
      evaluate_roc({true, true, false, false}, {single, -0.7, -0.700001, -infinity}, options);
  EXPECT_EQ(result.at_rate_cutoff.counts.true_positives, 2u);
  EXPECT_EQ(result.at_rate_cutoff.counts.false_positives, 0u);
  EXPECT_EQ(result.auc->trapezoid, 1.0);
}

TEST(Roc, AScoreOfZeroReachesTheCutoffZero) {
  RocOptions options = without_bootstrap();
  options.rate_cutoff = 0.0;
  const RocResult result = evaluate_roc({true, true, false}, {0.0, -0.0, -1e-300}, options);
  EXPECT_EQ(result.at_rate_cutoff.counts.true_positives, 2u);
  EXPECT_EQ(result.at_rate_cutoff.counts.false_positives, 0u);
}

TEST(Roc, TrapezoidEqualsThePairCount) {
  for (int round = 0; round < 200; ++round) {
    const auto size = static_cast<std::size_t>(graspmap_test::uniform(2, 120));
    const Sample sample = random_sample(size, round % 3 == 0 ? 1000000 : 1 + round % 10);
    const RocResult result = evaluate_roc(sample.labels, sample.scores, without_bootstrap());
    EXPECT_NEAR(result.auc->trapezoid, pair_count_auc(sample), 1e-12);
    EXPECT_NEAR(result.auc->trapezoid, trapezoids_under(result.at_scores), 1e-12);
  }
}

TEST(Roc, AreaIsUnchangedUnderStrictlyMonotoneMaps) {
  const Sample sample = random_sample(300, 20);
  RocOptions options;
  options.bootstrap_replicates = 200;
  const RocResult plain = evaluate_roc(sample.labels, sample.scores, options);
  const std::vector<double (*)(double)> maps = {
      [](double s) { return std::exp(s); }, [](double s) { return 1e6 * s - 3e5; },
      [](double s) { return s * s * s; }, [](double s) { return 1e-9 * s + 0.5; },
      [](double s) { return -1.0 / (1.0 + s); }};
  for (const auto map : maps) {
    Scores mapped = sample.scores;
    for (std::optional<double>& score : mapped)
      if (score) score = map(*score);
    const RocResult result = evaluate_roc(sample.labels, mapped, options);
    EXPECT_EQ(result.auc->trapezoid, plain.auc->trapezoid);
    EXPECT_EQ(result.auc->trapezoid_bootstrap_95->low, plain.auc->trapezoid_bootstrap_95->low);
    EXPECT_EQ(result.auc->trapezoid_bootstrap_95->high, plain.auc->trapezoid_bootstrap_95->high);
    ASSERT_EQ(result.at_scores.size(), plain.at_scores.size());
  }
}

TEST(Roc, SwappedLabelsOrNegatedScoresGiveTheComplement) {
  const Sample sample = random_sample(250, 15);
  Sample swapped = sample, negated = sample;
  for (std::optional<bool>& label : swapped.labels) label = !*label;
  for (std::optional<double>& score : negated.scores)
    if (score) score = -*score;
  EXPECT_NEAR(trapezoid_of(swapped), 1 - trapezoid_of(sample), 1e-15);
  EXPECT_NEAR(trapezoid_of(negated), 1 - trapezoid_of(sample), 1e-15);
  negated.labels = swapped.labels;
  EXPECT_EQ(trapezoid_of(negated), trapezoid_of(sample));
}

TEST(Roc, OrderOfTheLocationsDoesNotMatter) {
  Sample sample = random_sample(100, 12);
  const RocResult before = evaluate_roc(sample.labels, sample.scores);
  std::reverse(sample.labels.begin(), sample.labels.end());
  std::reverse(sample.scores.begin(), sample.scores.end());
  const RocResult after = evaluate_roc(sample.labels, sample.scores);
  EXPECT_EQ(before.auc->trapezoid, after.auc->trapezoid);
  EXPECT_EQ(before.auc->upper_sum, after.auc->upper_sum);
  EXPECT_EQ(before.auc->trapezoid_bootstrap_95->low, after.auc->trapezoid_bootstrap_95->low);
}

TEST(Roc, PerfectWorstAndEqualScores) {
  const Labels labels = {true, true, false, false, false};
  EXPECT_EQ(trapezoid_of({labels, {0.9, 0.8, 0.7, 0.3, 0.2}}), 1.0);
  EXPECT_EQ(trapezoid_of({labels, {0.1, 0.2, 0.7, 0.3, 0.8}}), 0.0);
  EXPECT_EQ(trapezoid_of({labels, {0.6, 0.6, 0.6, 0.6, 0.6}}), 0.5);
  EXPECT_EQ(trapezoid_of({labels, {0.0, -0.0, 0.0, -0.0, 0.0}}), 0.5);
}

TEST(Roc, UpperSumIsNeverBelowTheTrapezoidsOfItsCutoffs) {
  for (int round = 0; round < 100; ++round) {
    const Sample sample = random_sample(60, 2 + round % 13);
    const RocResult result = evaluate_roc(sample.labels, sample.scores, without_bootstrap());
    double sum = 0, trapezoids = 0;
    for (std::size_t k = 0; k + 1 < result.at_cutoffs.size(); ++k) {
      const libgtd::Confusion &here = result.at_cutoffs[k].counts,
                              &next = result.at_cutoffs[k + 1].counts;
      const double width =
          *here.false_positive_rate().value() - *next.false_positive_rate().value();
      EXPECT_NEAR(result.auc->upper_sum_terms[k], width * *here.true_positive_rate().value(),
                  1e-12);
      sum += width * *here.true_positive_rate().value();
      trapezoids +=
          width * (*here.true_positive_rate().value() + *next.true_positive_rate().value()) / 2;
    }
    EXPECT_EQ(result.auc->upper_sum_terms.back(), 0.0);
    EXPECT_NEAR(result.auc->upper_sum, sum, 1e-12);
    EXPECT_GE(result.auc->upper_sum, trapezoids - 1e-12);
    if (result.auc->upper_sum_width == 1.0) {
      EXPECT_GE(result.auc->upper_sum, result.auc->trapezoid);
    }
  }
}

TEST(Roc, UpperSumMissesNegativesOutsideItsCutoffs) {
  // A perfect score with negatives below the first cutoff, which the upper sum ignores.
  const RocResult result =
      evaluate_roc({true, true, false, false}, {0.9, 0.8, 0.05, 0.01}, without_bootstrap());
  EXPECT_EQ(result.auc->trapezoid, 1.0);
  EXPECT_EQ(result.auc->upper_sum, 0.0);
  EXPECT_EQ(result.auc->upper_sum_width, 0.0);
}

TEST(Roc, OneClassAloneHasNoAreaAndSaysWhy) {
  const RocResult positive = evaluate_roc({true, true, true}, {0.1, 0.8, 0.9});
  EXPECT_FALSE(positive.auc.has_value());
  EXPECT_EQ(positive.auc_note,
            "all 3 locations are labeled true: the area under the curve is not defined");
  EXPECT_FALSE(positive.at_rate_cutoff.counts.false_positive_rate().value().has_value());
  EXPECT_FALSE(positive.at_rate_cutoff.counts.true_negative_rate().wilson_95().has_value());
  EXPECT_DOUBLE_EQ(*positive.at_rate_cutoff.counts.true_positive_rate().value(), 2.0 / 3);

  const RocResult negative = evaluate_roc({true, false}, {std::nullopt, 0.9});
  EXPECT_FALSE(negative.auc.has_value());
  EXPECT_THAT(negative.auc_note, testing::HasSubstr("all 1 locations are labeled false"));

  const RocResult empty = evaluate_roc({}, {});
  EXPECT_FALSE(empty.auc.has_value());
  EXPECT_THAT(empty.auc_note, testing::HasSubstr("no location"));
  EXPECT_TRUE(empty.at_scores.empty());
  EXPECT_FALSE(empty.at_rate_cutoff.counts.accuracy().value().has_value());
}

TEST(Roc, LocationsWithoutLabelOrScoreAreLeftOutAndCounted) {
  const RocResult result =
      evaluate_roc({true, std::nullopt, false, std::nullopt, true, false},
                   {0.9, 0.9, 0.1, std::nullopt, nan_value, infinity}, without_bootstrap());
  EXPECT_EQ(result.without_score, 2u);
  EXPECT_EQ(result.without_label, 1u);
  EXPECT_EQ(result.at_rate_cutoff.counts.size(), 3u);
  EXPECT_EQ(result.auc->trapezoid, 0.5);
}

TEST(Roc, WilsonIntervals) {
  // Wilson's formula solved for p0: |p - p0| = z sqrt(p0 (1 - p0) / n) at both ends.
  for (const auto& [count, total] : std::vector<std::pair<std::size_t, std::size_t>>{
           {13, 18}, {3, 12}, {1, 2}, {7, 10}, {999, 1000}}) {
    const Rate rate{count, total};
    const double p = *rate.value(), n = static_cast<double>(total);
    for (const double end : {rate.wilson_95()->low, rate.wilson_95()->high})
      EXPECT_NEAR(std::abs(p - end), 1.959963984540054 * std::sqrt(end * (1 - end) / n), 1e-12);
    EXPECT_LT(rate.wilson_95()->low, p);
    EXPECT_GT(rate.wilson_95()->high, p);
  }
  // Zero of n: the upper end is z^2 / (n + z^2).
  const double z2 = 1.959963984540054 * 1.959963984540054;
  EXPECT_EQ((Rate{0, 10}.wilson_95()->low), 0.0);
  EXPECT_NEAR((Rate{0, 10}.wilson_95()->high), z2 / (10 + z2), 1e-15);
  EXPECT_EQ((Rate{10, 10}.wilson_95()->high), 1.0);
  EXPECT_NEAR((Rate{10, 10}.wilson_95()->low), 10 / (10 + z2), 1e-15);
  for (std::size_t total = 1; total <= 500; ++total) {
    EXPECT_EQ((Rate{0, total}.wilson_95()->low), 0.0) << total;
    EXPECT_EQ((Rate{total, total}.wilson_95()->high), 1.0) << total;
  }
  EXPECT_FALSE((Rate{0, 0}.wilson_95().has_value()));
}

TEST(Roc, BootstrapIsTheSameAtAnyThreadCountAndDiffersWithTheSeed) {
  const Sample sample = random_sample(80, 9);
  RocOptions options;
  options.bootstrap_replicates = 3000;
  std::vector<libgtd::Interval> intervals;
  for (const unsigned threads : {1u, 2u, 7u, 0u}) {
    const libmap::ThreadLimit limit(threads);
    intervals.push_back(
        *evaluate_roc(sample.labels, sample.scores, options).auc->trapezoid_bootstrap_95);
    EXPECT_EQ(intervals.back().low, intervals.front().low);
    EXPECT_EQ(intervals.back().high, intervals.front().high);
  }
  options.bootstrap_seed = 2;
  const auto other =
      *evaluate_roc(sample.labels, sample.scores, options).auc->trapezoid_bootstrap_95;
  EXPECT_NE(other.low, intervals.front().low);
  EXPECT_NEAR(other.low, intervals.front().low, 0.02);
  EXPECT_NEAR(other.high, intervals.front().high, 0.02);
}

// Direct bootstrap: one draw per location.
std::vector<double> slow_bootstrap(const Sample& sample, std::uint64_t replicates,
                                   std::uint32_t seed) {
  std::vector<double> positives, negatives;
  for (std::size_t i = 0; i < sample.labels.size(); ++i)
    if (sample.scores[i]) (*sample.labels[i] ? positives : negatives).push_back(*sample.scores[i]);
  std::sort(positives.begin(), positives.end());
  std::sort(negatives.begin(), negatives.end());
  std::vector<double> aucs;
  for (std::uint32_t replicate = 0; replicate < replicates; ++replicate) {
    libmap::RandomStream random(seed, replicate);
    const auto draw = [&](const std::vector<double>& of) {
      std::vector<double> drawn;
      for (std::size_t i = 0; i < of.size(); ++i) drawn.push_back(of[random.below(of.size())]);
      return drawn;
    };
    const std::vector<double> drawn_positives = draw(positives);
    const std::vector<double> drawn_negatives = draw(negatives);
    std::uint64_t twice = 0;
    for (const double p : drawn_positives)
      for (const double n : drawn_negatives) twice += p > n ? 2U : p == n ? 1U : 0U;
    aucs.push_back(static_cast<double>(twice) / (2.0 * static_cast<double>(positives.size()) *
                                                 static_cast<double>(negatives.size())));
  }
  std::sort(aucs.begin(), aucs.end());
  return aucs;
}

TEST(Roc, BootstrapIsTheDefinitionToTheBit) {
  // The 0.025 and 0.975 quantiles of 41 replicates are the second and the second to last.
  constexpr std::uint64_t replicates = 41;
  for (const std::size_t size : {2U, 3U, 77U, 900U}) {
    const Sample sample = random_sample(size, 50);
    RocOptions options;
    options.bootstrap_replicates = replicates;
    options.bootstrap_seed = 7;
    const auto interval =
        *evaluate_roc(sample.labels, sample.scores, options).auc->trapezoid_bootstrap_95;
    const std::vector<double> aucs = slow_bootstrap(sample, replicates, 7);
    EXPECT_EQ(interval.low, aucs[1]) << size;
    EXPECT_EQ(interval.high, aucs[39]) << size;
  }
}

TEST(Roc, BootstrapAgreesWithTheNormalApproximationOnManyLocations) {
  // Standard error of the area by the placements of each class (DeLong et al. 1988).
  const Sample sample = random_sample(800, 1000000);
  std::vector<double> positives, negatives;
  for (std::size_t i = 0; i < sample.labels.size(); ++i)
    if (sample.scores[i]) (*sample.labels[i] ? positives : negatives).push_back(*sample.scores[i]);
  const double np = static_cast<double>(positives.size());
  const double nn = static_cast<double>(negatives.size());
  const double auc = trapezoid_of(sample);
  const auto variance_of_means = [auc](const auto& of, const auto& against, double sign) {
    double sum = 0;
    for (const double a : of) {
      double wins = 0;
      for (const double b : against) wins += sign * (a - b) > 0 ? 1.0 : a == b ? 0.5 : 0.0;
      const double deviation = wins / static_cast<double>(against.size()) - auc;
      sum += deviation * deviation;
    }
    return sum / static_cast<double>(of.size() - 1);
  };
  const double error = std::sqrt(variance_of_means(positives, negatives, 1) / np +
                                 variance_of_means(negatives, positives, -1) / nn);
  const RocResult result = evaluate_roc(sample.labels, sample.scores);
  const libgtd::Interval interval = *result.auc->trapezoid_bootstrap_95;
  EXPECT_NEAR(interval.low, auc - 1.96 * error, 0.15 * error);
  EXPECT_NEAR(interval.high, auc + 1.96 * error, 0.15 * error);
}

TEST(Roc, BootstrapOfOneLocationAClass) {
  const RocResult result = evaluate_roc({true, false}, {0.9, 0.1});
  EXPECT_EQ(result.auc->trapezoid_bootstrap_95->low, 1.0);
  EXPECT_EQ(result.auc->trapezoid_bootstrap_95->high, 1.0);
  EXPECT_FALSE(evaluate_roc({true, false}, {0.9, 0.1}, without_bootstrap())
                   .auc->trapezoid_bootstrap_95.has_value());
}

TEST(Roc, WrongOptionsNameTheFieldAndTheBound) {
  const auto error_with = [](auto change) {
    RocOptions options;
    change(options);
    return error_of([&] { options.check(); });
  };
  EXPECT_EQ(error_with([](RocOptions& o) { o.cutoffs.clear(); }).context().field, "cutoffs");
  EXPECT_EQ(error_with([](RocOptions& o) { o.cutoffs = {0.5, 0.5}; }).context().value, "0.5");
  EXPECT_EQ(error_with([](RocOptions& o) {
              o.cutoffs = {0.5, nan_value};
            })
                .context()
                .bound,
            "finite and ascending");
  EXPECT_EQ(error_with([](RocOptions& o) { o.rate_cutoff = infinity; }).context().field,
            "rate_cutoff");
  EXPECT_EQ(error_with([](RocOptions& o) { o.bootstrap_replicates = -1; }).context().bound, ">= 0");
  EXPECT_EQ(error_of([] { evaluate_roc({true}, {}); }).context().field, "scores");
}

TEST(Roc, PrecisionAtHalfOfTheRecallAndCalibration) {
  // Two of the three highest of four positives; ties count in full.
  const Labels labels = {true, false, true, true, true, false};
  const RocResult result =
      evaluate_roc(labels, Scores{0.95, 0.85, 0.75, 0.35, 0.35, 0.05}, without_bootstrap());
  ASSERT_TRUE(result.precision_at_half_recall);
  EXPECT_DOUBLE_EQ(*result.precision_at_half_recall, 2.0 / 3.0);
  // Tenths: |1 - 0.95|, |0 - 0.85|, |1 - 0.75|, |2 - 0.7|, |0 - 0.05| over six locations.
  ASSERT_TRUE(result.calibration_error);
  EXPECT_NEAR(*result.calibration_error, (0.05 + 0.85 + 0.25 + 1.3 + 0.05) / 6, 1e-12);
  EXPECT_FALSE(evaluate_roc(labels, Scores{0.95, 1.5, 0.75, 0.35, 0.35, 0.05}, without_bootstrap())
                   .calibration_error);
  const RocResult tied = evaluate_roc(labels, Scores(6, 1.0), without_bootstrap());
  EXPECT_DOUBLE_EQ(*tied.precision_at_half_recall, 4.0 / 6.0);
  EXPECT_NEAR(*tied.calibration_error, 2.0 / 6.0, 1e-12);
}

}  // namespace roc_test
