#include "libgtd/evaluate/map_change.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "libmap/core/parallel.h"
#include "tests/libgtd/evaluate/map_test_support.h"
#include "tests/support/test_support.h"

namespace map_change_test {

using graspmap_test::error_of;
using graspmap_test::floor_voxels;
using graspmap_test::is_error;
using graspmap_test::level_surface;
using graspmap_test::map_cloud;
using graspmap_test::uniform;
using libgtd::MapChange;
using libgtd::Voxel;
using libgtd::VoxelMap;
using libgtd::VoxelMatching;

const libmap::Pose same = libmap::Pose::Identity();

// Bumpy floor with new scores at each call.
VoxelMap random_map(int first_i, const libmap::Pose& terrain_from_map = same) {
  std::vector<Voxel> voxels;
  for (int i = first_i; i < first_i + 60; ++i)
    for (int j = 0; j < 60; ++j)
      voxels.push_back({i, j, static_cast<int>(std::lround(3.0 * std::sin(0.2 * i + 0.1 * j)))});
  VoxelMap map =
      libgtd::voxel_map_of(map_cloud(voxels, [](const Voxel&) { return uniform(0.0, 1.0); }));
  map.terrain_from_map = terrain_from_map;
  return map;
}

TEST(MapChange, OfAMapAgainstItself) {
  const VoxelMap map = random_map(0);
  const MapChange change = libgtd::compare_maps(map, level_surface(map), map, same);
  EXPECT_EQ(change.matching, VoxelMatching::lattice);
  EXPECT_EQ(change.pairs.size(), map.size());
  EXPECT_TRUE(change.only_map.empty() && change.only_other.empty());
  EXPECT_EQ(change.evaluated.kappa->value, 1.0);
  EXPECT_EQ(change.evaluated.difference.max, 0.0);
  EXPECT_EQ(change.evaluated.difference.min, 0.0);
  EXPECT_NEAR(*change.evaluated.difference.correlation, 1.0, 1e-9);
  EXPECT_EQ(change.evaluated.lost_area_m2 + change.evaluated.gained_area_m2, 0.0);
}

// Independent of the order of the pairs.
TEST(MapChange, CountsOfTheDefinitionOnOneLattice) {
  const VoxelMap map = random_map(0);
  const VoxelMap other = random_map(20);
  const MapChange change = libgtd::compare_maps(map, level_surface(map), other, same);
  std::size_t counts[2][2] = {};
  double sum = 0.0;
  std::size_t pairs = 0;
  for (std::size_t a = 0; a < map.size(); ++a)
    for (std::size_t b = 0; b < other.size(); ++b)
      if (map.voxels[a] == other.voxels[b]) {
        ++counts[map.graspable[a]][other.graspable[b]];
        sum += static_cast<double>(other.scores[b]) - static_cast<double>(map.scores[a]);
        ++pairs;
      }
  EXPECT_EQ(pairs, 40U * 60U);
  EXPECT_EQ(change.pairs.size(), pairs);
  EXPECT_EQ(change.only_map.size(), 20U * 60U);
  EXPECT_EQ(change.only_other.size(), 20U * 60U);
  EXPECT_EQ(change.evaluated.graspable.true_positives, counts[1][1]);
  EXPECT_EQ(change.evaluated.lost(), counts[1][0]);
  EXPECT_EQ(change.evaluated.gained(), counts[0][1]);
  EXPECT_EQ(change.evaluated.graspable.true_negatives, counts[0][0]);
  EXPECT_NEAR(change.evaluated.difference.mean, sum / static_cast<double>(pairs), 1e-12);
  EXPECT_NEAR(change.evaluated.lost_area_m2, static_cast<double>(counts[1][0]) * 1e-4, 1e-8);
  std::size_t by_height = 0;
  for (const libgtd::ChangeSummary& bin : change.by_height) by_height += bin.graspable.size();
  EXPECT_EQ(by_height, pairs);
}

TEST(MapChange, ExchangedMapsTranspose) {
  const libmap::Pose turn = Eigen::Translation3d(0.0131, 0.0242, 0.0017) *
                            Eigen::AngleAxisd(0.37, Eigen::Vector3d(0.05, -0.03, 1.0).normalized());
  const VoxelMap map = random_map(0);
  for (const libmap::Pose& pose : {same, turn}) {
    const VoxelMap other = random_map(10);
    const MapChange there = libgtd::compare_maps(map, level_surface(map), other, pose);
    const MapChange back = libgtd::compare_maps(other, level_surface(other), map, pose.inverse());
    ASSERT_EQ(there.pairs.size(), back.pairs.size());
    EXPECT_GT(there.pairs.size(), 500U);
    EXPECT_EQ(there.only_map, back.only_other);
    EXPECT_EQ(there.evaluated.lost(), back.evaluated.gained());
    EXPECT_EQ(there.evaluated.gained(), back.evaluated.lost());
    EXPECT_EQ(there.evaluated.graspable.true_positives, back.evaluated.graspable.true_positives);
    EXPECT_NEAR(there.evaluated.kappa->value, back.evaluated.kappa->value, 1e-12);
    EXPECT_NEAR(there.evaluated.difference.mean, -back.evaluated.difference.mean, 1e-12);
    EXPECT_EQ(there.evaluated.difference.median, -back.evaluated.difference.median);
    EXPECT_EQ(there.evaluated.difference.low_5, -back.evaluated.difference.high_95);
    EXPECT_EQ(there.evaluated.difference.high_95, -back.evaluated.difference.low_5);
  }
}

TEST(MapChange, PercentilesByHand) {
  const std::vector<Voxel> voxels = {{0, 0, 0}, {1, 0, 0}};
  const VoxelMap map = libgtd::voxel_map_of(map_cloud(voxels, [](const Voxel&) { return 0.25; }));
  const VoxelMap other = libgtd::voxel_map_of(
      map_cloud(voxels, [](const Voxel& voxel) { return voxel.i == 0 ? 0.375 : 0.75; }));
  const auto difference =
      libgtd::compare_maps(map, level_surface(map), other, same).evaluated.difference;
  EXPECT_EQ(difference.low_5, 0.125);
  EXPECT_EQ(difference.median, 0.3125);
  EXPECT_EQ(difference.high_95, 0.5);
}

TEST(MapChange, LatticesShiftedByWholeVoxelsAreOne) {
  const VoxelMap map = random_map(0);
  VoxelMap other = map;
  other.lattice.origin_m = Eigen::Vector3d(0.04, -0.02, 0.07);
  const libmap::Pose shift(Eigen::Translation3d(-0.04, 0.02, -0.07));
  MapChange change = libgtd::compare_maps(map, level_surface(map), other, shift);
  EXPECT_EQ(change.matching, VoxelMatching::lattice);
  EXPECT_EQ(change.pairs.size(), map.size());
  EXPECT_EQ(change.evaluated.kappa->value, 1.0);
  // Shifted by a tenth of a voxel: matched by distance, each with itself.
  const libmap::Pose more(Eigen::Translation3d(-0.039, 0.02, -0.07));
  change = libgtd::compare_maps(map, level_surface(map), other, more);
  EXPECT_EQ(change.matching, VoxelMatching::nearest);
  EXPECT_EQ(change.pairs.size(), map.size());
  EXPECT_EQ(change.evaluated.kappa->value, 1.0);
}

TEST(MapChange, NearestPairsAreThoseOfTheDefinition) {
  const libmap::Pose turn(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()));
  const VoxelMap map = random_map(0);
  const VoxelMap other = random_map(0);
  const MapChange change = libgtd::compare_maps(map, level_surface(map), other, turn);
  const auto nearest = [](const VoxelMap& in, const Eigen::Vector3d& place) {
    std::size_t best = 0;
    for (std::size_t n = 1; n < in.size(); ++n)
      if ((in.center_in_terrain(n) - place).norm() < (in.center_in_terrain(best) - place).norm())
        best = n;
    return best;
  };
  std::vector<std::pair<std::size_t, std::size_t>> slow;
  for (std::size_t a = 0; a < map.size(); ++a) {
    const Eigen::Vector3d place = turn.inverse() * map.center_in_terrain(a);
    const std::size_t b = nearest(other, place);
    if ((other.center_in_terrain(b) - place).norm() <= 0.0087 &&
        nearest(map, turn * other.center_in_terrain(b)) == a)
      slow.emplace_back(a, b);
  }
  ASSERT_EQ(change.pairs.size(), slow.size());
  for (std::size_t n = 0; n < slow.size(); ++n) {
    EXPECT_EQ(change.pairs[n].map, slow[n].first);
    EXPECT_EQ(change.pairs[n].other, slow[n].second);
  }
}

TEST(MapChange, CloudHoldsEveryVoxelOnce) {
  const VoxelMap map = random_map(0, libmap::Pose(Eigen::Translation3d(0, 0, 1)));
  const VoxelMap other = random_map(20);
  const MapChange change = libgtd::compare_maps(map, level_surface(map), other, same);
  const libmap::PointCloud cloud = libgtd::to_cloud(change, map, other, same, false);
  cloud.check();
  EXPECT_EQ(cloud.size(), 80U * 60U);
  // In the frame of MAP's points.
  EXPECT_LT(
      (cloud.positions[0] - (map.center_in_terrain(change.pairs[0].map) - Eigen::Vector3d(0, 0, 1)))
          .norm(),
      1e-12);
  std::size_t counts[6] = {};
  const std::vector<double>& classes = cloud.find_field("change")->values;
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    ++counts[static_cast<std::size_t>(classes[n])];
    EXPECT_EQ(std::isnan(cloud.find_field("difference")->values[n]), classes[n] >= 4.0);
  }
  EXPECT_EQ(counts[2], change.evaluated.gained());
  EXPECT_EQ(counts[3], change.evaluated.lost());
  EXPECT_EQ(counts[4], change.only_map.size());
  EXPECT_EQ(counts[5], change.only_other.size());
}

TEST(MapChange, WhatIsNotEvaluatedDoesNotCount) {
  VoxelMap map = random_map(0);
  VoxelMap other = random_map(0);
  for (std::size_t n = 0; n < 100; ++n) map.border[n] = 1;
  for (std::size_t n = 50; n < 200; ++n) other.scores[n] = std::numeric_limits<float>::quiet_NaN();
  const MapChange change = libgtd::compare_maps(map, level_surface(map), other, same);
  EXPECT_EQ(change.common.graspable.size(), map.size());
  EXPECT_EQ(change.common.difference.count, map.size() - 150);
  EXPECT_EQ(change.evaluated.graspable.size(), map.size() - 200);
}

TEST(MapChange, MapsApartAndOptionsOutOfBounds) {
  const VoxelMap map = random_map(0);
  const libmap::Pose far(Eigen::Translation3d(100.0, 0.0, 0.0));
  EXPECT_TRUE(is_error(error_of([&] { libgtd::compare_maps(map, level_surface(map), map, far); }),
                       {.field = "voxels"}));
  EXPECT_EQ(error_of([&] {
              libgtd::compare_maps(map, level_surface(map), map, same,
                                   {.match_distance_voxels = 0.0});
            })
                .context()
                .field,
            "match_distance_voxels");
  const auto error_with = [&](const libgtd::MapChangeOptions& options) {
    return error_of([&] { libgtd::compare_maps(map, level_surface(map), map, same, options); });
  };
  EXPECT_TRUE(is_error(error_with({.height_bin_m = 0.0}), {.field = "height_bin_m", .value = "0"}));
  EXPECT_EQ(error_with({.height_bin_m = 0.0}).context().field, "height_bin_m");
  EXPECT_EQ(error_with({.slope_bin_deg = -1.0}).context().value, "-1");
  EXPECT_EQ(error_with({.slope_bin_deg = std::nan("")}).context().field, "slope_bin_deg");
  libgtd::MapSurface surface = level_surface(map);
  surface.area_m2.pop_back();
  EXPECT_TRUE(is_error(error_of([&] { libgtd::compare_maps(map, surface, map, same); }),
                       {.field = "area_m2"}));
}

}  // namespace map_change_test
