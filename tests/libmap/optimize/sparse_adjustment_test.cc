#include "libmap/optimize/sparse_adjustment.h"

#include <gtest/gtest.h>

#include "libmap/core/parallel.h"
#include "libmap/optimize/graph_links.h"
#include "tests/libmap/optimize/bundle_scenes.h"

namespace sparse_adjustment_test {

using graspmap_test::error_of_poses;
using graspmap_test::random_step;
using graspmap_test::Scene;
using graspmap_test::scene_of;
using libmap::Pose;

TEST(SparseAdjustment, FindsTheOptimumOfTheGeneralSolver) {
  const Scene scene = scene_of(7, {.apply = true});
  std::vector<libmap::GraphLinkResult> links;
  for (int node = 1; node < 7; ++node) {
    libmap::PoseLink link{.from = node, .to = node + 1};
    link.from_from_to = libmap::moved(scene.truth.at(node).inverse() * scene.truth.at(node + 1),
                                      random_step(0.003, 0.003));
    link.information = 1e5 * libmap::Matrix6d::Identity();
    links.push_back({link, false, 0.5, 0.0});
  }
  links.push_back(links.front());
  links.back().link.from_from_to = Pose::Identity();
  links.back().rejected = true;
  const auto general =
      libmap::adjust_bundle(scene.frames, scene.tracks, scene.start, links, scene.components);
  const auto sparse =
      libmap::adjust_sparse(scene.frames, scene.tracks, scene.start, links, scene.components, {});
  EXPECT_TRUE(sparse.converged);
  EXPECT_NEAR(sparse.final_cost, general.final_cost, 1e-5 * general.final_cost);
  EXPECT_EQ(sparse.observations, general.observations);
  EXPECT_EQ(sparse.tracks, general.tracks);
  EXPECT_NEAR(sparse.reprojection_rms_px, general.reprojection_rms_px, 1e-4);
  for (const auto& [node, pose] : general.map_from_base)
    EXPECT_LT(libmap::step_between(pose, sparse.map_from_base.at(node)).norm(), 5e-5);
  EXPECT_EQ(sparse.map_from_base.at(1).matrix(), scene.start.at(1).matrix());
  for (std::size_t a = 0; a < 7; ++a)
    EXPECT_LT((sparse.information.block(a, a) - general.information.block(a, a)).norm(),
              1e-3 * general.information.block(a, a).norm());
  for (const unsigned threads : {1U, 3U}) {
    const libmap::ThreadLimit limit(threads);
    const auto again =
        libmap::adjust_sparse(scene.frames, scene.tracks, scene.start, links, scene.components, {});
    for (const auto& [node, pose] : sparse.map_from_base)
      EXPECT_EQ(again.map_from_base.at(node).matrix(), pose.matrix());
  }
}

// Gravity and priors of single nodes: normal equations equal finite differences of the cost, which
// both solvers minimize.
TEST(LinkTerms, AbsoluteLinksBindTheirNodes) {
  const Scene scene = scene_of(4, {.apply = true});
  std::vector<libmap::GraphLinkResult> links;
  for (const libmap::LinkType type : {libmap::LinkType::gravity, libmap::LinkType::pose_prior}) {
    libmap::PoseLink link{.from = 2, .to = 2, .type = type};
    link.from_from_to = libmap::moved(scene.start.at(2), random_step(0.02, 0.02));
    link.information = 1e6 * libmap::Matrix6d::Identity();
    links.push_back({link, false, 1.0, 0.0});
    const std::vector<libmap::GraphLinkResult> own = {links.back()};
    const libmap::BlockSystem system = libmap::all_link_system(scene.start, own);
    constexpr double step = 1e-6;
    for (Eigen::Index n = 0; n < 6; ++n) {
      const auto cost_after = [&](double by) {
        std::map<int, Pose> poses = scene.start;
        poses.at(2) = libmap::moved(poses.at(2), by * libmap::Vector6d::Unit(n));
        return libmap::link_cost(poses, own);
      };
      const double slope = (cost_after(step) - cost_after(-step)) / (2.0 * step);
      EXPECT_NEAR(-system.rhs()[1][n], slope, 0.02 * system.rhs()[1].norm()) << n;
    }
  }
  const auto dense =
      libmap::adjust_bundle(scene.frames, scene.tracks, scene.start, links, scene.components);
  const auto sparse =
      libmap::adjust_sparse(scene.frames, scene.tracks, scene.start, links, scene.components, {});
  const auto without =
      libmap::adjust_bundle(scene.frames, scene.tracks, scene.start, {}, scene.components);
  EXPECT_LT(libmap::step_between(dense.map_from_base.at(2), sparse.map_from_base.at(2)).norm(),
            1e-4);
  EXPECT_GT(libmap::step_between(dense.map_from_base.at(2), without.map_from_base.at(2)).norm(),
            1e-3);
}

TEST(SparseAdjustment, RecoversAnExactSceneAndNeverWorsens) {
  const Scene scene = scene_of(6, {});
  const auto result = libmap::adjust_sparse(scene.frames, scene.tracks, scene.start, {},
                                            scene.components, {.max_iterations = 60});
  EXPECT_LT(error_of_poses(scene, result.map_from_base), 2e-6);
  const auto one_step = libmap::adjust_sparse(scene.frames, scene.tracks, scene.start, {},
                                              scene.components, {.max_iterations = 1});
  EXPECT_LE(one_step.final_cost, one_step.initial_cost);
  EXPECT_EQ(one_step.iterations, 1);
}

}  // namespace sparse_adjustment_test
