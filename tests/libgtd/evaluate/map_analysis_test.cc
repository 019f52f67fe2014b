#include "libgtd/evaluate/map_analysis.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "libgtd/evaluate/voxel_map.h"
#include "libmap/core/score_color.h"
#include "tests/libgtd/evaluate/map_test_support.h"
#include "tests/support/test_support.h"

namespace map_analysis_test {

using graspmap_test::error_of;
using graspmap_test::floor_voxels;
using graspmap_test::is_error;
using graspmap_test::level_surface;
using graspmap_test::map_cloud;
using graspmap_test::random_engine;
using libgtd::GroundBin;
using libgtd::MapAnalysis;
using libgtd::MapInfo;
using libgtd::ScoreBin;
using libgtd::Voxel;
using libgtd::VoxelMap;
using libmap::PointCloud;

const libgtd::VoxelLattice lattice{Eigen::Vector3d::Zero(), graspmap_test::test_voxel_m};

// 100 scores from 0.005 to 0.995 over each row of i.
PointCloud graded_floor() {
  return map_cloud(floor_voxels(100, 20), [](const Voxel& v) { return 0.01 * v.i + 0.005; });
}

TEST(VoxelMap, DoesNotDependOnTheOrderOfPoints) {
  const PointCloud cloud = graded_floor();
  std::vector<std::size_t> order(cloud.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::shuffle(order.begin(), order.end(), random_engine());
  const VoxelMap sorted = libgtd::voxel_map_of(cloud, {.lattice = lattice});
  const VoxelMap shuffled =
      libgtd::voxel_map_of(libmap::select_points(cloud, order), {.lattice = lattice});
  EXPECT_EQ(sorted.voxels, shuffled.voxels);
  EXPECT_EQ(sorted.scores, shuffled.scores);
  EXPECT_EQ(sorted.graspable, shuffled.graspable);
  for (std::size_t n = 0; n < sorted.size(); ++n)
    EXPECT_EQ(order[shuffled.map_points[n]], sorted.map_points[n]);
}

TEST(VoxelMap, LatticeFromIndicesOrFromPlaces) {
  PointCloud cloud = graded_floor();
  const VoxelMap fitted = libgtd::voxel_map_of(cloud);
  EXPECT_NEAR(fitted.lattice.voxel_size_m, 0.01, 1e-12);
  EXPECT_LT(fitted.lattice.origin_m.norm(), 1e-12);
  std::erase_if(cloud.fields, [](const auto& field) { return field.name == "i"; });
  EXPECT_EQ(libgtd::voxel_map_of(cloud, {.lattice = lattice}).voxels, fitted.voxels);
  // In another frame with a known transform to the terrain.
  const libmap::Pose terrain_from_map(
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  const PointCloud turned = libmap::transform_cloud(graded_floor(), terrain_from_map.inverse());
  for (const bool known : {true, false}) {
    MapInfo info{.terrain_from_map = terrain_from_map};
    if (known) info.lattice = lattice;
    EXPECT_EQ(libgtd::voxel_map_of(turned, info).voxels, fitted.voxels);
  }
}

TEST(VoxelMap, HostileMapsAreSaid) {
  const auto field_of = [](PointCloud cloud, const MapInfo& info = {}) {
    return error_of([&] { libgtd::voxel_map_of(cloud, info); }).context().field;
  };
  PointCloud plain;
  plain.positions.assign(3, Eigen::Vector3d::Zero());
  EXPECT_EQ(field_of(plain), "score");
  EXPECT_EQ(field_of({}), "score");
  for (const char* name : {"score", "graspable", "i", "k"}) {
    PointCloud cloud = graded_floor();
    std::erase_if(cloud.fields, [&](const auto& field) { return field.name == name; });
    EXPECT_EQ(field_of(cloud), name);
  }
  PointCloud cloud = graded_floor();
  cloud.find_field("j")->values[5] = std::nan("");
  EXPECT_EQ(field_of(cloud), "j");
  cloud.find_field("j")->values[5] = 1e12;
  EXPECT_EQ(field_of(cloud), "j");
  cloud = graded_floor();
  cloud.positions[17].x() += 0.004;
  EXPECT_EQ(field_of(cloud, {.lattice = lattice}), "distance of point 17 from a voxel center");
  cloud = graded_floor();
  EXPECT_EQ(field_of(libmap::transform_cloud(
                cloud, libmap::Pose(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ())))),
            "distance of point 0 from a voxel center");
  for (const char* name : {"i", "j", "k"})
    cloud.find_field(name)->values[1] = cloud.find_field(name)->values[0];
  cloud.positions[1] = cloud.positions[0];
  EXPECT_EQ(field_of(cloud), "i, j, k");
  cloud = graded_floor();
  std::erase_if(cloud.fields, [](const auto& field) { return field.name == "i"; });
  cloud.positions[17].x() = 1e9;
  const libmap::Error far = error_of([&] { libgtd::voxel_map_of(cloud, {.lattice = lattice}); });
  EXPECT_TRUE(is_error(far, {.field = "point 17"}));
  EXPECT_EQ(far.context().field, "point 17");
  const PointCloud one = map_cloud({{3, 4, 5}}, [](const Voxel&) { return 1.0; });
  EXPECT_EQ(field_of(one), "voxel_size_m");
  EXPECT_EQ(libgtd::voxel_map_of(one, {.lattice = lattice}).size(), 1U);
  // Points without a position are left out; points without a score are not graspable.
  cloud = graded_floor();
  for (Eigen::Vector3d& position : cloud.positions) position.z() = std::nan("");
  EXPECT_TRUE(
      is_error(error_of([&] { libgtd::voxel_map_of(cloud); }), {.field = "points of the map"}));
  cloud = graded_floor();
  cloud.find_field("score")->values[1990] = std::nan("");
  cloud.positions[1991].x() = std::nan("");
  const VoxelMap map = libgtd::voxel_map_of(cloud);
  EXPECT_EQ(map.size(), 1999U);
  EXPECT_FALSE(map.evaluated(1990, true));
  EXPECT_EQ(map.graspable[1990], 0);
}

// A null in a manifest is not a number; comparing one coordinate of three would miss it.
TEST(VoxelMap, LatticesThatAreNotFinite) {
  PointCloud map = graded_floor();
  std::erase_if(map.fields, [](const auto& field) { return field.name.size() == 1; });  // i, j, k
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> origin = {0.0, 0.0, 0.0};
    origin[static_cast<std::size_t>(axis)] = std::nan("");
    libmap::Manifest manifest;
    manifest.parameters = {{"voxel_size_m", 0.01}};
    manifest.results = {{"lattice_origin_m", origin}};
    EXPECT_TRUE(is_error(error_of([&] { libgtd::map_info(manifest); }),
                         {.field = "lattice_origin_m or voxel_size_m"}));
    MapInfo info;
    info.lattice = libgtd::VoxelLattice{{origin[0], origin[1], origin[2]}, 0.01};
    EXPECT_TRUE(is_error(error_of([&] { libgtd::voxel_map_of(map, info); }), {.field = "point 0"}));
  }
}

// Squares of their distances would overflow.
TEST(VoxelMap, LatticesOutOfRange) {
  PointCloud map = graded_floor();
  for (const double size_m : {1e200, 1e-200}) {
    const libmap::Error error = error_of([&] {
      libgtd::voxel_map_of(map, {.lattice = libgtd::VoxelLattice{Eigen::Vector3d::Zero(), size_m}});
    });
    EXPECT_EQ(error.context().field, "voxel_size_m");
    EXPECT_EQ(error.context().bound, "1e-100 to 1e+100");
  }
  const libmap::Error far = error_of([&] {
    libgtd::voxel_map_of(map, {.lattice = libgtd::VoxelLattice{{0.0, -1e200, 0.0}, 0.01}});
  });
  EXPECT_EQ(far.context().field, "lattice_origin_m");
  // As with the fields i, j and k.
  for (Eigen::Vector3d& position : map.positions) position *= 1e150;
  EXPECT_EQ(error_of([&] { libgtd::voxel_map_of(map); }).context().field, "voxel_size_m");
}

TEST(MapAnalysis, CountsAndAreasByHand) {
  PointCloud cloud = graded_floor();
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    // 20 of the best are obstacles; the first row along y is at the edges.
    if (cloud.find_field("i")->values[n] == 99.0) cloud.find_field("convex");
    cloud.find_field("border")->values[n] = cloud.find_field("j")->values[n] == 0.0 ? 1.0 : 0.0;
  }
  cloud.add_field("obstacle", libmap::ScalarType::uint8);
  for (std::size_t n = 0; n < cloud.size(); ++n)
    if (cloud.find_field("i")->values[n] == 99.0) cloud.find_field("obstacle")->values[n] = 1.0;
  const VoxelMap map = libgtd::voxel_map_of(cloud);
  const MapAnalysis result = libgtd::analyze_map(map, level_surface(map));
  EXPECT_EQ(result.voxels, 2000U);
  EXPECT_EQ(result.at_border, 100U);
  PointCloud earlier = cloud;  // format of earlier versions
  earlier.find_field("border")->name = "edge";
  EXPECT_EQ(libgtd::voxel_map_of(earlier).border, map.border);
  EXPECT_EQ(result.obstacles, 20U);
  EXPECT_EQ(result.graspable, 19U * 20U);  // 0.805 to 0.985
  EXPECT_EQ(result.ground.voxels, 1900U);
  EXPECT_EQ(result.ground.graspable_voxels, 19U * 19U);
  EXPECT_NEAR(result.ground.area_m2, 0.19, 1e-7);
  EXPECT_NEAR(*result.ground.graspable_fraction(), 0.19, 1e-6);
  EXPECT_NEAR(*result.ground.mean_score(), 0.5, 1e-6);
  EXPECT_EQ(result.columns, 1900U);
  EXPECT_EQ(result.graspable_columns, 361U);
  EXPECT_NEAR(result.plan_area_m2, 0.19, 1e-7);
  EXPECT_EQ(result.column_coverage, 1.0);
  ASSERT_EQ(result.score_classes.size(), libmap::score_classes.size());
  EXPECT_EQ(result.score_classes[0].all, 200U);
  EXPECT_EQ(result.score_classes[0].evaluated, 190U);
  EXPECT_EQ(result.score_classes[0].graspable, 171U);
  EXPECT_EQ(result.score_classes[6].all, 800U);
  ASSERT_EQ(result.score_bins.size(), 20U);
  for (const ScoreBin& bin : result.score_bins) EXPECT_EQ(bin.all, 100U);
  ASSERT_EQ(result.by_height.size(), 1U);
  ASSERT_EQ(result.by_slope.size(), 18U);
  EXPECT_EQ(result.by_slope[0].voxels, 1900U);
  const MapAnalysis with_edges = libgtd::analyze_map(map, level_surface(map), {.border = true});
  EXPECT_EQ(with_edges.ground.voxels, 2000U);
}

TEST(MapAnalysis, BoundsOfClassesAndScoresOutsideZeroToOne) {
  const std::vector<double> scores = {0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.0, 1.0, -0.26, 0.95};
  const PointCloud cloud = map_cloud(floor_voxels(10, 1), [&](const Voxel& v) {
    return static_cast<double>(static_cast<float>(scores[static_cast<std::size_t>(v.i)]));
  });
  const VoxelMap map = libgtd::voxel_map_of(cloud);
  const MapAnalysis result = libgtd::analyze_map(map, level_surface(map), {.score_bin = 0.1});
  // Single precision stores 0.9, 0.8, 0.6 and 0.4 with rounding errors; the classes do not change.
  const std::vector<std::size_t> expected = {3, 1, 1, 1, 1, 1, 2};
  for (std::size_t n = 0; n < expected.size(); ++n)
    EXPECT_EQ(result.score_classes[n].all, expected[n]) << n;
  ASSERT_EQ(result.score_bins.size(), 13U);
  EXPECT_NEAR(result.score_bins.front().low, -0.3, 1e-12);
  EXPECT_EQ(result.score_bins.front().all, 1U);
  EXPECT_EQ(result.score_bins[12].all, 3U);
  EXPECT_EQ(result.score_bins[11].all, 1U);
  std::size_t sum = 0;
  for (const ScoreBin& bin : result.score_bins) sum += bin.all;
  EXPECT_EQ(sum, 10U);
}

TEST(MapAnalysis, ZeroPlaneHeightsAndGaps) {
  std::vector<Voxel> voxels;
  for (int i = 0; i < 10; ++i)
    for (int j = 0; j < 40; j += 2) voxels.push_back({i, j, i});
  const PointCloud cloud = map_cloud(voxels, [](const Voxel& v) { return v.i >= 8 ? 0.9 : 0.1; });
  const VoxelMap map = libgtd::voxel_map_of(cloud, {.lattice = lattice, .zero_plane_m = 0.035});
  const MapAnalysis result = libgtd::analyze_map(map, level_surface(map), {.height_bin_m = 0.03});
  EXPECT_EQ(result.below_zero_plane, 60U);
  EXPECT_EQ(result.ground.voxels, 140U);
  EXPECT_NEAR(result.column_coverage, 20.0 / 39.0, 1e-12);
  // 0.035 to 0.095 in bins from 0.03 on.
  ASSERT_EQ(result.by_height.size(), 3U);
  EXPECT_EQ(result.by_height[0].voxels, 60U);
  EXPECT_EQ(result.by_height[2].voxels, 20U);
  EXPECT_EQ(result.by_height[2].graspable_voxels, 20U);
  EXPECT_NEAR(*result.by_height[1].graspable_fraction(), 1.0 / 3.0, 1e-6);
}

TEST(MapAnalysis, BinsOutOfBounds) {
  const VoxelMap map = libgtd::voxel_map_of(graded_floor());
  const auto field_of = [&](const libgtd::MapAnalysisOptions& options) {
    return error_of([&] { libgtd::analyze_map(map, level_surface(map), options); }).context().field;
  };
  EXPECT_EQ(field_of({.score_bin = 0.0}), "score_bin");
  EXPECT_EQ(field_of({.score_bin = 1e-7}), "score_bin");
  EXPECT_EQ(field_of({.height_bin_m = -1.0}), "height_bin_m");
  EXPECT_EQ(field_of({.slope_bin_deg = 1e-6}), "slope_bin_deg");
}

TEST(MapAnalysis, SurfaceOfAnotherMap) {
  const VoxelMap map = libgtd::voxel_map_of(graded_floor());
  for (const bool is_slope : {true, false}) {
    libgtd::MapSurface surface = level_surface(map);
    (is_slope ? surface.slope_deg : surface.area_m2).pop_back();
    EXPECT_TRUE(
        is_error(error_of([&] { libgtd::analyze_map(map, surface); }), {.field = "slope_deg"}));
  }
}

}  // namespace map_analysis_test
