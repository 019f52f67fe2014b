#include "libgtd/evaluate/map_regions.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "libmap/core/parallel.h"
#include "tests/libgtd/evaluate/map_test_support.h"
#include "tests/support/test_support.h"

namespace region_reach_test {

using graspmap_test::error_of;
using graspmap_test::floor_voxels;
using graspmap_test::is_error;
using graspmap_test::level_surface;
using graspmap_test::map_cloud;
using graspmap_test::uniform;
using libgtd::MapRegionResult;
using libgtd::RegionReach;
using libgtd::Voxel;
using libgtd::VoxelMap;

// Square patches of `width` voxels, lowest corners at (i, j), on a separate floor each.
struct Patch {
  int i = 0;
  int j = 0;
  int width = 1;
};

VoxelMap map_of(const std::vector<Patch>& patches) {
  std::set<Voxel> voxels;
  for (const Patch& patch : patches)
    for (int i = 0; i < patch.width; ++i)
      for (int j = 0; j < patch.width; ++j) voxels.insert({patch.i + i, patch.j + j, 0});
  const std::vector<Voxel> listed(voxels.begin(), voxels.end());
  return libgtd::voxel_map_of(map_cloud(listed, [](const Voxel&) { return 0.9; }));
}

VoxelMap random_map(int size, double fraction) {
  std::vector<Voxel> voxels;
  for (int i = 0; i < size; ++i)
    for (int j = 0; j < size; ++j) voxels.push_back({i, j, static_cast<int>(uniform(0.0, 4.0))});
  return libgtd::voxel_map_of(
      map_cloud(voxels, [&](const Voxel&) { return uniform(0.0, 1.0) < fraction ? 0.9 : 0.3; }));
}

TEST(MapRegions, MeasuresByHand) {
  const VoxelMap map = map_of({{0, 0, 3}, {10, 20, 2}});
  const MapRegionResult result = libgtd::find_regions(map, level_surface(map));
  ASSERT_EQ(result.regions.size(), 2U);
  const libgtd::MapRegion& largest = result.regions[0];
  EXPECT_EQ(largest.voxels.size(), 9U);
  EXPECT_NEAR(largest.area_m2, 9e-4, 1e-9);
  EXPECT_NEAR(largest.plan_area_m2, 9e-4, 1e-9);
  EXPECT_LT((largest.centroid - Eigen::Vector3d(0.015, 0.015, 0.005)).norm(), 1e-9);
  EXPECT_LT((largest.max - largest.min - Eigen::Vector3d(0.02, 0.02, 0)).norm(), 1e-9);
  EXPECT_NEAR(largest.best_score, 0.9, 1e-6);
  EXPECT_EQ(result.region_of_voxel[0], 0);
  EXPECT_EQ(result.region_of_voxel[9], 1);
  EXPECT_EQ(libgtd::find_regions(map, level_surface(map), {.min_voxels = 5}).skipped_voxels, 4U);
}

TEST(MapRegions, VoxelsAboveEachOtherTouch) {
  const VoxelMap map = libgtd::voxel_map_of(
      map_cloud({{0, 0, 0}, {0, 0, 1}, {0, 0, 3}, {1, 1, 4}}, [](const Voxel&) { return 0.9; }));
  const MapRegionResult result = libgtd::find_regions(map, level_surface(map));
  EXPECT_EQ(result.region_of_voxel, (std::vector<std::int32_t>{0, 0, 1, 1}));
}

// Oracle by definition: a label spreads to all voxels whose indices differ by at most `reach`.
std::vector<int> slow_labels(const VoxelMap& map, int reach) {
  std::vector<int> labels(map.size(), -1);
  int next = 0;
  for (std::size_t seed = 0; seed < map.size(); ++seed) {
    if (map.graspable[seed] == 0 || labels[seed] >= 0) continue;
    std::vector<std::size_t> open = {seed};
    labels[seed] = next;
    while (!open.empty()) {
      const Voxel here = map.voxels[open.back()];
      open.pop_back();
      for (std::size_t n = 0; n < map.size(); ++n) {
        const Voxel& there = map.voxels[n];
        if (map.graspable[n] == 0 || labels[n] >= 0 || std::abs(here.i - there.i) > reach ||
            std::abs(here.j - there.j) > reach || std::abs(here.k - there.k) > reach)
          continue;
        labels[n] = next;
        open.push_back(n);
      }
    }
    ++next;
  }
  return labels;
}

TEST(MapRegions, AreThoseOfTheDefinition) {
  for (const int reach : {1, 2}) {
    const VoxelMap map = random_map(40, 0.2);
    const MapRegionResult result =
        libgtd::find_regions(map, level_surface(map), {.adjacency_voxels = reach});
    const std::vector<int> slow = slow_labels(map, reach);
    EXPECT_EQ(result.regions.size(),
              static_cast<std::size_t>(*std::max_element(slow.begin(), slow.end())) + 1);
    EXPECT_GT(result.regions.size(), 10U);
    std::set<std::pair<int, int>> pairs;
    for (std::size_t n = 0; n < map.size(); ++n) pairs.insert({slow[n], result.region_of_voxel[n]});
    // Labels correspond one to one.
    EXPECT_EQ(pairs.size(), result.regions.size() + 1);
    for (std::size_t r = 1; r < result.regions.size(); ++r)
      EXPECT_GE(result.regions[r - 1].area_m2, result.regions[r].area_m2);
  }
}

TEST(RegionReach, StrideAgainstKnownDistances) {
  // Gaps of 10 voxels between the first two and of 30 to the third, from center to center.
  const VoxelMap map = map_of({{0, 0, 4}, {13, 0, 3}, {45, 0, 2}});
  const MapRegionResult regions = libgtd::find_regions(map, level_surface(map));
  const auto reach_of = [&](double stride) {
    return libgtd::find_reach(map, regions, {.stride_m = stride});
  };
  RegionReach reach = reach_of(0.099);
  EXPECT_EQ(reach.groups, 3U);
  EXPECT_TRUE(reach.links.empty());
  EXPECT_EQ(reach.reachable_regions, 1U);
  EXPECT_NEAR(*reach.joining_stride_m, 0.3, 1e-12);
  EXPECT_NEAR(reach.access[1].stride_needed_m, 0.1, 1e-12);
  EXPECT_NEAR(reach.access[2].stride_needed_m, 0.3, 1e-12);
  reach = reach_of(0.1);
  EXPECT_EQ(reach.groups, 2U);
  ASSERT_EQ(reach.links.size(), 1U);
  EXPECT_NEAR(reach.links[0].distance_m, 0.1, 1e-12);
  EXPECT_EQ(map.voxels[reach.links[0].voxel_a].i, 3);
  EXPECT_EQ(map.voxels[reach.links[0].voxel_b].i, 13);
  EXPECT_EQ(*reach.access[1].steps, 1U);
  EXPECT_FALSE(reach.access[2].reachable);
  EXPECT_FALSE(reach.access[2].steps);
  reach = reach_of(0.3);
  EXPECT_EQ(reach.groups, 1U);
  EXPECT_EQ(reach.links.size(), 2U);
  EXPECT_EQ(*reach.access[0].steps, 0U);
  EXPECT_EQ(*reach.access[2].steps, 2U);
  EXPECT_NEAR(reach.reachable_area_m2, 29e-4, 1e-9);
  EXPECT_EQ(reach_of(0.42).links.size(), 3U);
}

TEST(RegionReach, FromAPlace) {
  const VoxelMap map = map_of({{0, 0, 4}, {13, 0, 3}, {45, 0, 2}});
  const MapRegionResult regions = libgtd::find_regions(map, level_surface(map));
  const auto reach_from = [&](double x) {
    return libgtd::find_reach(map, regions,
                              {.stride_m = 0.15, .start = Eigen::Vector3d(x, 0.005, 0.005)});
  };
  // On the third; halfway between it and the second; far from all.
  RegionReach reach = reach_from(0.458);
  EXPECT_EQ(*reach.start_region, 2U);
  EXPECT_EQ(reach.reachable_regions, 1U);
  EXPECT_EQ(*reach.access[2].steps, 0U);
  reach = reach_from(0.305);
  EXPECT_EQ(reach.reachable_regions, 3U);
  EXPECT_EQ(*reach.access[0].steps, 2U);
  EXPECT_NEAR(reach.access[0].stride_needed_m, 0.15, 1e-9);
  reach = reach_from(2.0);
  EXPECT_EQ(reach.reachable_regions, 0U);
  EXPECT_NEAR(reach.start_distance_m, 2.0 - 0.465, 1e-9);
  EXPECT_NEAR(reach.access[0].stride_needed_m, 2.0 - 0.465, 1e-9);
}

struct SlowReach {
  std::vector<std::vector<double>> distance;  // between regions
  std::vector<std::vector<double>> stride;    // minimum over paths of the longest step
};

// All pairs of voxels, then Floyd and Warshall with the longest step as path length.
SlowReach slow_reach(const VoxelMap& map, const MapRegionResult& regions) {
  const std::size_t count = regions.regions.size();
  SlowReach slow;
  slow.distance.assign(count, std::vector<double>(count, 1e9));
  for (std::size_t a = 0; a < count; ++a) {
    slow.distance[a][a] = 0.0;
    for (std::size_t b = 0; b < count; ++b)
      for (const auto m : regions.regions[a].voxels)
        for (const auto n : regions.regions[b].voxels)
          slow.distance[a][b] = std::min(
              slow.distance[a][b], (map.center_in_terrain(m) - map.center_in_terrain(n)).norm());
  }
  slow.stride = slow.distance;
  for (std::size_t via = 0; via < count; ++via)
    for (std::size_t a = 0; a < count; ++a)
      for (std::size_t b = 0; b < count; ++b)
        slow.stride[a][b] =
            std::min(slow.stride[a][b], std::max(slow.stride[a][via], slow.stride[via][b]));
  return slow;
}

TEST(RegionReach, IsThatOfTheDefinition) {
  for (const double fraction : {0.005, 0.03}) {
    const VoxelMap map = random_map(60, fraction);
    const MapRegionResult regions = libgtd::find_regions(map, level_surface(map));
    const std::size_t count = regions.regions.size();
    ASSERT_GT(count, 8U);
    const SlowReach slow = slow_reach(map, regions);
    for (const double stride : {0.02, 0.07, 0.5}) {
      const RegionReach reach = libgtd::find_reach(map, regions, {.stride_m = stride});
      std::size_t links = 0;
      for (std::size_t a = 0; a < count; ++a)
        for (std::size_t b = a + 1; b < count; ++b)
          links += slow.distance[a][b] <= stride + 1e-9 ? 1 : 0;
      EXPECT_EQ(reach.links.size(), links);
      for (const libgtd::RegionLink& link : reach.links) {
        EXPECT_NEAR(link.distance_m, slow.distance[link.a][link.b], 1e-12);
        EXPECT_NEAR(
            (map.center_in_terrain(link.voxel_a) - map.center_in_terrain(link.voxel_b)).norm(),
            link.distance_m, 1e-12);
      }
      EXPECT_EQ(reach.tree.size(), count - 1);
      double joining = 0.0;
      for (std::size_t r = 0; r < count; ++r) {
        joining = std::max(joining, slow.stride[0][r]);
        EXPECT_NEAR(reach.access[r].stride_needed_m, slow.stride[0][r], 1e-12);
        EXPECT_EQ(reach.access[r].reachable, slow.stride[0][r] <= stride + 1e-9);
        EXPECT_EQ(reach.access[r].group == reach.access[0].group, reach.access[r].reachable);
      }
      EXPECT_NEAR(*reach.joining_stride_m, joining, 1e-12);
    }
  }
}

TEST(RegionReach, NoRegionAndOneRegion) {
  const VoxelMap none =
      libgtd::voxel_map_of(map_cloud(floor_voxels(5, 5), [](const Voxel&) { return 0.2; }));
  RegionReach reach = libgtd::find_reach(none, libgtd::find_regions(none, level_surface(none)));
  EXPECT_FALSE(reach.joining_stride_m);
  EXPECT_FALSE(reach.start_region);
  const VoxelMap one = map_of({{0, 0, 2}});
  reach = libgtd::find_reach(one, libgtd::find_regions(one, level_surface(one)));
  EXPECT_EQ(*reach.joining_stride_m, 0.0);
  EXPECT_EQ(reach.reachable_regions, 1U);
}

TEST(RegionReach, SameForAnyNumberOfThreads) {
  const VoxelMap map = random_map(80, 0.05);
  const MapRegionResult regions = libgtd::find_regions(map, level_surface(map));
  const auto voxels_of = [&](unsigned threads) {
    const libmap::ThreadLimit limit(threads);
    const RegionReach reach = libgtd::find_reach(map, regions, {.stride_m = 0.08});
    std::vector<std::uint32_t> voxels;
    for (const libgtd::RegionLink& link : reach.links) {
      voxels.push_back(link.voxel_a);
      voxels.push_back(link.voxel_b);
    }
    return voxels;
  };
  EXPECT_EQ(voxels_of(1), voxels_of(2));
}

TEST(RegionReach, OptionsOutOfBounds) {
  const VoxelMap map = map_of({{0, 0, 2}});
  const MapRegionResult regions = libgtd::find_regions(map, level_surface(map));
  EXPECT_EQ(error_of([&] { libgtd::find_reach(map, regions, {.stride_m = 0.0}); }).context().field,
            "stride_m");
  const Eigen::Vector3d nowhere(0.0, std::nan(""), 0.0);
  EXPECT_EQ(error_of([&] { libgtd::find_reach(map, regions, {.start = nowhere}); }).context().field,
            "start");
  EXPECT_EQ(
      error_of([&] { libgtd::find_regions(map, level_surface(map), {.adjacency_voxels = 0}); })
          .context()
          .field,
      "adjacency_voxels");
  libgtd::MapSurface surface = level_surface(map);
  surface.area_m2.pop_back();
  EXPECT_TRUE(
      is_error(error_of([&] { libgtd::find_regions(map, surface); }), {.field = "area_m2"}));
}

// Squares of their distances are infinite: no reach links them.
TEST(RegionReach, TooFarApartForDistances) {
  VoxelMap map = map_of({{0, 0}, {4, 0}});
  const MapRegionResult regions = libgtd::find_regions(map, level_surface(map));
  map.lattice.voxel_size_m = 1e200;
  const libmap::Error error = error_of([&] { libgtd::find_reach(map, regions); });
  EXPECT_TRUE(is_error(error, {.field = "voxel_size_m", .value = "1e+200"}));
  EXPECT_EQ(error.context().field, "voxel_size_m");
  map.lattice.voxel_size_m = 0.01;
  const RegionReach reach =
      libgtd::find_reach(map, regions, {.stride_m = std::numeric_limits<double>::max()});
  EXPECT_EQ(reach.reachable_regions, 2U);
}

TEST(RegionReach, TooManyPairsWithinAStride) {
  std::vector<Patch> patches;
  for (int i = 0; i < 68; ++i)
    for (int j = 0; j < 68; ++j) patches.push_back({2 * i, 2 * j});
  const VoxelMap map = map_of(patches);
  const MapRegionResult regions = libgtd::find_regions(map, level_surface(map));
  ASSERT_EQ(regions.regions.size(), 68U * 68U);
  const libmap::Error error =
      error_of([&] { libgtd::find_reach(map, regions, {.stride_m = 2.5}); });
  EXPECT_TRUE(is_error(error, {.field = "stride_m", .value = "2.5"}));
  EXPECT_EQ(error.context().field, "stride_m");
  EXPECT_EQ(error.context().value, "2.5");
}

}  // namespace region_reach_test
