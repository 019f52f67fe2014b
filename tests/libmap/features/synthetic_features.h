// Frames with features of known points, without images.
#pragma once

#include <cmath>
#include <map>
#include <random>
#include <vector>

#include "libmap/features/features.h"
#include "libmap/geometry/rigid_motion.h"
#include "libmap/refine/loop_closure.h"
#include "tests/support/test_support.h"

namespace graspmap_test {

inline libmap::Camera feature_camera() {
  libmap::Camera camera;
  camera.width = 512;
  camera.height = 424;
  camera.fx = 365;
  camera.fy = 365;
  camera.cx = 255.5;
  camera.cy = 211.5;
  return camera;
}

inline libmap::Vector6d random_step(double shift_m, double turn_rad) {
  libmap::Vector6d step;
  for (int n = 0; n < 3; ++n) step[n] = uniform(-shift_m, shift_m);
  for (int n = 3; n < 6; ++n) step[n] = uniform(-turn_rad, turn_rad);
  return step;
}

inline double normal(double deviation) {
  return std::normal_distribution<double>(0.0, deviation)(random_engine());
}

// Points in front of a base whose x axis points forward.
inline std::vector<Eigen::Vector3d> random_points(std::size_t count) {
  std::vector<Eigen::Vector3d> points;
  for (std::size_t n = 0; n < count; ++n)
    points.emplace_back(uniform(1.0, 2.2), uniform(-0.8, 0.8), uniform(-0.7, 0.7));
  return points;
}

// Poses on a path along y with varying direction and rotation.
inline libmap::Pose beside(double y) {
  return libmap::make_pose_from_rpy(
      {0.05 * std::sin(3.0 * y), y, 0.03 * std::cos(2.0 * y)},
      {3.0 * std::sin(y), 2.0 * std::cos(y), 5.0 * std::sin(2.0 * y)});
}

struct FeatureNoise {
  double pixel = 0.2;  // standard deviations stored in the features
  double depth_m = 0.002;
  bool apply = false;
};

// Features of a frame: the n-th is the projection of the n-th point, even outside the image, with a
// random descriptor of seed `seeds[n]`.
inline libmap::FrameFeatures see_points(int node, const libmap::Pose& world_from_base,
                                        const std::vector<Eigen::Vector3d>& points,
                                        const FeatureNoise& noise = {},
                                        libmap::Camera camera = feature_camera()) {
  libmap::FrameFeatures frame;
  frame.node = node;
  frame.cameras = {camera};
  const libmap::Pose camera_from_world = (world_from_base * camera.base_from_camera).inverse();
  for (std::size_t n = 0; n < points.size(); ++n) {
    const Eigen::Vector3d p = camera_from_world * points[n];
    libmap::Feature feature;
    Eigen::Vector2d ray = p.head<2>() / p.z();
    double depth = p.z();
    if (noise.apply) {
      ray += Eigen::Vector2d(normal(noise.pixel), normal(noise.pixel)) / camera.fx;
      depth += normal(noise.depth_m);
    }
    feature.ray = ray.cast<float>();
    feature.depth_m = static_cast<float>(depth);
    feature.pixel_noise_px = static_cast<float>(noise.pixel);
    feature.depth_noise_m = static_cast<float>(noise.depth_m);
    frame.features.push_back(feature);
    std::mt19937 engine(static_cast<unsigned>(n) + 1);
    for (int byte = 0; byte < 128; ++byte)
      frame.descriptors.push_back(static_cast<std::uint8_t>(engine() % 100));
  }
  return frame;
}

inline std::vector<libmap::FeatureMatch> same_numbers(std::size_t count) {
  std::vector<libmap::FeatureMatch> matches;
  for (std::size_t n = 0; n < count; ++n)
    matches.push_back({static_cast<int>(n), static_cast<int>(n)});
  return matches;
}

}  // namespace graspmap_test
