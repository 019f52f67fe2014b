#include "libmap/simulate/scan_events.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "libmap/simulate/scan_simulation.h"
#include "tests/libmap/mesh/mesh_samples.h"

namespace scan_events_test {

using libmap::ScanSimulationOptions;

libmap::TriangleMesh ground() { return graspmap_test::square_mesh(0.0, 1.5); }

ScanSimulationOptions small_scan() {
  ScanSimulationOptions options;
  options.camera = {.width = 64, .height = 48, .fx = 50.0, .fy = 50.0, .cx = 31.5, .cy = 23.5};
  options.depth = libmap::ideal_depth_sensor(0.05, 6.0);
  options.trajectory.frames = 8;
  return options;
}

struct Scan {
  std::vector<libmap::RgbdFrame> frames;
  libmap::PoseGraph graph;
};
Scan scan(const ScanSimulationOptions& options) {
  Scan scan;
  scan.graph =
      libmap::simulate_scan(ground(), options, [&](const auto&, const libmap::RgbdFrame& frame) {
        scan.frames.push_back(frame);
      }).graph;
  return scan;
}

// The measured points of a frame, in the mesh's frame.
std::vector<Eigen::Vector3d> points_of(const Scan& scan, std::size_t n) {
  std::vector<Eigen::Vector3d> points;
  const libmap::Camera& camera = scan.frames[n].cameras.front();
  const auto rays = libmap::ray_table(camera);
  for (std::size_t p = 0; p < rays.size(); ++p) {
    const auto z = static_cast<double>(scan.frames[n].depth.pixels[p]);
    if (z > 0.0)
      points.push_back(*scan.graph.nodes[n].truth_from_base * camera.base_from_camera *
                       Eigen::Vector3d(z * rays[p].homogeneous()));
  }
  return points;
}

TEST(ScanEvents, APersonWalksAcrossTheSite) {
  ScanSimulationOptions options = small_scan();
  const Scan plain = scan(options);
  options.events.walker_first_frame = 3;
  options.events.walker_frames = 4;
  const Scan walked = scan(options);
  std::size_t on_person = 0;
  std::size_t before_ground = 0;
  for (std::size_t n = 0; n < 8; ++n) {
    if (n < 2 || n >= 6) {
      EXPECT_EQ(walked.frames[n].depth, plain.frames[n].depth);
      EXPECT_EQ(walked.frames[n].color, plain.frames[n].color);
      continue;
    }
    // 3 m in 4 frames: half a step after the border first.
    const Eigen::Vector3d middle(0.0, -1.5 + 0.75 * (static_cast<double>(n) - 1.5), 0.85);
    const Eigen::Array3d radii(0.25, 0.18, 0.85);
    for (const Eigen::Vector3d& point : points_of(walked, n)) {
      const double shell = ((point - middle).array() / radii).matrix().norm();
      const bool is_ground = std::abs(point.z()) < 1e-3;
      EXPECT_TRUE(is_ground || std::abs(shell - 1.0) < 0.1) << point.transpose();
      on_person += is_ground ? 0 : 1;
      before_ground += !is_ground && point.z() < 0.5 ? 1 : 0;
    }
  }
  EXPECT_GT(on_person, 300U);
  EXPECT_GT(before_ground, 50U);
  EXPECT_NE(walked.frames[3].color, plain.frames[3].color);
}

TEST(ScanEvents, AStoneIsMovedOnce) {
  ScanSimulationOptions options = small_scan();
  options.events.stone_moved_frame = 5;
  const Scan moved = scan(options);
  std::size_t on_stone = 0;
  for (std::size_t n = 0; n < 8; ++n)
    for (const Eigen::Vector3d& point : points_of(moved, n))
      if (point.z() > 1e-3) {
        ++on_stone;
        EXPECT_LT(std::abs(point.x() - (n < 4 ? -0.2 : 0.2)), 0.151);
        EXPECT_LT(std::abs(point.y()), 0.121);
        EXPECT_LT(point.z(), 0.181);
      }
  EXPECT_GT(on_stone, 100U);
}

TEST(ScanEvents, SunLimitsTheRange) {
  ScanSimulationOptions options = small_scan();
  options.events.sun_first_frame = 4;
  const Scan sunny = scan(options);
  const auto farthest = [&](std::size_t n) {
    return *std::max_element(sunny.frames[n].depth.pixels.begin(),
                             sunny.frames[n].depth.pixels.end());
  };
  EXPECT_GT(farthest(2), 2.0F);
  for (std::size_t n = 3; n < 8; ++n) EXPECT_LE(farthest(n), 1.5F);
}

TEST(ScanEvents, TheCameraLooksAtAPlainCeiling) {
  ScanSimulationOptions options = small_scan();
  options.photo = {.vignetting = 0.0, .color_noise = 0.0};
  options.events.ceiling_first_frame = 3;
  options.events.ceiling_frames = 2;
  const Scan up = scan(options);
  for (std::size_t n = 0; n < 8; ++n) {
    const bool looks_up = n == 2 || n == 3;
    const Eigen::Vector3d forward =
        up.graph.nodes[n].truth_from_base->linear() * Eigen::Vector3d::UnitX();
    EXPECT_EQ(forward.z() > 0.5, looks_up);
    if (!looks_up) continue;
    for (const Eigen::Vector3d& point : points_of(up, n)) EXPECT_NEAR(point.z(), 2.5, 1e-4);
    for (const libmap::Color& color : up.frames[n].color.pixels)
      EXPECT_EQ(color, up.frames[n].color.pixels.front());
  }
}

}  // namespace scan_events_test
