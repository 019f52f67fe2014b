#include "libmap/optimize/pose_graph_optimization.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <numbers>

#include "libmap/geometry/rigid_motion.h"
#include "libmap/optimize/graph_covariance.h"
#include "tests/libmap/features/synthetic_features.h"

namespace pose_graph_optimization_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::normal;
using graspmap_test::random_step;
using graspmap_test::uniform;
using libmap::GraphLink;
using libmap::LinkType;
using libmap::Matrix6d;
using libmap::Pose;
using libmap::PoseGraphOptions;
using libmap::PoseGraphResult;
using libmap::PoseLink;
using libmap::Vector6d;

Matrix6d random_information() {
  Matrix6d root;
  for (int n = 0; n < 36; ++n) root(n / 6, n % 6) = uniform(-1, 1);
  return 50.0 * root * root.transpose() + 20.0 * Matrix6d::Identity();
}

Matrix6d diagonal_information(double deviation_m, double deviation_deg) {
  const double turn = deviation_deg * std::numbers::pi / 180.0;
  Vector6d weights;
  weights << Eigen::Vector3d::Constant(1.0 / (deviation_m * deviation_m)),
      Eigen::Vector3d::Constant(1.0 / (turn * turn));
  return weights.asDiagonal();
}

PoseGraphOptions plain() {
  PoseGraphOptions options;
  options.recalibrate = false;
  options.robust_scale = 0;
  return options;
}

GraphLink link(int from, int to, const Pose& motion, const Matrix6d& information,
               bool closure = false) {
  return {PoseLink{from, to, closure ? LinkType::global_closure : LinkType::neighbor, motion,
                   information},
          closure ? "closure" : "neighbor", closure};
}

// Poses on a circle, facing along it.
std::map<int, Pose> circle(int count) {
  std::map<int, Pose> poses;
  for (int n = 0; n < count; ++n) {
    const double angle = 360.0 * n / count;
    poses[n + 1] = libmap::make_pose_from_rpy(
        {std::cos(angle * std::numbers::pi / 180.0), std::sin(angle * std::numbers::pi / 180.0),
         0.05 * std::sin(3.0 * angle)},
        {5.0 * std::sin(angle), 3.0, angle + 90.0});
  }
  return poses;
}

Pose motion_between(const std::map<int, Pose>& poses, int from, int to) {
  return poses.at(from).inverse() * poses.at(to);
}

std::vector<GraphLink> noisy_chain(const std::map<int, Pose>& poses, double shift_m,
                                   double turn_deg, const Matrix6d& stated) {
  std::vector<GraphLink> links;
  for (int n = 1; n < static_cast<int>(poses.size()); ++n) {
    Vector6d error;
    for (int i = 0; i < 6; ++i)
      error[i] = normal(i < 3 ? shift_m : turn_deg * std::numbers::pi / 180.0);
    links.push_back(link(n, n + 1, libmap::moved(motion_between(poses, n, n + 1), error), stated));
  }
  return links;
}

std::map<int, Pose> chained(const Pose& first, const std::vector<GraphLink>& links) {
  std::map<int, Pose> poses = {{1, first}};
  for (const GraphLink& one : links)
    if (one.link.to == one.link.from + 1 && poses.contains(one.link.from))
      poses.try_emplace(one.link.to, poses.at(one.link.from) * one.link.from_from_to);
  return poses;
}

double largest_difference(const std::map<int, Pose>& a, const std::map<int, Pose>& b) {
  double largest = 0.0;
  for (const auto& [node, pose] : a)
    largest = std::max(largest, libmap::step_between(pose, b.at(node)).cwiseAbs().maxCoeff());
  return largest;
}

// For two nodes and measured rotations of zero, the residuals (t - t_m, log R) are linear in
// (t, log R). The optimum is the mean weighted by the information matrices.
TEST(PoseGraphOptimization, OffDiagonalInformationMeetsTheClosedForm) {
  for (int trial = 0; trial < 5; ++trial) {
    Matrix6d sum = Matrix6d::Zero();
    Vector6d side = Vector6d::Zero();
    std::vector<GraphLink> links;
    for (int n = 0; n < 3; ++n) {
      const Matrix6d information = random_information();
      Vector6d measured = Vector6d::Zero();
      for (int i = 0; i < 3; ++i) measured[i] = uniform(-0.2, 0.2);
      links.push_back(link(1, 2, libmap::moved(Pose::Identity(), measured), information, n > 0));
      sum += information;
      side += information * measured;
    }
    const Vector6d expected = sum.ldlt().solve(side);
    ASSERT_GT(expected.tail<3>().norm(), 1e-3) << "the coupling turns the pose";
    const PoseGraphResult result =
        libmap::optimize_pose_graph({{1, Pose::Identity()}, {2, Pose::Identity()}}, links, plain());
    const Vector6d found = libmap::step_between(Pose::Identity(), result.map_from_base.at(2));
    EXPECT_LT((found - expected).norm(), 1e-8);
  }
}

TEST(PoseGraphOptimization, NoiseFreeInputStaysFixed) {
  const std::map<int, Pose> poses = circle(30);
  std::vector<GraphLink> links = noisy_chain(poses, 0, 0, diagonal_information(0.01, 1));
  links.push_back(link(30, 1, motion_between(poses, 30, 1), random_information(), true));
  links.push_back(link(4, 19, motion_between(poses, 4, 19), random_information(), true));
  for (const bool recalibrate : {false, true}) {
    PoseGraphOptions options;
    options.recalibrate = recalibrate;
    const PoseGraphResult result = libmap::optimize_pose_graph(poses, links, options);
    EXPECT_LT(largest_difference(poses, result.map_from_base), 1e-9);
    EXPECT_LT(result.final_cost, 1e-15);
  }
}

TEST(PoseGraphOptimization, TurningTheInputTurnsTheOutput) {
  const std::map<int, Pose> truth = circle(20);
  std::vector<GraphLink> links = noisy_chain(truth, 0.01, 0.3, diagonal_information(0.01, 0.3));
  links.push_back(
      link(20, 1, motion_between(truth, 20, 1), diagonal_information(0.002, 0.1), true));
  const std::map<int, Pose> start = chained(truth.at(1), links);
  const Pose turn = libmap::make_pose_from_rpy({3, -2, 1}, {40, -70, 130});
  std::map<int, Pose> turned;
  for (const auto& [node, pose] : start) turned[node] = turn * pose;
  const PoseGraphResult one = libmap::optimize_pose_graph(start, links, plain());
  const PoseGraphResult other = libmap::optimize_pose_graph(turned, links, plain());
  EXPECT_GT(largest_difference(start, one.map_from_base), 1e-3) << "the loop closes";
  std::map<int, Pose> expected;
  for (const auto& [node, pose] : one.map_from_base) expected[node] = turn * pose;
  EXPECT_LT(largest_difference(expected, other.map_from_base), 1e-7);
}

TEST(PoseGraphOptimization, OneFalseClosureIsRejectedAndDoesNoHarm) {
  const std::map<int, Pose> truth = circle(24);
  std::vector<GraphLink> links = noisy_chain(truth, 0.003, 0.1, diagonal_information(0.003, 0.1));
  const Matrix6d tight = diagonal_information(0.003, 0.1);
  for (const auto& [from, to] : {std::pair(24, 1), {2, 23}, {5, 17}})
    links.push_back(link(from, to,
                         libmap::moved(motion_between(truth, from, to), random_step(0.003, 0.001)),
                         tight, true));
  const std::map<int, Pose> start = chained(truth.at(1), links);
  std::vector<GraphLink> with_false = links;
  with_false.push_back(link(3, 14, motion_between(truth, 3, 4), tight, true));
  for (const bool recalibrate : {false, true}) {
    PoseGraphOptions options;
    options.recalibrate = recalibrate;
    const PoseGraphResult clean = libmap::optimize_pose_graph(start, links, options);
    const PoseGraphResult result = libmap::optimize_pose_graph(start, with_false, options);
    for (std::size_t n = 0; n < links.size(); ++n) EXPECT_FALSE(result.links[n].rejected) << n;
    EXPECT_TRUE(result.links.back().rejected);
    EXPECT_EQ(result.groups.at("closure").rejected, 1U);
    // The first recalibration includes the false closure.
    EXPECT_LT(largest_difference(clean.map_from_base, result.map_from_base),
              recalibrate ? 5e-3 : 1e-6);
    EXPECT_LT(largest_difference(truth, result.map_from_base),
              largest_difference(truth, clean.map_from_base) + (recalibrate ? 2e-3 : 1e-6));
  }
}

TEST(PoseGraphOptimization, PiecesHaveGaugesOfTheirOwn) {
  const std::map<int, Pose> truth = circle(12);
  std::vector<GraphLink> links;
  for (const GraphLink& one : noisy_chain(truth, 0.01, 0.3, diagonal_information(0.01, 0.3)))
    if (one.link.from != 7 && one.link.to != 12) links.push_back(one);
  links.push_back(link(1, 5, motion_between(truth, 1, 5), diagonal_information(0.01, 0.3), true));
  links.push_back(link(8, 11, motion_between(truth, 8, 11), diagonal_information(0.01, 0.3), true));
  PoseGraphOptions options = plain();
  options.gauge_node = 10;
  const PoseGraphResult result = libmap::optimize_pose_graph(truth, links, options);
  ASSERT_EQ(result.components.size(), 3U);
  EXPECT_EQ(result.components[0].nodes, (std::vector<int>{1, 2, 3, 4, 5, 6, 7}));
  EXPECT_EQ(result.components[0].gauge_node, 1);
  EXPECT_EQ(result.components[1].gauge_node, 10);
  EXPECT_EQ(result.components[2].nodes, std::vector<int>{12});
  EXPECT_EQ(result.without_links, std::vector<int>{12});
  for (const int held : {1, 10, 12})
    EXPECT_TRUE(result.map_from_base.at(held).isApprox(truth.at(held), 0)) << held;
  EXPECT_GT(libmap::step_between(truth.at(3), result.map_from_base.at(3)).norm(), 1e-4);
  const libmap::GraphCovariance covariance(result);
  EXPECT_TRUE(covariance.connected(1, 7));
  EXPECT_FALSE(covariance.connected(7, 8));
}

TEST(PoseGraphOptimization, RecalibrationFindsTheTrueDeviations) {
  const std::map<int, Pose> truth = circle(60);
  // Odometry states 3 degrees instead of 0.1; closures state a third of their error.
  std::vector<GraphLink> links = noisy_chain(truth, 0.004, 0.1, diagonal_information(0.008, 3.0));
  for (int n = 1; n <= 57; ++n) {
    Vector6d error;
    for (int i = 0; i < 6; ++i) error[i] = normal(i < 3 ? 0.003 : 0.002);
    links.push_back(link(n, n + 3, libmap::moved(motion_between(truth, n, n + 3), error),
                         diagonal_information(0.001, 0.002 * 60.0 / std::numbers::pi), true));
  }
  const PoseGraphResult result =
      libmap::optimize_pose_graph(chained(truth.at(1), links), links, {});
  const libmap::LinkGroupResult& odometry = result.groups.at("neighbor");
  const libmap::LinkGroupResult& closures = result.groups.at("closure");
  EXPECT_NEAR(odometry.translation_scale, 0.5, 0.15);
  EXPECT_NEAR(odometry.rotation_scale, 1.0 / 30.0, 0.012);
  EXPECT_NEAR(closures.translation_scale, 3.0, 1.0);
  EXPECT_NEAR(closures.rotation_scale, 3.0, 1.0);
  EXPECT_EQ(closures.rejected, 0U);
}

TEST(PoseGraphOptimization, PriorsAndGravityBindTheMap) {
  std::map<int, Pose> truth = circle(6);
  std::vector<GraphLink> links = noisy_chain(truth, 0, 0, diagonal_information(0.01, 0.3));
  const Pose tilt = libmap::make_pose_from_rpy({0, 0, 0}, {4, -3, 0});
  std::map<int, Pose> tilted;
  for (const auto& [node, pose] : truth) tilted[node] = tilt * pose;
  for (const int node : {2, 5})
    links.push_back(
        {PoseLink{node, node, LinkType::gravity, truth.at(node), diagonal_information(1, 0.1)},
         "gravity", false});
  const PoseGraphResult levelled = libmap::optimize_pose_graph(tilted, links, plain());
  for (const auto& [node, pose] : truth)
    EXPECT_LT((levelled.map_from_base.at(node).linear().row(2) - pose.linear().row(2)).norm(),
              1e-6);
  EXPECT_LT((levelled.map_from_base.at(1).translation() - tilted.at(1).translation()).norm(), 1e-6);
  links.push_back({PoseLink{3, 3, LinkType::pose_prior, truth.at(3), diagonal_information(0.1, 1)},
                   "prior", false});
  const PoseGraphResult placed = libmap::optimize_pose_graph(tilted, links, plain());
  EXPECT_LT(largest_difference(truth, placed.map_from_base), 1e-6);
}

TEST(PoseGraphOptimization, LandmarksBindThoseThatSeeThem) {
  const std::map<int, Pose> truth = circle(8);
  std::vector<GraphLink> links = noisy_chain(truth, 0.01, 0.01, diagonal_information(0.01, 0.01));
  const Pose landmark = libmap::make_pose_from_rpy({0.1, 0.2, 0.3}, {10, 20, 30});
  Matrix6d only_place = diagonal_information(0.0005, 1);
  only_place.bottomRightCorner<3, 3>() = 1e-4 * Eigen::Matrix3d::Identity();
  for (const int node : {1, 4, 8})
    links.push_back(
        {PoseLink{node, -7, LinkType::landmark, truth.at(node).inverse() * landmark, only_place},
         "landmark", false});
  const std::map<int, Pose> start = chained(truth.at(1), links);
  const PoseGraphResult result = libmap::optimize_pose_graph(start, links, plain());
  EXPECT_LT((result.map_from_base.at(-7).translation() - landmark.translation()).norm(), 2e-3);
  const auto apart = [&](const std::map<int, Pose>& poses) {
    return (poses.at(8) * truth.at(8).inverse() * landmark.translation() - landmark.translation())
        .norm();
  };
  EXPECT_LT(apart(result.map_from_base), 0.2 * apart(start));
}

TEST(PoseGraphOptimization, BrokenLinksAreErrors) {
  const std::map<int, Pose> poses = circle(3);
  GraphLink bad = link(1, 2, Pose::Identity(), -Matrix6d::Identity());
  EXPECT_TRUE(is_error(error_of([&] { libmap::optimize_pose_graph(poses, {bad}, {}); }),
                       {.field = "link 1 -> 2"}));
  bad.link.information(2, 3) = std::nan("");
  EXPECT_EQ(error_of([&] { libmap::optimize_pose_graph(poses, {bad}, {}); }).context().field,
            "link 1 -> 2");
  PoseGraphOptions options;
  options.robust_scale = -1;
  EXPECT_EQ(error_of([&] { libmap::optimize_pose_graph(poses, {}, options); }).context().field,
            "robust_scale");
  // A link to a node without a pose is ignored.
  const PoseGraphResult result =
      libmap::optimize_pose_graph(poses, {link(1, 99, Pose::Identity(), random_information())}, {});
  EXPECT_EQ(result.without_links.size(), 3U);
  // A relative link from a node to itself is ignored as well.
  EXPECT_EQ(
      libmap::optimize_pose_graph(poses, {link(2, 2, Pose::Identity(), random_information())}, {})
          .without_links.size(),
      3U);
}

// Dense inverse of the information, with derivatives by finite differences.
TEST(GraphCovariance, AgreesWithTheDenseInverse) {
  const std::map<int, Pose> poses = circle(6);
  std::vector<GraphLink> links;
  for (int n = 1; n < 6; ++n)
    links.push_back(link(n, n + 1, motion_between(poses, n, n + 1), random_information()));
  links.push_back(link(6, 2, motion_between(poses, 6, 2), random_information(), true));
  const PoseGraphResult result = libmap::optimize_pose_graph(poses, links, plain());
  const auto residual = [&](const GraphLink& one, const std::vector<Vector6d>& steps) {
    const auto at = [&](int node) {
      return libmap::moved(poses.at(node), steps[static_cast<std::size_t>(node - 1)]);
    };
    return libmap::step_between(one.link.from_from_to,
                                at(one.link.from).inverse() * at(one.link.to));
  };
  constexpr double h = 1e-6;
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(36, 36);
  const auto derivative = [&](const auto& function) {
    Eigen::MatrixXd jacobian(6, 36);
    for (int n = 0; n < 36; ++n) {
      std::vector<Vector6d> steps(6, Vector6d::Zero());
      steps[static_cast<std::size_t>(n / 6)][n % 6] = h;
      const Vector6d above = function(steps);
      steps[static_cast<std::size_t>(n / 6)][n % 6] = -h;
      jacobian.col(n) = (above - function(steps)) / (2 * h);
    }
    return jacobian;
  };
  for (const GraphLink& one : links) {
    const Eigen::MatrixXd jacobian =
        derivative([&](const std::vector<Vector6d>& steps) { return residual(one, steps); });
    information += jacobian.transpose() * one.link.information * jacobian;
  }
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(36, 36);
  covariance.bottomRightCorner(30, 30) = information.bottomRightCorner(30, 30).inverse();
  const libmap::GraphCovariance sparse(result);
  ASSERT_TRUE(sparse.valid());
  EXPECT_TRUE(sparse.of_node(1).isZero());
  for (int node = 2; node <= 6; ++node)
    EXPECT_TRUE(sparse.of_node(node).isApprox(
        covariance.block<6, 6>(6 * (node - 1), 6 * (node - 1)), 1e-4));
  for (const auto& [a, b] : {std::pair(3, 5), {5, 3}, {1, 4}, {6, 2}}) {
    const GraphLink pair = link(a, b, motion_between(poses, a, b), Matrix6d::Identity());
    const Eigen::MatrixXd jacobian =
        derivative([&](const std::vector<Vector6d>& steps) { return residual(pair, steps); });
    EXPECT_TRUE(
        sparse.of_relative(a, b).isApprox(jacobian * covariance * jacobian.transpose(), 1e-4))
        << a << " " << b;
  }
}

// Chains with closures, requested blocks that no system contains, and a diagonal system.
TEST(BlockSolver, SelectedInverseIsThatOfTheColumns) {
  for (const std::size_t size : {1U, 2U, 40U}) {
    libmap::BlockSystem system(size);
    for (std::size_t n = 0; n < size; ++n) system.add(n, n, random_information());
    for (std::size_t n = 0; n + 1 < size; ++n) {
      const Matrix6d link = random_information();
      system.add(n, n, link);
      system.add(n + 1, n + 1, link);
      system.add(n, n + 1, -link);
    }
    for (std::size_t n = 0; n + 9 < size; n += 5) {
      const Matrix6d link = random_information();
      system.add(n, n, link);
      system.add(n + 9, n + 9, link);
      system.add(n + 9, n, -link);
    }
    libmap::BlockSystem wanted(size);
    wanted.add(system);
    if (size > 30) wanted.add(30, 2, Matrix6d::Zero());
    const libmap::BlockSolver solver(system);
    ASSERT_TRUE(solver.valid());
    const libmap::BlockSystem inverse = solver.selected_inverse(wanted);
    EXPECT_EQ(inverse.blocks().size(), wanted.blocks().size());
    for (std::size_t column = 0; column < size; ++column) {
      const std::vector<Matrix6d> expected = solver.inverse_column(column);
      for (const auto& [key, block] : inverse.blocks()) {
        if (key.second != column) continue;
        EXPECT_TRUE(block.isApprox(expected[key.first], 1e-9)) << key.first << " " << column;
      }
    }
  }
}

}  // namespace pose_graph_optimization_test
