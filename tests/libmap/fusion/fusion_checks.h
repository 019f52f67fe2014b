// Scans and error measures for the tests of fusion.
#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "tests/libmap/fusion/depth_scenes.h"
#include "tests/support/test_support.h"

namespace graspmap_test {

inline constexpr DepthNoiseModel kinect{0.002, 0.005};

// Returns a scan with views from a ring above the ground towards `target`.
inline MemoryScan ring_scan(const Surface& surface, int views, const DepthNoiseModel& noise,
                            const Eigen::Vector3d& target = Eigen::Vector3d::Zero(),
                            double radius_m = 0.9, double height_m = 1.0) {
  MemoryScan scan;
  for (int n = 0; n < views; ++n) {
    const double angle = 2 * std::numbers::pi * n / views + 0.1;
    const Eigen::Vector3d eye(radius_m * std::cos(angle), radius_m * std::sin(angle), height_m);
    scan.see(surface, looking(target + eye, target), small_camera(), noise, random_engine());
  }
  return scan;
}

inline double rms(const std::vector<double>& values) {
  double squares = 0;
  for (const double value : values) squares += value * value;
  return std::sqrt(squares / static_cast<double>(values.size()));
}

// Heights of the points within 0.3 m of the z axis.
inline std::vector<double> heights_of(const libmap::PointCloud& cloud) {
  std::vector<double> heights;
  for (const Eigen::Vector3d& point : cloud.positions)
    if (point.head<2>().norm() < 0.3) heights.push_back(point.z());
  return heights;
}

// Ground with a box of 15 cm, and the distance of a point from both.
inline const Surface step_scene =
    nearest_of({plane_z(0), box({-0.2, -0.2, -0.1}, {0.2, 0.2, 0.15})});
inline double distance_from_step(const Eigen::Vector3d& p) {
  const Eigen::Vector2d beyond = p.head<2>().cwiseAbs() - Eigen::Vector2d(0.2, 0.2);
  const double outside = beyond.cwiseMax(0).norm();
  const double wall = beyond.maxCoeff();
  if (wall > 0) {
    const double side = std::hypot(outside, std::max(0.0, p.z() - 0.15));
    return std::min(std::abs(p.z()), side);
  }
  return std::min(std::abs(p.z() - 0.15), p.z() < 0.15 ? -wall : 1.0);
}

}  // namespace graspmap_test
