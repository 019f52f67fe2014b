// Scans in memory of textured surfaces in closed form, with poses, links and true poses.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <random>

#include "libmap/core/random_stream.h"
#include "libmap/geometry/rigid_motion.h"
#include "libmap/refine/refinement.h"
#include "tests/libmap/fusion/depth_scenes.h"

namespace graspmap_test {

// Smooth noise of one wavelength, 0 to 1.
inline double value_noise(const Eigen::Vector3d& point, double wavelength_m, std::uint64_t key) {
  const Eigen::Vector3d scaled = point / wavelength_m;
  const Eigen::Vector3d cell = scaled.array().floor();
  const Eigen::Vector3d at = scaled - cell;
  double sum = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    double weight = 1.0;
    std::uint64_t hash = key;
    for (int axis = 0; axis < 3; ++axis) {
      const int side = (corner >> axis) & 1;
      const double smooth = at[axis] * at[axis] * (3.0 - 2.0 * at[axis]);
      weight *= side == 1 ? smooth : 1.0 - smooth;
      hash = libmap::mix_bits(
          hash, static_cast<std::uint64_t>(static_cast<std::int64_t>(cell[axis]) + side + 100000));
    }
    sum += weight * libmap::unit_noise(hash, 1);
  }
  return sum;
}

inline std::uint8_t texture_at(const Eigen::Vector3d& point) {
  double value = 0.0;
  double weight = 0.0;
  for (const double wavelength : {0.16, 0.08, 0.04, 0.02}) {
    value += value_noise(point, wavelength, static_cast<std::uint64_t>(1e4 * wavelength));
    weight += 1.0;
  }
  return static_cast<std::uint8_t>(std::clamp(128.0 + 500.0 * (value / weight - 0.5), 0.0, 255.0));
}

inline libmap::Camera textured_camera() {
  libmap::Camera camera;
  camera.width = 256;
  camera.height = 192;
  camera.fx = 210;
  camera.fy = 210;
  camera.cx = 127.5;
  camera.cy = 95.5;
  return camera;
}

// Returns options for the small images of TexturedScan.
inline libmap::RefinementOptions small_options() {
  libmap::RefinementOptions options;
  options.features.max_features = 400;
  options.closures.appearance.words = 64;
  return options;
}

class TexturedScan : public libmap::ScanSource {
 public:
  const std::filesystem::path& path() const override { return path_; }
  const libmap::PoseGraph& graph() const override { return graph_; }
  libmap::RgbdFrame read_frame(int node, libmap::FrameParts) const override {
    return frames.at(node);
  }

  // Adds a frame at `truth`; odometry measures the motion from the last frame with `error`.
  void see(const Surface& surface, const libmap::Pose& truth, const libmap::Vector6d& error,
           bool textured = true, const DepthNoiseModel& noise = {0.002, 0.005}) {
    const int node = static_cast<int>(frames.size()) + 1;
    const libmap::Camera camera = textured_camera();
    const libmap::Pose eye = truth * camera.base_from_camera;
    libmap::RgbdFrame frame;
    frame.node = node;
    frame.stamp_s = node * interval_s;
    frame.cameras = {camera};
    frame.depth = render_depth(surface, camera, eye, noise, engine_);
    frame.color = libmap::ColorImage(camera.width, camera.height, {90, 90, 90});
    const auto rays = libmap::ray_table(camera);
    libmap::Pose row_eye = eye;
    for (std::size_t n = 0; textured && n < rays.size(); ++n) {
      const auto row = static_cast<int>(n) / camera.width;
      if (base_at && static_cast<int>(n) % camera.width == 0)
        row_eye = base_at(frame.stamp_s + rolling_shutter_s * (row / (camera.height - 1.0) - 0.5)) *
                  camera.base_from_camera;
      const Eigen::Vector3d direction = row_eye.linear() * rays[n].homogeneous();
      const double z = surface(row_eye.translation(), direction);
      if (!std::isfinite(z)) continue;
      const std::uint8_t gray = texture_at(row_eye.translation() + z * direction);
      frame.color.pixels[n] = {gray, gray, gray};
    }
    frames[node] = std::move(frame);
    libmap::GraphNode added;
    added.id = node;
    added.stamp_s = node * interval_s;
    added.truth_from_base = truth;
    if (node == 1) {
      added.odometry_from_base = truth;
    } else {
      const libmap::GraphNode& last = graph_.nodes.back();
      const libmap::Pose motion = libmap::moved(last.truth_from_base->inverse() * truth, error);
      added.odometry_from_base = *last.odometry_from_base * motion;
      libmap::Matrix6d information = 1e4 * libmap::Matrix6d::Identity();
      graph_.links.push_back({node - 1, node, libmap::LinkType::neighbor, motion, information});
    }
    graph_.nodes.push_back(added);
  }

  std::map<int, libmap::RgbdFrame> frames;
  libmap::PoseGraph graph_;
  double interval_s = 1.0;  // between frames
  // Pose of the base as a function of time, for a rolling shutter.
  std::function<libmap::Pose(double)> base_at;
  double rolling_shutter_s = 0.0;

 private:
  std::filesystem::path path_ = "textured.db";
  std::mt19937_64 engine_{5};
};

// Ground with two boulders.
inline Surface boulders() {
  return nearest_of({plane_z(0.0), sphere({0.1, 0.2, 0.05}, 0.3), sphere({-0.5, -0.2, 0.0}, 0.25),
                     sphere({0.5, -0.4, -0.05}, 0.3)});
}

// Returns a pose on a circle around the boulders, towards them.
inline libmap::Pose around(double angle_deg, double height_m = 1.1) {
  const double angle = angle_deg * 3.14159265358979323846 / 180.0;
  return looking({1.2 * std::cos(angle), 1.2 * std::sin(angle), height_m}, {0, 0, 0.05});
}

}  // namespace graspmap_test
