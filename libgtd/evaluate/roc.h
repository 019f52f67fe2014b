// Evaluates scores against the results of a field test: ROC curve, rates at a cutoff with
// confidence intervals, and the area under the curve.
//
// A location is predicted positive if score >= cutoff. A tolerance absorbs rounding: a score that
// is below a given cutoff by at most one part in 2^24 (the largest rounding error of single
// precision) reaches the cutoff. Comparisons of scores with each other, as in the curve through
// every distinct score and in its area, have no tolerance.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace libgtd {

struct RocOptions {
  // Finite, ascending cutoffs (default: thesis) of the ROC table and AreaUnderCurve::upper_sum.
  std::vector<double> cutoffs = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0};
  double rate_cutoff = 0.8;          // cutoff at which the rates are computed
  int bootstrap_replicates = 10000;  // number of bootstrap samples; 0: no interval
  std::uint64_t bootstrap_seed = 1;

  void check() const;  // throws Error naming field, value and bound
};

// Returns true if a score reaches a cutoff within the tolerance above.
bool reaches_cutoff(double score, double cutoff);

struct Interval {
  double low = 0.0;
  double high = 0.0;
};

// Proportion `count` / `total`; value and interval are nullopt if `total` is 0.
struct Rate {
  std::size_t count = 0;
  std::size_t total = 0;

  std::optional<double> value() const;        // count / total
  std::optional<Interval> wilson_95() const;  // Wilson 1927, no continuity correction
};

struct Confusion {
  std::size_t true_positives = 0;
  std::size_t false_positives = 0;
  std::size_t true_negatives = 0;
  std::size_t false_negatives = 0;

  void add(bool positive, bool predicted) {
    ++(positive ? (predicted ? true_positives : false_negatives)
                : (predicted ? false_positives : true_negatives));
  }

  std::size_t predicted_positives() const { return true_positives + false_positives; }
  std::size_t predicted_negatives() const { return true_negatives + false_negatives; }
  std::size_t positives() const { return true_positives + false_negatives; }
  std::size_t negatives() const { return true_negatives + false_positives; }
  std::size_t size() const { return positives() + negatives(); }

  Rate true_positive_rate() const { return {true_positives, positives()}; }
  Rate true_negative_rate() const { return {true_negatives, negatives()}; }
  Rate false_positive_rate() const { return {false_positives, negatives()}; }
  Rate false_negative_rate() const { return {false_negatives, positives()}; }
  Rate positive_predictive_value() const { return {true_positives, predicted_positives()}; }
  Rate accuracy() const { return {true_positives + true_negatives, size()}; }
};

struct RocPoint {
  double cutoff = 0.0;
  Confusion counts;
};

struct AreaUnderCurve {
  // Area under the curve through every distinct score: the Mann-Whitney statistic, ties count 1/2.
  double trapezoid = 0.0;
  // Area of the thesis: sum of (FPR_k - FPR_k+1) * TPR_k over all cutoffs k but the last, with the
  // false positive rate FPR and the true positive rate TPR. At least the trapezoid area over these
  // cutoffs; at least `trapezoid` if `upper_sum_width` is 1. Omits negatives with a score below the
  // first cutoff, or at or above the last.
  double upper_sum = 0.0;
  std::vector<double> upper_sum_terms;  // terms of the sum, one per cutoff; the last is 0
  double upper_sum_width = 0.0;         // FPR at the first cutoff - FPR at the last
  // Bootstrap interval of `trapezoid` (95 %, percentile), stratified: positives and negatives are
  // resampled separately, so that every replicate has both classes. nullopt without replicates. For
  // perfectly separated classes, the interval is (1, 1), which does not prove an area of 1.
  std::optional<Interval> trapezoid_bootstrap_95;
};

struct RocResult {
  std::vector<RocPoint> at_cutoffs;  // ascending, as given
  std::vector<RocPoint> at_scores;   // every distinct score, ascending
  RocPoint at_rate_cutoff;
  std::optional<AreaUnderCurve> auc;  // nullopt without positives or without negatives
  std::string auc_note;               // reason for a missing area
  // Precision at the highest cutoff with recall >= 1/2; nullopt without positives.
  std::optional<double> precision_at_half_recall;
  // Expected calibration error (Naeini et al. 2015), nullopt unless all scores are in 0..1: mean
  // over the locations of |fraction of positives - mean score| in the location's bin (width 0.1).
  std::optional<double> calibration_error;
  std::size_t without_score = 0;  // locations without a score, e.g. not visible in the scan
  std::size_t without_label = 0;  // locations with a score but no label
};

// Evaluates one label and one score per location. Skips locations without a label, without a score,
// or with a score of NaN. The result does not depend on the number of threads. Throws Error if the
// lengths differ or an option is out of range.
RocResult evaluate_roc(const std::vector<std::optional<bool>>& labels,
                       const std::vector<std::optional<double>>& scores,
                       const RocOptions& options = {});

// Cohen's kappa: 1 full agreement, 0 agreement expected by chance, below 0 less than by chance.
struct Kappa {
  double value = 0.0;
  // Standard error for large samples; 0 if all agree or one rater is constant. Samples are assumed
  // to be independent. Neighboring voxels of a map are not, so that the real error is larger.
  double standard_error = 0.0;
  Interval normal_95;  // value -+ 1.96 standard errors, within -1..1
};

// Computes kappa = (po - pe) / (1 - pe), with the observed agreement po and the agreement pe
// expected of independent ratings with the same marginals (Cohen 1960, eq. 1). The variance
// (Fleiss, Cohen and Everitt 1969, without weights), with the table p_ij and its marginals p_i. and
// p_.j, is
//   n (1 - pe)^4 var = sum_i p_ii ((1 - pe) - (p_.i + p_i.) (1 - po))^2
//                      + (1 - po)^2 sum_(i != j) p_ij (p_.i + p_j.)^2 - (po pe - 2 pe + po)^2.
// Returns nullopt if pe is 1 (no samples, or both ratings are constant and equal).
std::optional<Kappa> cohens_kappa(const Confusion& counts);

}  // namespace libgtd
