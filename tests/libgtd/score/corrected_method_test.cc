// Tests each fault of the author's program that method `corrected` must not have.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "libgtd/detect.h"
#include "libgtd/score/voxel_matching.h"
#include "libmap/core/parallel.h"
#include "tests/libgtd/plain_matching.h"
#include "tests/libgtd/score/score_test_support.h"

namespace libgtd {
namespace corrected_method_test {

using graspmap_test::bumpy_cloud;
using graspmap_test::grid_of;
using graspmap_test::gripper_named;
using graspmap_test::random_ground;
using graspmap_test::uniform;
using libmap::PointCloud;

GripperMask corrected_mask(int extra_void_layers = 1) {
  return make_gripper_mask(gripper_named("scar-e"), {Method::corrected, 0.01, extra_void_layers});
}

DetectionOptions corrected_options() {
  DetectionOptions options;
  options.gripper = gripper_named("scar-e");
  options.scenario.curvature_radius_m = 0.0;
  return options;
}

bool same_voxel(const MapVoxel& a, const MapVoxel& b) {
  return a.voxel == b.voxel && a.counts == b.counts && a.score == b.score && a.convex == b.convex &&
         a.graspable == b.graspable && a.border == b.border;
}

bool same_map(const GraspabilityMap& a, const GraspabilityMap& b) {
  return std::equal(a.voxels.begin(), a.voxels.end(), b.voxels.begin(), b.voxels.end(), same_voxel);
}

// Fault 6: the center of an even mask is half a voxel off the pivot.
TEST(Corrected, MaskIsSymmetricAboutItsPivot) {
  for (const double voxel_size_m : {0.004, 0.005, 0.01, 0.013}) {
    const GripperMask mask =
        make_gripper_mask(gripper_named("scar-e"), {Method::corrected, voxel_size_m, 1});
    ASSERT_EQ(mask.side % 2, 1);
    EXPECT_EQ(mask.pivot_xy, mask.side / 2);
    const int last = mask.side - 1;
    for (int z = 0; z < mask.layers; ++z)
      for (int x = 0; x < mask.side; ++x)
        for (int y = 0; y < mask.side; ++y) {
          EXPECT_EQ(mask.is_solid(x, y, z), mask.is_solid(y, last - x, z));
          EXPECT_EQ(mask.is_solid(x, y, z), mask.is_solid(x, last - y, z));
        }
  }
}

TEST(Corrected, MaskDoesNotRoundItsRadii) {
  // The disc on top: (71 + 4) / 2 = 37.5 mm, at any voxel size.
  for (const double voxel_size_m : {0.001, 0.002, 0.005}) {
    const GripperMask mask =
        make_gripper_mask(gripper_named("scar-e"), {Method::corrected, voxel_size_m, 0});
    double radius_m = 0.0;
    for (int x = 0; x < mask.side; ++x)
      if (mask.is_solid(x, mask.pivot_xy, mask.pivot_z))
        radius_m = std::max(radius_m, std::abs(x - mask.pivot_xy) * voxel_size_m);
    EXPECT_LE(radius_m, 0.0375 + 1e-12);
    EXPECT_GT(radius_m, 0.0375 - voxel_size_m);
  }
}

// Fault 6 on a map: a quarter turn of the voxels rotates the map and changes no score.
TEST(Corrected, QuarterTurnTurnsTheMap) {
  const auto ground = random_ground(60, -20, 5);
  std::vector<Voxel> turned;
  for (const Voxel& voxel : ground) turned.push_back({-1 - voxel.j, voxel.i, voxel.k});
  const GripperMask mask = corrected_mask();
  const VoxelGrid grid = grid_of(ground);
  const VoxelGrid turned_grid = grid_of(turned);
  const auto scored = score_tiles(grid, mask, make_tiles(grid, 17), {});
  const auto turned_scored = score_tiles(turned_grid, mask, make_tiles(turned_grid, 17), {});
  ASSERT_EQ(scored.size(), turned_scored.size());
  std::map<Voxel, ScoredVoxel> by_voxel;
  for (const ScoredVoxel& one : turned_scored) by_voxel[one.voxel] = one;
  for (const ScoredVoxel& one : scored) {
    const ScoredVoxel& other = by_voxel.at({-1 - one.voxel.j, one.voxel.i, one.voxel.k});
    EXPECT_EQ(one.score, other.score);
    EXPECT_EQ(one.border, other.border);
  }
}

// Fault 7: the pivot is in the void layer, so that no score reaches 1. The ground is a cone: it
// falls outward.
TEST(Corrected, GroundCutFromTheMaskScoresOne) {
  const GripperMask mask = corrected_mask();
  std::vector<Voxel> ground;
  for (int z = 0; z < mask.solid_layers; ++z)
    for (int x = 0; x < mask.side; ++x)
      for (int y = 0; y < mask.side; ++y) {
        const double radius = std::hypot(x - mask.pivot_xy, y - mask.pivot_xy);
        if (mask.is_solid(x, y, z) && z <= mask.pivot_z - 0.4 * radius) ground.push_back({x, y, z});
      }
  const VoxelGrid grid = grid_of(ground);
  const auto scored = score_tiles(grid, mask, make_tiles(grid, 100), {});
  const Voxel pivot{mask.pivot_xy, mask.pivot_xy, mask.pivot_z};
  double best = 0.0;
  for (const ScoredVoxel& one : scored) {
    if (one.voxel == pivot) {
      EXPECT_EQ(one.score, 1.0);
    }
    best = std::max(best, one.score);
  }
  EXPECT_EQ(best, 1.0);
}

// Faults 8 and 11: H_add >= 2 and narrow clouds read beyond the grid.
TEST(Corrected, AgreesWithTheTripleLoopForAnyLayersAndNarrowGround) {
  for (const int extra : {0, 1, 2, 5, 30}) {
    const GripperMask mask = corrected_mask(extra);
    for (const int side : {1, 3, 30}) {
      const VoxelGrid grid = grid_of(random_ground(side, 7, -3));
      if (grid.voxels.empty()) continue;
      const TileBounds box = graspmap_test::whole_box(grid);
      const auto pivots = pivots_in(grid, mask, box);
      EXPECT_EQ(pivots.size(), grid.voxels.size());
      EXPECT_EQ(match_voxels(grid, mask, pivots),
                graspmap_test::match_voxels_plainly(grid, mask, pivots));
    }
  }
}

// Fault 9: scores are truncated to whole percents.
TEST(Corrected, ScoresAreNotTruncated) {
  const auto result = detect(bumpy_cloud(0.6, 0.008), corrected_options());
  std::size_t fractions = 0;
  for (const MapVoxel& one : result.map.voxels)
    fractions += std::abs(one.score * 100.0 - std::round(one.score * 100.0)) > 1e-6 ? 1 : 0;
  EXPECT_GT(fractions, result.map.voxels.size() / 2);
}

// Fault 12: the border of half a mask is cut off.
TEST(Corrected, EveryVoxelIsScoredAndTheBorderIsFlagged) {
  DetectionOptions options = corrected_options();
  options.plane = PlaneSource::none;
  const auto result = detect(bumpy_cloud(0.6, 0.005), options);
  EXPECT_EQ(result.map.voxels.size(), result.occupied_voxels);
  const int reach = result.mask.pivot_xy;
  for (const MapVoxel& one : result.map.voxels) {
    const bool near_border =
        one.voxel.i < result.grid_min.i + reach || one.voxel.i > result.grid_max.i - reach ||
        one.voxel.j < result.grid_min.j + reach || one.voxel.j > result.grid_max.j - reach;
    EXPECT_EQ(one.border, near_border) << one.voxel.i << " " << one.voxel.j;
  }
}

// Fault 1: normals change from run to run because of uninitialized memory.
TEST(Corrected, RunsAgreeToTheLastBitAtAnyNumberOfThreads) {
  PointCloud cloud = bumpy_cloud(0.5, 0.01);
  DetectionOptions options = corrected_options();
  options.scenario.curvature_radius_m = 0.05;
  const auto first = detect(cloud, options);
  for (const unsigned threads : {1U, 2U, 8U}) {
    const libmap::ThreadLimit limit(threads);
    const auto again = detect(cloud, options);
    EXPECT_TRUE(same_map(first.map, again.map)) << threads << " threads";
    EXPECT_EQ(first.map.terrain_from_input.matrix(), again.map.terrain_from_input.matrix());
  }
}

// A hill on a floor, as seen by a camera above it.
PointCloud hill(double sign) {
  PointCloud cloud;
  for (double x = -0.3; x <= 0.3; x += 0.006)
    for (double y = -0.3; y <= 0.3; y += 0.006) {
      const double inside = 0.15 * 0.15 - x * x - y * y;
      cloud.positions.emplace_back(x, y, sign * std::sqrt(std::max(0.0, inside)));
    }
  return cloud;
}

// Fault 2: a scene can come out upside down.
TEST(Corrected, CloudUpsideDownComesOutUpright) {
  const libmap::Pose overhead = libmap::make_pose_from_rpy({0.1, -0.2, 2.0}, {180.0, 0.0, 30.0});
  PointCloud seen = libmap::transform_cloud(hill(1.0), overhead);
  seen.viewpoint = libmap::make_pose({0.0, 0.0, 0.5}, Eigen::Quaterniond::Identity());
  const auto result = detect(seen, corrected_options());
  double highest = 0.0;
  double lowest = 0.0;
  for (const MapVoxel& one : result.map.voxels) {
    const double height = result.map.lattice.center_of(one.voxel).z();
    highest = std::max(highest, height);
    lowest = std::min(lowest, height);
  }
  EXPECT_EQ(result.plane->up_source, UpSource::viewpoint);
  EXPECT_GT(highest, 0.1);
  EXPECT_GT(lowest, -0.05);
}

// Fault 3: the heading is arbitrary and grows the bounding box.
TEST(Corrected, HeadingKeepsTheSquareSite) {
  libmap::Pose shift = libmap::Pose::Identity();
  shift.translation() = Eigen::Vector3d(0.7, -0.4, 0.2);
  const auto result = detect(libmap::transform_cloud(hill(1.0), shift), corrected_options());
  EXPECT_NEAR(result.grid_max.i - result.grid_min.i, 60, 2);
  EXPECT_NEAR(result.grid_max.j - result.grid_min.j, 60, 2);
}

// Fault 4: the grid of the interpolation is coarser than eq. 3-5 says.
TEST(Corrected, InterpolationIsAsFineAsItsEquation) {
  DetectionOptions options = corrected_options();
  options.scenario.interpolation = true;
  const PointCloud cloud = bumpy_cloud(0.6, 0.008);
  const auto result = detect(cloud, options);
  const double area = 0.6 * 0.6;
  const double spacing = 1.0 / std::sqrt(static_cast<double>(cloud.size()) / area * 5.0 / 3.0);
  EXPECT_NEAR(result.grid_spacing_m, spacing, 0.15 * spacing);
}

// A grid coarser than the voxels would leave rows of voxels empty.
TEST(Corrected, InterpolationFillsEveryVoxelColumn) {
  DetectionOptions options = corrected_options();
  options.plane = PlaneSource::none;
  options.scenario.interpolation = true;
  PointCloud sparse = bumpy_cloud(0.6, 0.05);
  const auto result = detect(sparse, options);
  EXPECT_LE(result.grid_spacing_m, 0.01);
  std::set<std::pair<int, int>> columns;
  for (const MapVoxel& one : result.map.voxels) columns.insert({one.voxel.i, one.voxel.j});
  for (int i = result.grid_min.i + 1; i < result.grid_max.i; ++i)
    for (int j = result.grid_min.j + 1; j < result.grid_max.j; ++j)
      EXPECT_TRUE(columns.contains({i, j})) << i << " " << j;
}

// Fault 13: curvature without a sign, and convex areas cut in half toward the origin.
TEST(Corrected, BothHalvesOfAHillAreConvexAndABowlIsNot) {
  DetectionOptions options = corrected_options();
  options.plane = PlaneSource::none;
  options.scenario.curvature_radius_m = 0.04;
  for (const double sign : {1.0, -1.0}) {
    PointCloud cloud = hill(sign);
    for (Eigen::Vector3d& point : cloud.positions) point += Eigen::Vector3d(1.0, 0.5, 0.3);
    options.scenario.zero_plane_m = -1.0;
    const auto result = detect(cloud, options);
    std::array<int, 2> convex{};
    std::array<int, 2> all{};
    for (const MapVoxel& one : result.map.voxels) {
      const Eigen::Vector3d center = result.map.lattice.center_of(one.voxel);
      const double distance = std::hypot(center.x() - 1.0, center.y() - 0.5);
      if (distance > 0.08) continue;
      const std::size_t side = center.x() < 1.0 ? 0 : 1;
      ++all[side];
      convex[side] += one.convex ? 1 : 0;
    }
    for (const std::size_t side : {0U, 1U}) {
      ASSERT_GT(all[side], 50);
      EXPECT_EQ(convex[side], sign > 0.0 ? all[side] : 0) << "side " << side;
    }
  }
}

// Fault 14: points are duplicated in the intersection.
TEST(Corrected, EachVoxelStandsOnceInTheMap) {
  PointCloud cloud = bumpy_cloud(0.4, 0.004);
  cloud.positions.insert(cloud.positions.end(), cloud.positions.begin(), cloud.positions.end());
  const auto result = detect(cloud, corrected_options());
  for (std::size_t n = 1; n < result.map.voxels.size(); ++n)
    EXPECT_LT(result.map.voxels[n - 1].voxel, result.map.voxels[n].voxel);
}

}  // namespace corrected_method_test
}  // namespace libgtd
