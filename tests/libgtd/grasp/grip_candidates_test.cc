#include "libgtd/grasp/grip_candidates.h"

#include <gtest/gtest.h>

#include "libgtd/grasp/grasp_trials.h"
#include "tests/libgtd/grasp/grasp_test_support.h"

namespace grip_candidates_test {

using grasp_test::gripper;
using grasp_test::height_mesh;
using libgtd::GripCandidates;

// Low bumps and walls of 0.4 m in a wide grid.
double walled(double x, double y) {
  const double bump = 0.03 * std::cos(31 * x) * std::cos(27 * y);
  const bool is_wall = std::abs(std::remainder(x, 0.5)) < 0.04 && std::abs(y) < 0.45;
  return bump + (is_wall ? 0.4 : 0.0);
}

TEST(GripCandidates, AllThatHoldAreAmongThem) {
  const auto mesh = height_mesh(0.7, 140, walled);
  const GripCandidates candidates(mesh, gripper(), {});
  std::vector<Eigen::Vector3d> places;
  for (double x = -0.5; x < 0.5; x += 0.062)
    for (double y = -0.5; y < 0.5; y += 0.062) places.emplace_back(x, y, walled(x, y));
  libgtd::GraspOptions options;
  options.poses = 8;
  options.draws = 2;
  options.best_draws = 0;
  options.max_distance_m = 0.2;
  const libgtd::Ground ground(mesh);
  int holding = 0;
  int rejected = 0;
  for (const auto& result :
       libgtd::test_grasps(ground, gripper(), places, options, libmap::no_progress())) {
    const bool is_candidate = candidates.may_hold(result.location);
    rejected += is_candidate ? 0 : 1;
    if (!result.holds()) continue;
    ++holding;
    EXPECT_TRUE(is_candidate) << result.location.transpose();
  }
  EXPECT_GT(holding, 40);
  EXPECT_GT(rejected, 40);
}

TEST(GripCandidates, FromAboveOnly) {
  // A table of 0.6 x 0.6 m, 0.3 m above flat ground.
  auto mesh = height_mesh(1.0, 10, [](double, double) { return 0.0; });
  const auto top = height_mesh(0.3, 3, [](double, double) { return 0.3; });
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), top.vertices.begin(), top.vertices.end());
  for (const auto& [a, b, c] : top.triangles)
    mesh.triangles.push_back({a + first, b + first, c + first});
  const GripCandidates candidates(mesh, gripper(), {});
  EXPECT_TRUE(candidates.may_hold({0, 0, 0.3}));
  EXPECT_TRUE(candidates.may_hold({0.02, 0.03, 0.16}));
  EXPECT_FALSE(candidates.may_hold({0, 0, 0}));
  EXPECT_FALSE(candidates.may_hold({0.02, 0.03, 0.14}));
  EXPECT_TRUE(candidates.may_hold({0.6, 0.6, 0}));
  // Beside the table, it blocks some fingers; at the edge, it is above.
  EXPECT_FALSE(candidates.may_hold({0.32, 0, 0}));
  EXPECT_TRUE(candidates.may_hold({0.44, 0, 0}));
  EXPECT_FALSE(candidates.may_hold({std::nan(""), 0, 0}));
  EXPECT_TRUE(candidates.may_hold({9, 9, 0}));  // outside the mesh
}

}  // namespace grip_candidates_test
