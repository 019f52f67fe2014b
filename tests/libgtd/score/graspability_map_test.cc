#include "libgtd/score/graspability_map.h"

#include <gtest/gtest.h>

#include <cmath>

#include "libmap/core/score_color.h"
#include "tests/support/test_support.h"

namespace libgtd {
namespace graspability_map_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using libmap::PointCloud;

GraspabilityMap small_map() {
  GraspabilityMap map;
  map.terrain_from_input = libmap::make_pose_from_rpy({1, 2, 3}, {10, 20, 30});
  map.zero_plane_m = 0.0;
  map.voxels = {{{-3, 1, -2}, {200, 190}, 0.95, true, true, false},
                {{0, 0, 4}, {130, 60}, 0.4615, false, false, true},
                {{5, -1, 0}, {12, 0}, 0.0, false, false, false}};
  return map;
}

TEST(MapCloud, HoldsCentersFieldsAndColors) {
  const PointCloud cloud = to_cloud(small_map(), MapFrame::terrain);
  cloud.check();
  EXPECT_TRUE(cloud.positions[1].isApprox(Eigen::Vector3d(0.005, 0.005, 0.045)));
  EXPECT_EQ(cloud.find_field("ssv")->values, (std::vector<double>{200, 130, 12}));
  EXPECT_EQ(cloud.find_field("gsv")->values, (std::vector<double>{190, 60, 0}));
  EXPECT_EQ(cloud.find_field("score")->values, (std::vector<double>{0.95, 0.4615, 0.0}));
  EXPECT_EQ(cloud.find_field("convex")->values, (std::vector<double>{1, 0, 0}));
  EXPECT_EQ(cloud.find_field("graspable")->values, (std::vector<double>{1, 0, 0}));
  EXPECT_EQ(cloud.find_field("border")->values, (std::vector<double>{0, 1, 0}));
  EXPECT_EQ(cloud.find_field("i")->values, (std::vector<double>{-3, 0, 5}));
  EXPECT_EQ(cloud.colors[0], libmap::below_plane_color);
  EXPECT_EQ(cloud.colors[1], libmap::score_color(0.4615));
}

TEST(MapCloud, InTheInputFrameIsTheTerrainFrameTurnedBack) {
  const GraspabilityMap map = small_map();
  const PointCloud in_terrain = to_cloud(map, MapFrame::terrain);
  const PointCloud in_input = to_cloud(map, MapFrame::input);
  for (std::size_t n = 0; n < in_terrain.size(); ++n)
    EXPECT_TRUE((map.terrain_from_input * in_input.positions[n]).isApprox(in_terrain.positions[n]));
}

TEST(Merge, RefusesWhatIsNoMapAndVoxelsThatStandTwice) {
  const PointCloud cloud = to_cloud(small_map(), MapFrame::terrain);
  EXPECT_TRUE(is_error(error_of([&] {
                         merge_map_clouds({cloud, cloud});
                       }),
                       {.field = "i, j, k", .value = "-3, 1, -2"}));
  PointCloud bare;
  bare.positions = {{0, 0, 0}};
  EXPECT_TRUE(is_error(error_of([&] { merge_map_clouds({bare}); }), {.field = "i"}));
  PointCloud other = libmap::select_points(cloud, {});
  other.fields.pop_back();
  EXPECT_TRUE(is_error(error_of([&] { merge_map_clouds({cloud, other}); }), {.field = "score"}));
}

TEST(Merge, RefusesPartsOfWhichOnlySomeHaveColorsOrNormals) {
  const PointCloud cloud = to_cloud(small_map(), MapFrame::terrain);
  PointCloud other = libmap::select_points(cloud, {1, 2});
  other.colors.clear();
  EXPECT_TRUE(is_error(error_of([&] {
                         merge_map_clouds({libmap::select_points(cloud, {0}), other});
                       }),
                       {.field = "colors"}));
  other = libmap::select_points(cloud, {1, 2});
  other.normals.assign(2, Eigen::Vector3f::UnitZ());
  EXPECT_TRUE(is_error(error_of([&] {
                         merge_map_clouds({libmap::select_points(cloud, {0}), other});
                       }),
                       {.field = "normals"}));
}

// Values that have no order or do not fit an integer.
TEST(Merge, RefusesIndicesThatAreNone) {
  for (const double index : {std::nan(""), HUGE_VAL, 1e300, 0.5, 0x1p29 + 1}) {
    PointCloud cloud = to_cloud(small_map(), MapFrame::terrain);
    for (libmap::ScalarField& field : cloud.fields)
      if (field.name == "j") field.values[1] = index;
    EXPECT_EQ(error_of([&] { merge_map_clouds({cloud}); }).context().field, "j");
  }
}

TEST(Merge, OrdersByVoxelAndTakesEmptyParts) {
  const PointCloud cloud = to_cloud(small_map(), MapFrame::terrain);
  const PointCloud merged =
      merge_map_clouds({libmap::select_points(cloud, {}), libmap::select_points(cloud, {2}),
                        libmap::select_points(cloud, {0, 1})});
  EXPECT_EQ(merged.positions, cloud.positions);
  EXPECT_EQ(merged.colors, cloud.colors);
  EXPECT_EQ(merged.fields, cloud.fields);
}

}  // namespace graspability_map_test
}  // namespace libgtd
