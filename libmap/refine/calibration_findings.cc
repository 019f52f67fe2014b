#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "libmap/core/text.h"
#include "libmap/refine/sensor_calibration.h"

namespace libmap {

std::string CalibrationParts::name() const {
  std::string text;
  for (const auto& [free, part] :
       {std::pair(intrinsics, "intrinsics"), std::pair(depth, "depth"),
        std::pair(registration, "registration"), std::pair(timing, "timing")})
    if (free) text += (text.empty() ? "" : "_") + std::string(part);
  return text;
}

CalibrationParts parts_of(const SensorCalibration& calibration) {
  return {!calibration.intrinsics.empty(), !calibration.depth.empty(),
          !calibration.color_from_depth.empty(), !calibration.timing.empty()};
}

bool is_similar_registration(const SensorCalibration& a, const SensorCalibration& b, double shift_m,
                             double turn_rad, double time_s) {
  const std::size_t cameras = std::max(
      {a.color_from_depth.size(), b.color_from_depth.size(), a.timing.size(), b.timing.size()});
  const auto pose_of = [](const SensorCalibration& of, std::size_t n) {
    return n < of.color_from_depth.size() ? of.color_from_depth[n] : Pose::Identity();
  };
  const auto timing_of = [](const SensorCalibration& of, std::size_t n) {
    return n < of.timing.size() ? of.timing[n] : CameraTiming{};
  };
  for (std::size_t n = 0; n < cameras; ++n) {
    const CameraTiming at = timing_of(a, n);
    const CameraTiming bt = timing_of(b, n);
    if (!is_near(pose_of(a, n), pose_of(b, n), shift_m, turn_rad) ||
        std::abs(at.depth_delay_s - bt.depth_delay_s) > time_s ||
        std::abs(at.rolling_shutter_s - bt.rolling_shutter_s) > time_s)
      return false;
  }
  return true;
}

CameraFile calibrated_camera(const Camera& stored, const Camera& image,
                             const SensorCalibration& calibration, const PoseGraph& graph) {
  CameraFile file{.camera = stored};
  if (!calibration.intrinsics.empty()) {
    // The step is in pixels of the images, which may be smaller than the stored camera's.
    IntrinsicsStep step = calibration.intrinsics.front();
    step.cx_px *= static_cast<double>(stored.width) / image.width;
    step.cy_px *= static_cast<double>(stored.height) / image.height;
    file.camera = moved(stored, step);
  }
  if (!calibration.color_from_depth.empty())
    file.color_from_depth = calibration.color_from_depth.front();
  if (!calibration.depth.empty()) file.depth = calibration.depth.front();
  if (!calibration.timing.empty()) {
    file.depth_delay_s = calibration.timing.front().depth_delay_s;
    file.rolling_shutter_s = calibration.timing.front().rolling_shutter_s;
    for (const GraphNode& node : graph.nodes)
      if (const auto motion = calibration.motion.find(node.id); motion != calibration.motion.end())
        file.motions.push_back({node.stamp_s, motion->second.head<3>(), motion->second.tail<3>()});
    std::stable_sort(
        file.motions.begin(), file.motions.end(),
        [](const FrameMotion& a, const FrameMotion& b) { return a.stamp_s < b.stamp_s; });
  }
  return file;
}

std::vector<std::string> findings(const SensorCalibration& calibration,
                                  const SensorCalibration& deviations,
                                  const std::vector<Camera>& cameras) {
  std::vector<std::string> sentences;
  const auto of_camera = [&](std::size_t n) {
    return cameras.size() > 1 ? "camera " + std::to_string(n + 1) + ": " : std::string();
  };
  for (std::size_t n = 0; n < std::min(calibration.intrinsics.size(), cameras.size()); ++n) {
    const IntrinsicsStep& step = calibration.intrinsics[n];
    const double percent =
        100.0 * (1.0 / (1.0 + 0.5 * (step.fx_relative + step.fy_relative)) - 1.0);
    sentences.push_back(of_camera(n) + "stored focal length " +
                        to_fixed_text(std::abs(percent), 2) + " % too " +
                        (percent > 0.0 ? "large" : "small") + ", principal point off by " +
                        to_fixed_text(std::hypot(step.cx_px, step.cy_px), 1) + " px: corrected");
  }
  for (std::size_t n = 0; n < std::min(calibration.depth.size(), cameras.size()); ++n) {
    const DepthCorrection& depth = calibration.depth[n];
    if (depth.spline_m.empty()) continue;
    constexpr int depths = 100;
    double lowest = depth.bend(depth.first_m, 0.0);
    double highest = lowest;
    for (int k = 0; k <= depths; ++k) {
      const double z = depth.first_m + (depth.last_m() - depth.first_m) * k / depths;
      lowest = std::min(lowest, depth.bend(z, 0.0));
      highest = std::max(highest, depth.bend(z, 0.0));
    }
    const double middle = 0.5 * (depth.first_m + depth.last_m());
    sentences.push_back(
        of_camera(n) + "depth bends by " + to_fixed_text(500.0 * (highest - lowest), 1) +
        " mm with range and by " +
        to_fixed_text(1e3 * std::abs(depth.bend(middle, 1.0) - depth.bend(middle, 0.0)), 1) +
        " mm toward the corners: corrected");
  }
  for (std::size_t n = 0; n < std::min(calibration.color_from_depth.size(), cameras.size()); ++n) {
    const Pose& pose = calibration.color_from_depth[n];
    sentences.push_back(
        of_camera(n) + "registration of depth to color " +
        to_fixed_text(1e3 * pose.translation().norm(), 1) + " mm and " +
        to_fixed_text(rotation_vector_of(pose.linear()).norm() * 180.0 / std::numbers::pi, 2) +
        " deg off: corrected");
  }
  for (std::size_t n = 0; n < std::min(calibration.timing.size(), cameras.size()); ++n) {
    const CameraTiming& timing = calibration.timing[n];
    const double delay_ms = 1e3 * timing.depth_delay_s;
    const auto within = [&](double CameraTiming::*const time) {
      return n < deviations.timing.size()
                 ? " +- " + to_fixed_text(1e3 * deviations.timing[n].*time, 1)
                 : std::string();
    };
    sentences.push_back(of_camera(n) + "depth taken " + to_fixed_text(std::abs(delay_ms), 1) +
                        within(&CameraTiming::depth_delay_s) + " ms " +
                        (delay_ms < 0.0 ? "before" : "after") +
                        " color, rows of an image exposed over " +
                        to_fixed_text(1e3 * timing.rolling_shutter_s, 1) +
                        within(&CameraTiming::rolling_shutter_s) + " ms: corrected");
  }
  return sentences;
}

}  // namespace libmap
