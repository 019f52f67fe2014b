// Weights of residuals for robust, iteratively reweighted least squares.
#pragma once

namespace libmap {

// Standard deviation of normal residuals per median absolute deviation.
inline constexpr double sigma_per_median_deviation = 1.4826;

// Width of Tukey's biweight with 95 % efficiency for normal residuals, standard deviations.
inline constexpr double tukey_width = 4.685;

// Width of Tukey's biweight for residuals with this median absolute value.
inline double tukey_width_of(double median_deviation) {
  return tukey_width * sigma_per_median_deviation * median_deviation;
}

// Tukey's biweight (Beaton and Tukey 1974) of a residual in units of the weight function's width.
inline double tukey_weight(double ratio) {
  const double rest = 1.0 - ratio * ratio;
  return rest > 0.0 ? rest * rest : 0.0;
}

// Cauchy's weight of a squared residual in units of the loss's squared width.
inline double cauchy_weight(double squared_ratio) { return 1.0 / (1.0 + squared_ratio); }

}  // namespace libmap
