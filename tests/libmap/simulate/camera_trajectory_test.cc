#include "libmap/simulate/camera_trajectory.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/support/test_support.h"

namespace camera_trajectory_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::square_mesh;
using libmap::CameraTrajectoryOptions;
using libmap::Pose;
using libmap::Trajectory;

constexpr double degrees = 180.0 / std::numbers::pi;

Trajectory carry_camera(const libmap::TriangleMesh& mesh, const CameraTrajectoryOptions& options,
                        std::uint64_t seed) {
  return libmap::poses_of_motion(libmap::camera_motion(mesh, options, seed), options);
}

CameraTrajectoryOptions steady() {
  CameraTrajectoryOptions options;
  options.gaze_deg = 0.0;
  options.sway_m = 0.0;
  options.tremor_deg = 0.0;
  return options;
}

double radius_of(const Pose& pose) { return pose.translation().head<2>().norm(); }

TEST(CarryCamera, TwoLoopsFittedToTheSite) {
  const Trajectory way = carry_camera(square_mesh(0.1, 1.5), steady(), 1);
  ASSERT_EQ(way.size(), 60U);
  double turned = 0;
  for (std::size_t i = 0; i < way.size(); ++i) {
    const Pose& pose = way[i].world_from_base;
    EXPECT_EQ(way[i].node, static_cast<int>(i) + 1);
    EXPECT_DOUBLE_EQ(way[i].stamp_s, 1.7e9 + static_cast<double>(i));
    EXPECT_NEAR(pose.linear().determinant(), 1.0, 1e-12);
    // x looks at the ground in the middle, y is level, z up.
    const Eigen::Vector3d target(0, 0, 0.1);
    EXPECT_LT((pose.linear().col(0) - (target - pose.translation()).normalized()).norm(), 1e-12);
    EXPECT_NEAR(pose.linear()(2, 1), 0.0, 1e-12);
    EXPECT_GT(pose.linear()(2, 2), 0.0);
    if (i == 0) continue;
    const Eigen::Vector3d a = way[i - 1].world_from_base.translation();
    const Eigen::Vector3d b = pose.translation();
    turned += std::atan2(a.x() * b.y() - a.y() * b.x(), a.x() * b.x() + a.y() * b.y());
    EXPECT_NEAR(
        (b - a).norm(),
        (way[1].world_from_base.translation() - way[0].world_from_base.translation()).norm(),
        0.004);
  }
  EXPECT_NEAR(radius_of(way.front().world_from_base), 2.0, 1e-9);
  EXPECT_NEAR(way.front().world_from_base.translation().z(), 0.1 + 1.2, 1e-9);
  EXPECT_NEAR(radius_of(way.back().world_from_base), 1.4, 1e-3);
  EXPECT_NEAR(way.back().world_from_base.translation().z(), 0.1 + 1.6, 1e-3);
  EXPECT_GT(turned * degrees, 690.0);
  EXPECT_LT(turned * degrees, 720.0);
}

TEST(CarryCamera, OptionsDecideTheWay) {
  CameraTrajectoryOptions options = steady();
  options.frames = 40;
  options.loops = 1;
  options.radius_m = 3.0;
  options.height_m = 0.5;
  options.start_deg = 90.0;
  options.sweep_deg = -90.0;
  options.target = Eigen::Vector3d(0.5, 0, 1.0);
  const Trajectory way = carry_camera(square_mesh(0.0, 1.5), options, 1);
  for (const auto& pose : way) {
    const Eigen::Vector3d at = pose.world_from_base.translation();
    EXPECT_NEAR(at.head<2>().norm(), 3.0, 1e-9);
    EXPECT_NEAR(at.z(), 0.5, 1e-9);
    EXPECT_GT(at.x(), -1e-9);
    EXPECT_GT(at.y(), 0.0);
    EXPECT_LT((pose.world_from_base.linear().col(0) - (*options.target - at).normalized()).norm(),
              1e-12);
  }
  EXPECT_NEAR(way.front().world_from_base.translation().x(), 0.0, 1e-9);
}

TEST(CarryCamera, BeforeAWallItGoesToAndFro) {
  // A wall of 3 x 2 m that faces -y.
  libmap::TriangleMesh wall;
  wall.vertices = {{-1.5, 0, 0}, {1.5, 0, 0}, {1.5, 0, 2}, {-1.5, 0, 2}};
  wall.triangles = {{0, 1, 2}, {0, 2, 3}};
  const Trajectory way = carry_camera(wall, steady(), 1);
  double left = 0, right = 0;
  for (const auto& pose : way) {
    const Eigen::Vector3d at = pose.world_from_base.translation();
    EXPECT_LT(at.y(), -0.6);
    EXPECT_GT(at.z(), 1.1);
    EXPECT_GT(pose.world_from_base.linear()(1, 0), 0.4);  // looks at the wall
    left = std::min(left, at.x());
    right = std::max(right, at.x());
  }
  // The arc of 120 degrees; on its way to the right the second one begins to shrink.
  EXPECT_NEAR(left, -2.0 * std::sin(std::numbers::pi / 3), 1e-3);
  EXPECT_GT(right, 1.4);
  EXPECT_LT(way.front().world_from_base.translation().x(), -1.7);
  EXPECT_LT(way.back().world_from_base.translation().x(), -1.0);  // and back again
}

TEST(CarryCamera, TheHandIsUnsteadyBySoMuchAndSmoothInTime) {
  CameraTrajectoryOptions options = steady();
  options.frames = 2000;
  const Trajectory still = carry_camera(square_mesh(0, 1.5), options, 4);
  options.sway_m = 0.01;
  options.tremor_deg = 1.0;
  const Trajectory swaying = carry_camera(square_mesh(0, 1.5), options, 4);
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();
  Eigen::Vector3d turns = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < still.size(); ++i) {
    const Pose& a = still[i].world_from_base;
    const Pose& b = swaying[i].world_from_base;
    squares += (b.translation() - a.translation()).cwiseAbs2();
    const Eigen::AngleAxisd turn(a.linear().transpose() * b.linear());
    turns += (turn.angle() * degrees * turn.axis()).cwiseAbs2();
  }
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(std::sqrt(squares[axis] / 2000), 0.01, 0.001);
    EXPECT_NEAR(std::sqrt(turns[axis] / 2000), 1.0, 0.25);  // looking follows the sway as well
  }
  // 100 times a second: no more than the fastest wave's speed, 2 pi 2 Hz * sqrt(12) * 1 cm.
  options.frame_interval_s = 0.01;
  options.radius_m = options.last_radius_m = 1.0;
  const Trajectory fast = carry_camera(square_mesh(0, 1.5), options, 4);
  const double step = (2 * 2 * std::numbers::pi * 1.0) / 2000;
  for (std::size_t i = 1; i < fast.size(); ++i)
    EXPECT_LT(
        (fast[i].world_from_base.translation() - fast[i - 1].world_from_base.translation()).norm(),
        step + 0.01 * 4 * std::numbers::pi * std::sqrt(12.0) * 0.01 * std::sqrt(3.0));
}

TEST(CarryCamera, SeedsDecideTheUnrestAlone) {
  const libmap::TriangleMesh mesh = square_mesh(0, 1.5);
  const Trajectory a = carry_camera(mesh, {}, 1);
  const Trajectory b = carry_camera(mesh, {}, 1);
  const Trajectory c = carry_camera(mesh, {}, 2);
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].world_from_base.matrix(), b[i].world_from_base.matrix());
    EXPECT_NE(a[i].world_from_base.matrix(), c[i].world_from_base.matrix());
    EXPECT_LT((a[i].world_from_base.translation() - c[i].world_from_base.translation()).norm(),
              0.15);
  }
}

TEST(CarryCamera, OneFrameOneTriangleAndNone) {
  CameraTrajectoryOptions options;
  options.frames = 1;
  EXPECT_EQ(carry_camera(square_mesh(0, 1.5), options, 1).size(), 1U);
  libmap::TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
  mesh.triangles = {{0, 1, 2}};
  for (const auto& pose : carry_camera(mesh, {}, 1))
    EXPECT_TRUE(pose.world_from_base.matrix().allFinite());
  mesh.vertices.clear();
  mesh.triangles.clear();
  EXPECT_TRUE(
      is_error(error_of([&] { carry_camera(mesh, {}, 1); }), {.field = "vertices of the mesh"}));
}

TEST(SurroundingGroundHeight, IsNotTiltedByRocks) {
  libmap::TriangleMesh mesh;
  for (int x = 0; x <= 20; ++x)
    for (int y = 0; y <= 20; ++y) {
      // A rock in the middle and one at the border.
      const bool rock = (std::abs(x - 10) < 6 && std::abs(y - 10) < 6) || (x > 17 && y > 15);
      mesh.vertices.emplace_back(0.1 * x, 0.1 * y, rock ? 0.6 : -0.2);
    }
  EXPECT_DOUBLE_EQ(libmap::surrounding_ground_height(mesh), -0.2);
}

libmap::GroundHeights plain_ground(double length_m, double width_m) {
  std::vector<Eigen::Vector3d> points;
  for (double x = 0.0; x <= length_m + 1e-9; x += 0.25)
    for (double y = 0.0; y <= width_m + 1e-9; y += 0.25) points.emplace_back(x, y, 0.4);
  libmap::GroundHeights ground;
  ground.add(points);
  return ground;
}

TEST(Serpentine, LanesToAndFroJoinedByHalfCircles) {
  CameraTrajectoryOptions options = steady();
  options.frames = 2000;
  options.height_m = 1.0;
  options.serpentine = {.lane_m = 1.6, .border_m = 1.0, .ahead_m = 2.0};
  // Width 8 - 2: 5 lanes, 1.5 m apart; straight: 20 - 2 (1 + 0.75).
  const double radius = 0.75;
  const double straight = 16.5;
  const double length = 5 * straight + 4 * std::numbers::pi * radius;
  for (const bool along_y : {false, true}) {
    const Trajectory way = libmap::poses_of_motion(
        libmap::serpentine_motion(plain_ground(along_y ? 8 : 20, along_y ? 20 : 8), options, 1),
        options);
    ASSERT_EQ(way.size(), 2000U);
    // Chords of the half circles are 1.5 mm shorter in all.
    EXPECT_NEAR(libmap::path_length(way), length * 1999 / 2000, 3e-3);
    const auto at = [&](std::size_t n) -> Eigen::Vector2d {
      const Eigen::Vector3d place = way[n].world_from_base.translation();
      return along_y ? Eigen::Vector2d(place.y(), place.x()) : Eigen::Vector2d(place.head<2>());
    };
    EXPECT_LT((at(0) - Eigen::Vector2d(1.75, 1.0)).norm(), 1e-9);
    for (std::size_t n = 0; n < way.size(); ++n) {
      const Pose& pose = way[n].world_from_base;
      EXPECT_NEAR(pose.translation().z(), 1.4, 1e-9);
      EXPECT_GE(at(n).x(), 1.0 - 1e-9);
      EXPECT_LE(at(n).x(), 19.0 + 1e-9);
      const double way_m = length * static_cast<double>(n) / 2000;
      const double in_lane = std::fmod(way_m, straight + std::numbers::pi * radius);
      const int lane = static_cast<int>(way_m / (straight + std::numbers::pi * radius));
      const double forward = lane % 2 == 0 ? 1.0 : -1.0;
      if (in_lane > straight - options.serpentine.ahead_m) continue;
      EXPECT_NEAR(at(n).y(), 1.0 + 1.5 * lane, 1e-9);
      EXPECT_NEAR(at(n).x(), 10.0 + forward * (in_lane - 0.5 * straight), 1e-6);
      // Looks at the ground 2 m further, 1 m below.
      const double ahead = forward * pose.linear()(along_y ? 1 : 0, 0);
      EXPECT_NEAR(ahead, 2.0 / std::sqrt(5.0), 1e-9);
      EXPECT_NEAR(pose.linear()(2, 0), -1.0 / std::sqrt(5.0), 1e-9);
    }
    EXPECT_NEAR(at(1999).y(), 7.0, 1e-9);
  }
}

TEST(Serpentine, GroundNarrowerThanALane) {
  CameraTrajectoryOptions options = steady();
  options.frames = 10;
  const Trajectory way =
      libmap::poses_of_motion(libmap::serpentine_motion(plain_ground(5, 0.5), options, 1), options);
  for (const libmap::TrajectoryPose& pose : way) {
    EXPECT_NEAR(pose.world_from_base.translation().y(), 0.25, 1e-9);
    EXPECT_TRUE(pose.world_from_base.matrix().allFinite());
  }
  EXPECT_TRUE(is_error(error_of([&] { libmap::serpentine_motion({}, options, 1); }),
                       {.field = "points of the terrain"}));
}

TEST(MotionThrough, GivenPosesAndScrewsBetweenThem) {
  Trajectory poses(3);
  for (std::size_t n = 0; n < 3; ++n) {
    poses[n].stamp_s = 10.0 + static_cast<double>(n) * static_cast<double>(n);
    poses[n].world_from_base = libmap::make_pose_from_rpy({1.0 * static_cast<double>(n), 2, 3},
                                                          {0, 0, 30.0 * static_cast<double>(n)});
  }
  const libmap::CameraMotion motion = libmap::motion_through(poses);
  for (std::size_t n = 0; n < 3; ++n)
    EXPECT_EQ(motion(n, 0.0).matrix(), poses[n].world_from_base.matrix());
  EXPECT_TRUE(motion(0, 1.0).isApprox(poses[1].world_from_base, 1e-12));
  EXPECT_TRUE(motion(1, 3.0).isApprox(poses[2].world_from_base, 1e-12));
  const Pose between = motion(1, 1.5);
  EXPECT_NEAR(std::atan2(between.linear()(1, 0), between.linear()(0, 0)) * degrees, 45.0, 1e-9);
}

TEST(Numbered, StampsOrTheirAbsenceInOrder) {
  const Trajectory unstamped = libmap::assign_nodes_and_stamps(Trajectory(3), 0.5);
  EXPECT_EQ(unstamped[2].node, 3);
  EXPECT_DOUBLE_EQ(unstamped[2].stamp_s, 1.7e9 + 1.0);
  Trajectory poses(3);
  for (std::size_t n = 0; n < 3; ++n) poses[n].stamp_s = 5.0 + static_cast<double>(n);
  EXPECT_DOUBLE_EQ(libmap::assign_nodes_and_stamps(poses, 0.5)[1].stamp_s, 6.0);
  poses[2].stamp_s = 6.0;
  const libmap::Error error = error_of([&] { libmap::assign_nodes_and_stamps(poses, 0.5); });
  EXPECT_EQ(error.context().value, "6");
  EXPECT_EQ(error.context().bound, "> 6");
}

}  // namespace camera_trajectory_test
