#include <algorithm>
#include <cmath>
#include <utility>

#include "libmap/core/text.h"
#include "libmap/optimize/bundle_adjustment.h"

namespace libmap {

void bind(ParameterTable& table, BundleAdjustmentOptions& options) {
  table.add(
      "observation_scale", options.robust_scale, positive,
      "width of Cauchy's loss for observed image positions and depths, in standard deviations");
  table.add("bundle_iterations", options.max_iterations, {1, 10000},
            "maximum number of bundle adjustment iterations");
  table.add("focal_prior", options.focal_prior, positive,
            "prior standard deviation of the focal length, relative to the focal length");
  table.add("center_prior_px", options.center_prior_px, positive,
            "prior standard deviation of the principal point, pixels");
  table.add("depth_prior", options.depth_prior, positive,
            "prior standard deviation of the depth correction, relative to the depth noise");
  table.add_former_key("depth_bend", "depth_smoothness_prior");
  table.add("depth_smoothness_prior", options.depth_smoothness_prior, positive,
            "prior standard deviation of the depth correction's second differences between knots, "
            "relative to the depth noise");
  table.add("depth_knot_m", options.depth_knot_m, {0.02},
            "depth interval between the knots of the depth correction, a spline, m");
  table.add("frame_time_s", options.bounds.frame_time_s, positive,
            "maximum depth delay and rolling shutter time that a calibration may contain, s");
  table.add_former_key("max_bend_m", "max_depth_correction_m");
  table.add("max_depth_correction_m", options.bounds.max_depth_correction_m, not_negative,
            "maximum depth correction of a calibration: constant term, m");
  table.add_former_key("bend_of_range", "max_depth_correction_of_range");
  table.add("max_depth_correction_of_range", options.bounds.max_depth_correction_of_range,
            not_negative,
            "maximum depth correction of a calibration: term proportional to range, m per m");
}

namespace {

// Pairs of depth and largest absolute correction at that depth (m), over the range of the spline.
std::vector<std::pair<double, double>> largest_bends(const DepthCorrection& depth) {
  constexpr int depths = 40;
  constexpr int radii = 4;
  std::vector<std::pair<double, double>> bends;
  if (depth.spline_m.empty()) return bends;
  for (int k = 0; k <= depths; ++k) {
    auto& [z, bend] =
        bends.emplace_back(depth.first_m + (depth.last_m() - depth.first_m) * k / depths, 0.0);
    for (int n = 0; n <= radii; ++n)
      bend = std::max(bend, std::abs(depth.bend(z, static_cast<double>(n) / radii)));
  }
  return bends;
}

}  // namespace

std::optional<std::string> exceeded_bound(const SensorCalibration& calibration,
                                          const BundleAdjustmentOptions& options) {
  const CalibrationBounds& bounds = options.bounds;
  const auto exceeds = [](const char* what, double value, double bound, const char* unit) {
    return what + (" " + to_fixed_text(value, 1)) + unit + " (must be < " +
           to_fixed_text(bound, 1) + unit + ")";
  };
  for (const CameraTiming& timing : calibration.timing) {
    const double rows_s = std::abs(timing.rolling_shutter_s);
    const double delay_s = std::abs(timing.depth_delay_s);
    if (std::max(rows_s, delay_s) >= bounds.frame_time_s)
      return exceeds(rows_s > delay_s ? "rolling shutter time" : "depth delay",
                     1e3 * std::max(rows_s, delay_s), 1e3 * bounds.frame_time_s, " ms");
  }
  for (const IntrinsicsStep& step : calibration.intrinsics) {
    const double focal = std::max(std::abs(step.fx_relative), std::abs(step.fy_relative));
    const double center_px = std::max(std::abs(step.cx_px), std::abs(step.cy_px));
    if (focal >= bounds.deviations * options.focal_prior)
      return exceeds("focal length changed by", 100.0 * focal,
                     100.0 * bounds.deviations * options.focal_prior, " %");
    if (center_px >= bounds.deviations * options.center_prior_px)
      return exceeds("principal point moved by", center_px,
                     bounds.deviations * options.center_prior_px, " px");
  }
  for (const Pose& pose : calibration.color_from_depth)
    if (pose.translation().norm() >= bounds.deviations * registration_prior_m)
      return exceeds("registration of depth to color moved by", 1e3 * pose.translation().norm(),
                     1e3 * bounds.deviations * registration_prior_m, " mm");
  for (const DepthCorrection& depth : calibration.depth)
    for (const auto& [z, bend] : largest_bends(depth))
      if (const double most =
              bounds.max_depth_correction_m + bounds.max_depth_correction_of_range * z;
          bend >= most)
        return exceeds("depth correction", 1e3 * bend, 1e3 * most, " mm") + " at a depth of " +
               to_fixed_text(z, 1) + " m";
  return std::nullopt;
}

}  // namespace libmap
