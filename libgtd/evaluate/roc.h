// How well a score tells graspable places from others, against what a field test found: ROC curve,
// rates at one cutoff with their intervals, and the area under the curve.
//
// A location counts as predicted positive where score >= cutoff. Floating error cannot tip a score
// that is the cutoff: a score at most one part in 2^24 below a given cutoff (the largest rounding
// of single precision) counts as having reached it, so 0.8 reaches 0.8 however it was stored or
// computed. Between scores themselves, and so in the curve at every distinct score and in the
// trapezoid, doubles are compared as they are.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace libgtd {

struct RocOptions {
  // Of the ROC table and of the upper sum; the thesis's, tab. 5-1 to 5-3. Finite, ascending.
  std::vector<double> cutoffs = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0};
  double rate_cutoff = 0.8;          // of the rates
  int bootstrap_replicates = 10000;  // 0: no interval
  std::uint64_t bootstrap_seed = 1;

  void check() const;  // throws libmap::Error naming field, value and bound
};

// Whether a score counts as having reached a cutoff, as said above.
bool reaches_cutoff(double score, double cutoff);

struct Interval {
  double low = 0.0;
  double high = 0.0;
};

// `count` out of `total`. Out of nothing there is neither value nor interval.
struct Rate {
  std::size_t count = 0;
  std::size_t total = 0;

  std::optional<double> value() const;        // count / total; nothing where total is 0
  std::optional<Interval> wilson_95() const;  // score interval without continuity correction
                                              // (Wilson 1927)
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
  // Of the curve through every distinct score: the Mann-Whitney statistic, ties counting 1/2.
  double trapezoid = 0.0;
  // The thesis's: sum over its cutoffs of (FPR_k - FPR_k+1) * TPR_k; the last has no share. It is
  // never less than the trapezoids over the same cutoffs, and never less than `trapezoid` where
  // `upper_sum_width` is 1; negatives below the first cutoff or at the last have no part in it.
  double upper_sum = 0.0;
  std::vector<double> upper_sum_shares;  // one a cutoff
  double upper_sum_width = 0.0;          // FPR at the first cutoff less FPR at the last
  // 95 % percentile bootstrap of `trapezoid`, stratified: positives and negatives are drawn with
  // replacement each among themselves, so every replicate has both classes. Nothing if no
  // replicates were asked for. (1, 1) after a perfect separation: not a proof of one.
  std::optional<Interval> trapezoid_bootstrap_95;
};

struct RocResult {
  std::vector<RocPoint> at_cutoffs;  // ascending, as given
  std::vector<RocPoint> at_scores;   // every distinct score, ascending
  RocPoint at_rate_cutoff;
  std::optional<AreaUnderCurve> area;  // nothing unless both classes are there
  std::string area_note;               // why there is none
  // Positives among the highest scores that reach half of all positives, ties counting in full.
  std::optional<double> precision_at_half_recall;
  // If all scores are in 0..1: the mean over the locations of |share of positives - mean score| of
  // their tenth of that range (Naeini et al. 2015, expected calibration error).
  std::optional<double> calibration_error;
  std::size_t left_out_unscored = 0;   // no score: not visible
  std::size_t left_out_unlabeled = 0;  // a score and no label
};

// One label and one score per location; a location without either, or whose score is NaN, is left
// out. Throws libmap::Error if the two differ in length. The same for any number of threads.
RocResult evaluate_roc(const std::vector<std::optional<bool>>& labels,
                       const std::vector<std::optional<double>>& scores,
                       const RocOptions& options = {});

// Cohen's kappa: 1 all agree, 0 as many as chance gives, negative fewer.
struct Kappa {
  double value = 0.0;
  // Of the estimate, for large samples; 0 where all agree or one says the same everywhere. It takes
  // places for independent: neighboring voxels of a map are not, and their kappa is less certain
  // than it says.
  double standard_error = 0.0;
  Interval normal_95;  // value -+ 1.96 standard errors, within -1..1
};

// (po - pe) / (1 - pe), po the share that agrees and pe the one expected of independent
// evaluations with the same shares of yes (Cohen 1960, eq. 1). Its variance (Fleiss, Cohen and
// Everitt 1969, without weights), p_ij the shares of the table, p_i. and p_.j the sums of its rows
// and columns:
//   n (1 - pe)^4 var = sum_i p_ii ((1 - pe) - (p_.i + p_i.) (1 - po))^2
//                      + (1 - po)^2 sum_(i != j) p_ij (p_.i + p_j.)^2 - (po pe - 2 pe + po)^2.
// Nothing where pe is 1 (nothing was evaluated, or both say one and the same everywhere).
std::optional<Kappa> cohens_kappa(const Confusion& counts);

}  // namespace libgtd
