// Weights of residuals for robust, iteratively reweighted least squares.
#pragma once

namespace libmap {

// Ratio of standard deviation to median absolute deviation of normally distributed residuals.
inline constexpr double sigma_per_median_deviation = 1.4826;

// Width of Tukey's biweight, in standard deviations, with 95 % efficiency for normal residuals.
inline constexpr double tukey_width = 4.685;

// Width of Tukey's biweight for residuals with the median absolute value `median_deviation`.
inline double tukey_width_of(double median_deviation) {
  return tukey_width * sigma_per_median_deviation * median_deviation;
}

// Tukey's biweight (Beaton and Tukey 1974). `ratio` is residual / width of the weight function.
inline double tukey_weight(double ratio) {
  const double rest = 1.0 - ratio * ratio;
  return rest > 0.0 ? rest * rest : 0.0;
}

// Cauchy's weight. `squared_ratio` is (residual / width of the loss function)^2.
inline double cauchy_weight(double squared_ratio) { return 1.0 / (1.0 + squared_ratio); }

}  // namespace libmap
