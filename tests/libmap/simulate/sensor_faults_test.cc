#include "libmap/simulate/sensor_faults.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "libmap/camera/depth_correction.h"
#include "libmap/core/random_stream.h"
#include "libmap/mesh/ray_caster.h"
#include "libmap/simulate/scan_simulation.h"
#include "tests/libmap/mesh/mesh_samples.h"

namespace sensor_faults_test {

using libmap::Pose;
using libmap::ScanSimulationOptions;
using libmap::SurfaceView;

libmap::Camera small_camera() {
  return {.width = 64, .height = 48, .fx = 50.0, .fy = 50.0, .cx = 31.5, .cy = 23.5};
}

libmap::TriangleMesh scene() {
  return graspmap_test::join_meshes(graspmap_test::square_mesh(0.0, 1.5),
                                    graspmap_test::ball_mesh(60, 120, {0, 0, 0.3}, 0.4));
}

ScanSimulationOptions small_scan() {
  ScanSimulationOptions options;
  options.camera = small_camera();
  options.depth = libmap::ideal_depth_sensor(0.2, 6.0);
  options.trajectory.frames = 4;
  return options;
}

std::vector<libmap::RgbdFrame> frames_of(const ScanSimulationOptions& options) {
  std::vector<libmap::RgbdFrame> frames;
  libmap::simulate_scan(scene(), options, [&](const auto&, const libmap::RgbdFrame& frame) {
    frames.push_back(frame);
  });
  return frames;
}

// Maximum distance of a frame's points from ground and ball for a camera at `pose`.
double deviation(const libmap::RgbdFrame& frame, const libmap::Camera& camera,
                 const Pose& world_from_camera) {
  const auto rays = libmap::ray_table(camera);
  double largest = 0.0;
  for (std::size_t p = 0; p < rays.size(); ++p) {
    const auto z = static_cast<double>(frame.depth.pixels[p]);
    if (z == 0.0) continue;
    const Eigen::Vector3d point = world_from_camera * (z * rays[p].homogeneous());
    const double ball = std::abs((point - Eigen::Vector3d(0, 0, 0.3)).norm() - 0.4);
    largest = std::max(largest, std::min(std::abs(point.z()), ball));
  }
  return largest;
}

TEST(SensorFaults, WhatIsOffChangesNothing) {
  ScanSimulationOptions options = small_scan();
  options.depth = {};
  const auto plain = frames_of(options);
  options.faults.depth.error_period_m = 0.7;
  options.faults.photo.blurred_frames = 0.3;
  const auto same = frames_of(options);
  for (std::size_t n = 0; n < plain.size(); ++n) {
    EXPECT_EQ(same[n].depth, plain[n].depth);
    EXPECT_EQ(same[n].color, plain[n].color);
  }
}

TEST(SensorFaults, DepthErrsByRangeAndRadius) {
  ScanSimulationOptions options = small_scan();
  const auto plain = frames_of(options);
  options.faults.depth = {0.8, 0.004, 1.2, 0.006, 0.0};
  const auto faulty = frames_of(options);
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 64; ++x) {
      const auto z = static_cast<double>(plain[1].depth.at(x, y));
      const auto measured = static_cast<double>(faulty[1].depth.at(x, y));
      if (z == 0.0 || measured == 0.0) continue;
      const double radius2 =
          (std::pow(x - 31.5, 2) + std::pow(y - 23.5, 2)) / (31.5 * 31.5 + 23.5 * 23.5);
      EXPECT_NEAR(measured, 1.008 * z + 0.004 * std::sin(2.0 * M_PI * z / 1.2) + 0.006 * radius2,
                  1e-5);
    }
  EXPECT_EQ(faulty[1].color, plain[1].color);
}

TEST(SensorFaults, HolesTakeTheirShare) {
  libmap::DepthImage depth(640, 480, 2.0F);
  const std::size_t lost = libmap::punch_holes(depth, {.holes = 0.1}, 5);
  EXPECT_NEAR(static_cast<double>(lost), 0.1 * 640 * 480, 0.03 * 640 * 480);
  EXPECT_EQ(static_cast<std::size_t>(std::count(depth.pixels.begin(), depth.pixels.end(), 0.0F)),
            lost);
}

TEST(SensorFaults, StoredCameraIsWrongBySoMuch) {
  ScanSimulationOptions options = small_scan();
  options.faults.calibration.focal_percent = 1.0;
  options.faults.calibration.cx_px = 4.0;
  const libmap::Camera stored = frames_of(options)[0].cameras[0];
  EXPECT_DOUBLE_EQ(stored.fx, 50.5);
  EXPECT_DOUBLE_EQ(stored.fy, 50.5);
  EXPECT_DOUBLE_EQ(stored.cx, 35.5);
  EXPECT_DOUBLE_EQ(stored.cy, 23.5);
}

// Depth is on the mesh only from where and when it was taken.
TEST(SensorFaults, DepthIsTakenElsewhereAndLater) {
  ScanSimulationOptions options = small_scan();
  options.faults.calibration.depth_shift_mm = 5.0;
  options.faults.calibration.depth_turn_deg = 0.5;
  options.faults.calibration.depth_delay_s = 0.05;
  const auto frames = frames_of(options);
  const Pose color_from_depth =
      libmap::color_from_depth(options.faults.calibration, libmap::mix_bits(options.seed, 4));
  EXPECT_NEAR(color_from_depth.translation().norm(), 0.005, 1e-12);
  EXPECT_NEAR(Eigen::AngleAxisd(color_from_depth.linear()).angle(), 0.5 * M_PI / 180.0, 1e-9);
  const auto motion =
      libmap::camera_motion(scene(), options.trajectory, libmap::mix_bits(options.seed, 1));
  for (std::size_t n = 0; n < frames.size(); ++n) {
    const auto camera_at = [&](double after_s) {
      return Pose(motion(n, after_s) * options.camera.base_from_camera);
    };
    EXPECT_LT(deviation(frames[n], options.camera, camera_at(0.05) * color_from_depth), 1e-3);
    EXPECT_GT(deviation(frames[n], options.camera, camera_at(0.0)), 4e-3);
  }
}

TEST(SensorFaults, RowsAreSeenFromWhereTheCameraIsThen) {
  const libmap::VisibleSurface surface(scene());
  const libmap::ViewRays rays = libmap::make_view_rays(small_camera());
  const auto pose_at = [](double row) {
    return libmap::make_pose_from_rpy({-1.0 + 0.001 * row, 0.1, 1.0}, {0.0, 40.0, 0.02 * row}) *
           libmap::optical_to_body_rotation();
  };
  const SurfaceView rolling = surface.view(rays, pose_at, false);
  for (const int row : {0, 20, 47}) {
    const SurfaceView still = surface.view(rays, pose_at(row), false);
    for (int x = 0; x < 64; ++x) EXPECT_EQ(rolling.depth.at(x, row), still.depth.at(x, row));
  }
}

// A camera that moves 2 cm to the right past a wall at 1 m: 1 px of 50, an edge as a ramp.
TEST(SensorFaults, BlurFollowsTheMotion) {
  SurfaceView view{libmap::DepthImage(64, 48, 1.0F), {}, {}, {}};
  view.color = libmap::Image<Eigen::Vector3f>(64, 48, Eigen::Vector3f::Zero());
  for (int y = 0; y < 48; ++y)
    for (int x = 32; x < 64; ++x) view.color.at(x, y).setOnes();
  SurfaceView still = view;
  libmap::blur_by_motion(
      still, small_camera(), [](double) { return Pose::Identity(); }, 0.1);
  EXPECT_EQ(still.color, view.color);
  libmap::blur_by_motion(
      view, small_camera(),
      [](double time_s) {
        return libmap::make_pose({0.8 * time_s, 0, 0}, Eigen::Quaterniond::Identity());
      },
      0.1);  // 4 px
  EXPECT_EQ(view.color.at(20, 10).x(), 0.0F);
  EXPECT_EQ(view.color.at(40, 10).x(), 1.0F);
  EXPECT_NEAR(view.color.at(31, 10).x() + view.color.at(32, 10).x(), 1.0F, 1e-4);
  EXPECT_GT(view.color.at(30, 10).x(), 0.05F);
  EXPECT_LT(view.color.at(31, 10).x(), 0.5F);
  EXPECT_NEAR(view.color.at(31, 10).x(), 0.375F, 0.1F);
}

TEST(SensorFaults, ExposureStaysWithinItsBounds) {
  for (std::uint64_t frame = 0; frame < 30; ++frame) {
    SurfaceView view;
    view.color = libmap::Image<Eigen::Vector3f>(1, 1, Eigen::Vector3f::Constant(0.5F));
    libmap::change_exposure(view, {.exposure_drift = 0.4}, 3, frame);
    const Eigen::Vector3f color = view.color.at(0, 0);
    EXPECT_EQ(color.x(), color.z());
    EXPECT_GE(color.x(), 0.3F - 1e-6F);
    EXPECT_LE(color.x(), 0.7F + 1e-6F);
  }
}

// Within a ball of radius R, all is R away, and a point sees all of the ball, on the mean 4/3 R
// away: light of strength rho arrives after R + 2/3 R.
TEST(SensorFaults, MultipathInABallIsThatOfItsMeanChord) {
  const libmap::VisibleSurface ball(graspmap_test::ball_mesh(100, 200, {0, 0, 0}, 1.2));
  const libmap::ViewRays rays = libmap::make_view_rays(small_camera());
  const Pose center = libmap::make_pose_from_rpy({0, 0, 0}, {10, 20, 30});
  SurfaceView view = ball.view(rays, center, false);
  const SurfaceView plain = view;
  libmap::add_multipath(view, ball, rays, center, 0.4);
  const double added = 0.4 / 1.4 * 2.0 / 3.0 * 1.2;
  for (std::size_t n = 0; n < rays.centers.size(); n += 7) {
    const double range_of_depth = rays.centers[n].homogeneous().norm();
    const auto error = static_cast<double>(view.depth.pixels[n] - plain.depth.pixels[n]);
    EXPECT_NEAR(error * range_of_depth, added, 0.01 * added);
  }
  for (std::size_t n = 0; n < rays.corners.size(); n += 7)
    EXPECT_GT(view.corner_depth.pixels[n], plain.corner_depth.pixels[n]);
}

TEST(SensorFaults, MultipathLeavesWhatIsFlatOrConvex) {
  const libmap::VisibleSurface ball(graspmap_test::ball_mesh(60, 120, {2, 0, 0}, 0.5));
  const libmap::VisibleSurface floor(graspmap_test::square_mesh(-1.0, 5.0));
  const libmap::ViewRays rays = libmap::make_view_rays(small_camera());
  const Pose pose =
      libmap::make_pose_from_rpy({0, 0, 0}, {0, 25, 0}) * libmap::optical_to_body_rotation();
  for (const libmap::VisibleSurface* surface : {&ball, &floor}) {
    SurfaceView view = surface->view(rays, pose, false);
    const SurfaceView plain = view;
    libmap::add_multipath(view, *surface, rays, pose, 1.0);
    EXPECT_EQ(view.depth, plain.depth);
  }
}

// Multipath of two planes at a right angle, against the sum over small squares of the other plane.
TEST(SensorFaults, MultipathInACornerIsTheSumOverItsOtherSide) {
  libmap::TriangleMesh corner = graspmap_test::square_mesh(0.0, 1.0);  // z = 0, x and y from -1
  corner.vertices.insert(corner.vertices.end(), {{1, -1, 0}, {1, 1, 0}, {1, 1, 2}, {1, -1, 2}});
  corner.triangles.insert(corner.triangles.end(), {{4, 6, 5}, {4, 7, 6}});
  const Eigen::Vector3d camera(0.0, 0.0, 1.5);
  const Eigen::Vector3d point(0.8, 0.0, 0.0);
  const double range = (point - camera).norm();
  double light = 0.0;
  double sum = 0.0;
  constexpr int steps = 400;
  const double side = 2.0 / steps;
  for (int i = 0; i < steps; ++i)
    for (int j = 0; j < steps; ++j) {
      const Eigen::Vector3d q(1.0, -1.0 + (i + 0.5) * side, (j + 0.5) * side);
      const Eigen::Vector3d way = q - point;
      const Eigen::Vector3d to_camera = camera - q;
      const double d = way.norm();
      const double r = to_camera.norm();
      // Cosines at the point, at q towards the point, at q towards the camera, at the point again.
      const double form = (way.z() / d) * (way.x() / d) / (M_PI * d * d) * side * side;
      const double part = form * (-to_camera.x() / r) / (r * r) * range * range / (1.5 / range);
      light += part;
      sum += part * 0.5 * (d + r - range);
    }
  const double expected = 0.5 * sum / (1.0 + 0.5 * light);
  const libmap::VisibleSurface surface(corner);
  // One pixel, straight at the point.
  const libmap::Camera eye{.width = 1, .height = 1, .fx = 100, .fy = 100, .cx = 0, .cy = 0};
  const libmap::ViewRays rays = libmap::make_view_rays(eye);
  Pose pose = Pose::Identity();
  pose.linear() = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), point - camera)
                      .toRotationMatrix();
  pose.translation() = camera;
  SurfaceView view = surface.view(rays, pose, false);
  libmap::add_multipath(view, surface, rays, pose, 0.5);
  EXPECT_GT(expected, 0.01);
  EXPECT_NEAR(static_cast<double>(view.depth.at(0, 0)) - range, expected, 0.1 * expected);
}

// A third of the size in each direction; the surface is where it is.
TEST(SensorFaults, DepthHasItsOwnSizeAndPlace) {
  ScanSimulationOptions options = small_scan();
  options.faults.calibration.depth_width_px = 32;
  options.faults.calibration.depth_height_px = 24;
  options.faults.calibration.depth_baseline_mm = 40.0;
  const auto frames = frames_of(options);
  const auto motion =
      libmap::camera_motion(scene(), options.trajectory, libmap::mix_bits(options.seed, 1));
  for (std::size_t n = 0; n < frames.size(); ++n) {
    ASSERT_EQ(frames[n].depth.width, 32);
    ASSERT_EQ(frames[n].color.width, 64);
    EXPECT_GT(std::count_if(frames[n].depth.pixels.begin(), frames[n].depth.pixels.end(),
                            [](float z) { return z > 0.0F; }),
              300);
    // Where a pixel of depth falls on one of color it is moved by half a pixel at most.
    const libmap::Camera camera = libmap::camera_views(frames[n]).front().depth_camera;
    EXPECT_LT(deviation(frames[n], camera, Pose(motion(n, 0.0) * options.camera.base_from_camera)),
              0.5 * 3.0 / 25.0);
  }
}

TEST(SensorFaults, FramesAreDroppedRepeatedAndMisdated) {
  const auto recorded = libmap::recorded_frames(
      2000, {.dropped_frames = 0.2, .duplicated_frames = 0.1, .stamp_error_s = 0.01}, 7);
  EXPECT_NEAR(static_cast<double>(recorded.size()), 1600.0, 60.0);
  EXPECT_EQ(recorded.front().frame, 0U);
  std::size_t repeated = 0;
  double squares = 0.0;
  for (std::size_t n = 0; n < recorded.size(); ++n) {
    squares += recorded[n].stamp_error_s * recorded[n].stamp_error_s;
    if (recorded[n].image_frame == recorded[n].frame) continue;
    ++repeated;
    EXPECT_EQ(recorded[n].image_frame, recorded[n - 1].image_frame);
  }
  EXPECT_NEAR(static_cast<double>(repeated), 160.0, 40.0);
  EXPECT_NEAR(std::sqrt(squares / static_cast<double>(recorded.size())), 0.01, 0.0006);

  ScanSimulationOptions options = small_scan();
  const auto plain = frames_of(options);
  options.faults.recording.duplicated_frames = 1.0;
  const auto frozen = frames_of(options);
  ASSERT_EQ(frozen.size(), plain.size());
  for (const libmap::RgbdFrame& frame : frozen) EXPECT_EQ(frame.depth, plain[0].depth);
  EXPECT_EQ(frozen[3].stamp_s, plain[3].stamp_s);
  options.faults.recording = {.dropped_frames = 1.0};
  EXPECT_EQ(frames_of(options).size(), 1U);
}

TEST(SensorFaults, NoiseOfStereoGrowsWithTheSquareOfRange) {
  const libmap::ViewRays rays = libmap::make_view_rays(
      {.width = 100, .height = 100, .fx = 1e4, .fy = 1e4, .cx = 50, .cy = 50});
  for (const float z : {1.0F, 3.0F}) {
    const SurfaceView view{libmap::DepthImage(100, 100, z),
                           libmap::DepthImage(101, 101, z),
                           libmap::Image<float>(100, 100, 1.0F),
                           {}};
    libmap::DepthSensorOptions sensor = libmap::ideal_depth_sensor(0.1, 9.0);
    sensor.noise_of_square = 0.004;
    const auto measured = libmap::measure_depth(view, rays, sensor, 3).depth;
    double squares = 0.0;
    for (const float depth : measured.pixels)
      squares += std::pow(static_cast<double>(depth - z), 2);
    EXPECT_NEAR(std::sqrt(squares / 1e4), 0.004 * static_cast<double>(z * z),
                0.03 * 0.004 * static_cast<double>(z * z));
  }
}

}  // namespace sensor_faults_test
