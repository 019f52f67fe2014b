#include "libmap/simulate/scan_simulation.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <vector>

#include "libmap/core/parallel.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/support/test_support.h"

namespace scan_simulation_test {

using graspmap_test::ball_mesh;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::square_mesh;
using libmap::LinkType;
using libmap::Pose;
using libmap::PoseGraph;
using libmap::PoseLink;
using libmap::ScanSimulationOptions;
using libmap::Trajectory;
using Vector6d = Eigen::Matrix<double, 6, 1>;

// x y z roll pitch yaw of a motion, the inverse of make_pose_from_rpy.
Vector6d components(const Pose& motion) {
  const Eigen::Matrix3d& r = motion.linear();
  Vector6d e;
  e << motion.translation(), std::atan2(r(2, 1), r(2, 2)),
      std::atan2(-r(2, 0), std::hypot(r(2, 1), r(2, 2))), std::atan2(r(1, 0), r(0, 0));
  return e;
}

Vector6d error_of_link(const PoseGraph& graph, const PoseLink& link) {
  const Pose truth = graph.find_node(link.from)->truth_from_base->inverse() *
                     *graph.find_node(link.to)->truth_from_base;
  return components(truth.inverse() * link.from_from_to);
}

Trajectory default_way(std::uint64_t seed) {
  return libmap::poses_of_motion(libmap::camera_motion(square_mesh(0.0, 1.5), {}, seed), {});
}

// Sums over many seeds of the links of one type.
struct LinkStatistics {
  std::size_t count = 0;
  double chi_square = 0.0;
  Vector6d variances = Vector6d::Zero();  // in units of the stated ones
  Vector6d means = Vector6d::Zero();
};

LinkStatistics link_statistics(LinkType type, const libmap::LoopClosureOptions& closures,
                               std::uint64_t seeds) {
  LinkStatistics sums;
  const Trajectory truth = default_way(3);
  for (std::uint64_t seed = 0; seed < seeds; ++seed) {
    const PoseGraph graph = libmap::simulate_odometry(truth, {}, closures, seed);
    for (const PoseLink& link : graph.links) {
      if (link.type != type) continue;
      const Vector6d error = error_of_link(graph, link);
      ++sums.count;
      sums.chi_square += error.dot(link.information * error);
      const Vector6d units = link.information.diagonal().cwiseSqrt().cwiseProduct(error);
      sums.variances += units.cwiseAbs2();
      sums.means += units;
    }
  }
  sums.variances /= static_cast<double>(sums.count);
  sums.means /= static_cast<double>(sums.count);
  return sums;
}

TEST(SimulateOdometry, ErrorsOfNeighborLinksHaveTheStatedCovariance) {
  const LinkStatistics sums = link_statistics(LinkType::neighbor, {}, 300);
  ASSERT_EQ(sums.count, 300U * 59U);
  const auto n = static_cast<double>(sums.count);
  // Chi-square with 6 n degrees of freedom: mean 6 n, variance 12 n.
  EXPECT_NEAR(sums.chi_square, 6 * n, 5 * std::sqrt(12 * n));
  for (int i = 0; i < 6; ++i) {
    EXPECT_NEAR(sums.variances[i], 1.0, 5 * std::sqrt(2 / n));
    EXPECT_NEAR(sums.means[i], 0.0, 5 / std::sqrt(n));
  }
}

TEST(SimulateOdometry, ErrorsOfClosuresHaveTheStatedCovariance) {
  libmap::LoopClosureOptions closures;
  closures.closures = true;
  const LinkStatistics sums = link_statistics(LinkType::global_closure, closures, 200);
  const auto n = static_cast<double>(sums.count);
  ASSERT_GT(n, 200 * 10);
  EXPECT_NEAR(sums.chi_square, 6 * n, 5 * std::sqrt(12 * n));
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(sums.variances[i], 1.0, 5 * std::sqrt(2 / n));
}

TEST(SimulateOdometry, StandardDeviationsGrowWithTheMotion) {
  // 0.5 m forward and 20 degrees to the left; then standing still.
  Trajectory truth(3);
  const Pose step = libmap::make_pose_from_rpy({0.5, 0, 0}, {0, 0, 20});
  for (int i = 0; i < 3; ++i) truth[static_cast<std::size_t>(i)].node = i + 1;
  truth[1].world_from_base = truth[2].world_from_base = step;
  const PoseGraph graph = libmap::simulate_odometry(
      truth, {.error_of_distance = 0.02, .error_of_turn = 0.01, .turn_of_distance_deg = 0.4}, {},
      1);
  const auto deviations = [&](std::size_t link) {
    return Vector6d(graph.links[link].information.diagonal().cwiseInverse().cwiseSqrt());
  };
  const double radians = std::numbers::pi / 180;
  EXPECT_NEAR(deviations(0)[0], 0.01, 1e-12);
  EXPECT_NEAR(deviations(0)[2], 0.01, 1e-12);
  EXPECT_NEAR(deviations(0)[5], (0.2 + 0.2) * radians, 1e-12);
  EXPECT_NEAR(deviations(1)[1], libmap::min_odometry_error_m, 1e-12);
  EXPECT_NEAR(deviations(1)[3], libmap::min_odometry_error_deg * radians, 1e-12);
}

TEST(SimulateOdometry, LinksConnectAllNodesAndAddUpToTheOdometry) {
  const Trajectory truth = default_way(1);
  const PoseGraph graph = libmap::simulate_odometry(truth, {}, {}, 1);
  ASSERT_EQ(graph.nodes.size(), 60U);
  ASSERT_EQ(graph.links.size(), 59U);
  EXPECT_TRUE(graph.nodes.front().odometry_from_base->isApprox(Pose::Identity()));
  EXPECT_TRUE(graph.optimized_map_from_base.empty());
  for (std::size_t i = 0; i < 59; ++i) {
    const PoseLink& link = graph.links[i];
    EXPECT_EQ(link.type, LinkType::neighbor);
    EXPECT_EQ(link.from, graph.nodes[i].id);
    EXPECT_EQ(link.to, graph.nodes[i + 1].id);
    EXPECT_TRUE((*graph.nodes[i].odometry_from_base * link.from_from_to)
                    .isApprox(*graph.nodes[i + 1].odometry_from_base, 1e-12));
  }
}

TEST(SimulateOdometry, ErrorsAddUpAlongTheWay) {
  const Trajectory truth = default_way(1);
  double early = 0, late = 0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    const PoseGraph graph = libmap::simulate_odometry(truth, {}, {}, seed);
    const auto drift = [&](std::size_t i) {
      const Pose expected = truth[0].world_from_base.inverse() * truth[i].world_from_base;
      return (expected.inverse() * *graph.nodes[i].odometry_from_base).translation().squaredNorm();
    };
    early += drift(5);
    late += drift(59);
  }
  EXPECT_GT(std::sqrt(late / early), 3.0);
}

TEST(SimulateOdometry, ClosuresJoinPlacesThatAreNearInSpaceAndFarInTime) {
  const Trajectory truth = default_way(2);
  libmap::LoopClosureOptions options;
  options.closures = true;
  options.closures_per_node = 3;
  const PoseGraph graph = libmap::simulate_odometry(truth, {}, options, 1);
  std::map<int, int> of_node;
  std::set<std::pair<int, int>> pairs;
  for (const PoseLink& link : graph.links) {
    if (link.type == LinkType::neighbor) continue;
    const Pose motion = graph.find_node(link.from)->truth_from_base->inverse() *
                        *graph.find_node(link.to)->truth_from_base;
    EXPECT_LE(motion.translation().norm(), options.distance_m);
    EXPECT_LE(Eigen::AngleAxisd(motion.linear()).angle() * 180 / std::numbers::pi,
              options.angle_deg);
    EXPECT_GE(link.to - link.from, options.node_gap);
    EXPECT_LE(++of_node[link.to], 3);
    EXPECT_TRUE(pairs.insert({link.from, link.to}).second);
  }
  EXPECT_GT(pairs.size(), 20U);
  // The odometry is the same with and without them.
  const PoseGraph plain = libmap::simulate_odometry(truth, {}, {}, 1);
  EXPECT_EQ(plain.nodes.back().odometry_from_base->matrix(),
            graph.nodes.back().odometry_from_base->matrix());
}

ScanSimulationOptions small_scan() {
  ScanSimulationOptions options;
  options.camera = {.width = 64, .height = 53, .fx = 45.6, .fy = 45.6, .cx = 31.6, .cy = 26.1};
  options.trajectory.frames = 11;
  return options;
}

TEST(SimulateScan, FramesLieOnTheMeshByTheirTruePoses) {
  ScanSimulationOptions options = small_scan();
  options.depth = libmap::ideal_depth_sensor(0.5, 4.5);
  const Eigen::Vector3d center(0.2, 0.1, 0.4);
  const libmap::TriangleMesh mesh =
      graspmap_test::join_meshes(square_mesh(0.0, 1.5), ball_mesh(100, 200, center, 0.3));
  int last = 0;
  std::size_t on_ball = 0;
  std::size_t on_ground = 0;
  const auto result = libmap::simulate_scan(
      mesh, options, [&](const libmap::GraphNode& node, const libmap::RgbdFrame& frame) {
        EXPECT_EQ(node.id, ++last);
        EXPECT_EQ(frame.node, node.id);
        EXPECT_EQ(frame.stamp_s, node.stamp_s);
        ASSERT_EQ(frame.cameras.size(), 1U);
        EXPECT_EQ(frame.color.width, 64);
        EXPECT_EQ(frame.depth.height, 53);
        const Pose world_from_camera = *node.truth_from_base * frame.cameras[0].base_from_camera;
        const auto rays = libmap::ray_table(frame.cameras[0]);
        for (std::size_t p = 0; p < rays.size(); ++p) {
          const auto depth = static_cast<double>(frame.depth.pixels[p]);
          if (depth == 0) continue;
          const Eigen::Vector3d point = world_from_camera * (depth * rays[p].homogeneous());
          const bool ball = (point - center).norm() < 0.301;
          on_ball += ball;
          on_ground += !ball;
          if (ball)
            EXPECT_NEAR((point - center).norm(), 0.3, 3e-4);
          else
            EXPECT_NEAR(point.z(), 0.0, 1e-5);
        }
      });
  EXPECT_EQ(last, 11);
  EXPECT_EQ(result.measured_pixels, on_ball + on_ground);
  EXPECT_EQ(result.pixels, 11U * 64U * 53U);
  EXPECT_EQ(result.empty_frames, 0U);
  EXPECT_GT(on_ball, 500U);
  EXPECT_GT(on_ground, 5000U);
  EXPECT_EQ(result.graph.links.size(), 10U);
}

struct Recording {
  std::vector<libmap::RgbdFrame> frames;
  PoseGraph graph;
};
Recording record(const ScanSimulationOptions& options) {
  Recording recording;
  const libmap::TriangleMesh mesh =
      graspmap_test::join_meshes(square_mesh(0.0, 1.5), ball_mesh(20, 40, {0, 0, 0.3}, 0.4));
  recording.graph =
      libmap::simulate_scan(mesh, options, [&](const auto&, const libmap::RgbdFrame& frame) {
        recording.frames.push_back(frame);
      }).graph;
  return recording;
}

TEST(SimulateScan, SameForAnyThreadCountAndAnotherForAnotherSeed) {
  ScanSimulationOptions options = small_scan();
  options.closures.closures = true;
  const Recording reference = record(options);
  for (const unsigned threads : {1U, 3U}) {
    const libmap::ThreadLimit limit(threads);
    const Recording other = record(options);
    for (std::size_t i = 0; i < reference.frames.size(); ++i) {
      EXPECT_EQ(other.frames[i].color, reference.frames[i].color);
      EXPECT_EQ(other.frames[i].depth, reference.frames[i].depth);
    }
    ASSERT_EQ(other.graph.links.size(), reference.graph.links.size());
    for (std::size_t i = 0; i < reference.graph.links.size(); ++i)
      EXPECT_EQ(other.graph.links[i].from_from_to.matrix(),
                reference.graph.links[i].from_from_to.matrix());
  }
  options.seed = 2;
  const Recording another = record(options);
  EXPECT_NE(another.frames[0].depth, reference.frames[0].depth);
  EXPECT_NE(another.frames[0].color, reference.frames[0].color);
  EXPECT_NE(another.graph.links[0].from_from_to.matrix(),
            reference.graph.links[0].from_from_to.matrix());
  // Noise of one frame is not that of the next.
  EXPECT_NE(reference.frames[0].depth, reference.frames[1].depth);
}

TEST(SimulateScan, OneTriangleIsEnough) {
  libmap::TriangleMesh mesh;
  mesh.vertices = {{-0.3, -0.3, 0}, {0.3, -0.3, 0}, {0, 0.3, 0}};
  mesh.triangles = {{0, 1, 2}};
  const auto result = libmap::simulate_scan(mesh, small_scan(), [](const auto&, const auto&) {});
  EXPECT_GT(result.measured_pixels, 0U);
}

TEST(SimulateScan, NothingToSeeIsAnError) {
  const auto nothing = [](const auto&, const auto&) {};
  EXPECT_TRUE(is_error(
      error_of([&] { libmap::simulate_scan(libmap::TriangleMesh{}, small_scan(), nothing); }),
      {.field = "triangles of the mesh"}));
  // Inside a ball nothing is far enough; before a mesh a thousand times too large nothing near.
  ScanSimulationOptions options = small_scan();
  options.trajectory.radius_m = options.trajectory.last_radius_m = 0.01;
  options.trajectory.height_m = options.trajectory.last_height_m = 0.01;
  const libmap::TriangleMesh ball = ball_mesh(20, 40, {0, 0, 0}, 0.2);
  EXPECT_TRUE(is_error(error_of([&] { libmap::simulate_scan(ball, options, nothing); }),
                       {.field = "frames"}));
}

}  // namespace scan_simulation_test
