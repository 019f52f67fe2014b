// Scans in memory of surfaces in closed form.
#pragma once

#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/scan/scan_source.h"

namespace graspmap_test {

// Distance along a ray in lengths of its direction, or infinity.
using Surface =
    std::function<double(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction)>;

inline Surface plane_z(double z) {
  return [z](const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
    const double along = (z - origin.z()) / direction.z();
    return along > 0 ? along : std::numeric_limits<double>::infinity();
  };
}

inline Surface sphere(const Eigen::Vector3d& center, double radius) {
  return [=](const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
    const Eigen::Vector3d arm = origin - center;
    const double a = direction.squaredNorm();
    const double b = arm.dot(direction);
    const double root = b * b - a * (arm.squaredNorm() - radius * radius);
    if (root < 0) return std::numeric_limits<double>::infinity();
    const double along = (-b - std::sqrt(root)) / a;
    return along > 0 ? along : std::numeric_limits<double>::infinity();
  };
}

// An axis-aligned box.
inline Surface box(const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  return [=](const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
    double enter = 0.0;
    double leave = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
      const double a = (low[axis] - origin[axis]) / direction[axis];
      const double b = (high[axis] - origin[axis]) / direction[axis];
      enter = std::max(enter, std::min(a, b));
      leave = std::min(leave, std::max(a, b));
    }
    return enter <= leave && enter > 0 ? enter : std::numeric_limits<double>::infinity();
  };
}

inline Surface nearest_of(std::vector<Surface> surfaces) {
  return [surfaces = std::move(surfaces)](const Eigen::Vector3d& origin,
                                          const Eigen::Vector3d& direction) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Surface& surface : surfaces) nearest = std::min(nearest, surface(origin, direction));
    return nearest;
  };
}

inline libmap::Camera small_camera() {
  libmap::Camera camera;
  camera.width = 128;
  camera.height = 96;
  camera.fx = 110;
  camera.fy = 110;
  camera.cx = 63.5;
  camera.cy = 47.5;
  return camera;
}

// Returns the pose of a base at `eye` with its x axis towards `target`.
inline libmap::Pose looking(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  const Eigen::Vector3d x = (target - eye).normalized();
  const Eigen::Vector3d up =
      std::abs(x.z()) > 0.9 ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d y = up.cross(x).normalized();
  libmap::Pose pose = libmap::Pose::Identity();
  pose.linear() << x, y, x.cross(y);
  pose.translation() = eye;
  return pose;
}

struct DepthNoiseModel {
  double axial_m = 0.0;
  double of_range = 0.0;
};

// Renders the depth image of a camera at `world_from_camera` (optical frame).
inline libmap::DepthImage render_depth(const Surface& surface, const libmap::Camera& camera,
                                       const libmap::Pose& world_from_camera,
                                       const DepthNoiseModel& noise, std::mt19937_64& engine) {
  libmap::DepthImage depth(camera.width, camera.height);
  std::normal_distribution<double> normal;
  const auto rays = libmap::ray_table(camera);
  for (std::size_t n = 0; n < rays.size(); ++n) {
    if (!rays[n].allFinite()) continue;
    const double z = surface(world_from_camera.translation(),
                             world_from_camera.linear() * rays[n].homogeneous());
    if (std::isfinite(z))
      depth.pixels[n] =
          static_cast<float>(z + (noise.axial_m + noise.of_range * z) * normal(engine));
  }
  return depth;
}

// A scan in memory. Nodes in `broken` cannot be read.
class MemoryScan : public libmap::ScanSource {
 public:
  const std::filesystem::path& path() const override { return path_; }
  const libmap::PoseGraph& graph() const override { return graph_; }
  libmap::RgbdFrame read_frame(int node, libmap::FrameParts parts) const override {
    if (broken.count(node) > 0)
      throw libmap::Error("ends too early",
                          {.file = "memory.db", .field = "node " + std::to_string(node)});
    libmap::RgbdFrame frame = frames.at(node);
    if (!parts.color) frame.color = {};
    if (!parts.depth) frame.depth = {};
    return frame;
  }

  // Adds a frame of one camera. Returns its node, the next number.
  int add(const libmap::Camera& camera, libmap::DepthImage depth, libmap::ColorImage color = {}) {
    const int node = static_cast<int>(frames.size()) + 1;
    libmap::RgbdFrame frame;
    frame.node = node;
    frame.cameras = {camera};
    frame.depth = std::move(depth);
    frame.color = std::move(color);
    frames[node] = std::move(frame);
    return node;
  }

  // Renders a frame and adds its pose to `poses`.
  void see(const Surface& surface, const libmap::Pose& world_from_base,
           const libmap::Camera& camera, const DepthNoiseModel& noise, std::mt19937_64& engine) {
    const libmap::Pose eye = world_from_base * camera.base_from_camera;
    const int node = add(camera, render_depth(surface, camera, eye, noise, engine));
    poses.push_back({node, static_cast<double>(node), world_from_base});
  }

  void set_graph(libmap::PoseGraph graph) { graph_ = std::move(graph); }

  std::map<int, libmap::RgbdFrame> frames;
  std::map<int, bool> broken;
  libmap::Trajectory poses;

 private:
  std::filesystem::path path_ = "memory.db";
  libmap::PoseGraph graph_;
};

}  // namespace graspmap_test
