#include "libgtd/score/map_downsampling.h"

#include <gtest/gtest.h>

#include <set>

#include "tests/support/test_support.h"

namespace map_downsampling_test {

using graspmap_test::uniform;
using libgtd::GraspabilityMap;
using libgtd::Voxel;
using libmap::PointCloud;

PointCloud map_of(const std::vector<Voxel>& voxels) {
  GraspabilityMap map;
  map.lattice.voxel_size_m = 0.1;
  for (const Voxel& voxel : voxels)
    map.voxels.push_back({.voxel = voxel, .counts = {200, 100}, .score = 0.5});
  return libgtd::to_cloud(map, libgtd::MapFrame::terrain);
}

std::vector<Voxel> voxels_in(const PointCloud& map) {
  std::vector<Voxel> voxels;
  for (std::size_t n = 0; n < map.size(); ++n)
    voxels.push_back({static_cast<int>(map.find_field("i")->values[n]),
                      static_cast<int>(map.find_field("j")->values[n]),
                      static_cast<int>(map.find_field("k")->values[n])});
  return voxels;
}

TEST(MapDownsampling, TheUppermostOfTheMiddleColumnStays) {
  const PointCloud map = map_of({{0, 0, 5},
                                 {1, 1, 2},
                                 {1, 1, 4},
                                 {1, 2, 9},  // square (0, 0)
                                 {-1, 0, 7},
                                 {-3, -1, 1}});  // (-1, 0), (-1, -1)
  EXPECT_EQ(voxels_in(libgtd::downsample_map(map, 3)),
            (std::vector<Voxel>{{-3, -1, 1}, {-1, 0, 7}, {1, 1, 4}}));
  EXPECT_EQ(libgtd::downsample_map(map, 1).size(), 5U) << "one a column";
}

// Squares so wide that squared distances from their middles exceed 32 bits; and an invalid index.
TEST(MapDownsampling, FarVoxelsAndNone) {
  PointCloud map = map_of({{-(1 << 29), 0, 0}, {-5, 0, 0}, {5, 7, 0}, {1 << 29, 0, 1 << 29}});
  EXPECT_EQ(voxels_in(libgtd::downsample_map(map, 1 << 29)),
            (std::vector<Voxel>{{-5, 0, 0}, {5, 7, 0}, {1 << 29, 0, 1 << 29}}));
  map.fields.back().values[1] = 1e10;
  EXPECT_EQ(graspmap_test::error_of([&] { libgtd::downsample_map(map, 3); }).context().field,
            map.fields.back().name);
}

TEST(MapDownsampling, PartsMakeTheWhole) {
  std::set<Voxel> some;
  while (some.size() < 600)
    some.insert({static_cast<int>(uniform(-20, 20)), static_cast<int>(uniform(-20, 20)),
                 static_cast<int>(uniform(-3, 3))});
  std::vector<Voxel> left;
  std::vector<Voxel> right;
  for (const Voxel& voxel : some) (voxel.i < 5 ? left : right).push_back(voxel);
  const PointCloud whole = libgtd::downsample_map(map_of({some.begin(), some.end()}), 4);
  const PointCloud joined =
      libgtd::downsample_map(libgtd::merge_map_clouds({libgtd::downsample_map(map_of(left), 4),
                                                       libgtd::downsample_map(map_of(right), 4)}),
                             4);
  EXPECT_EQ(voxels_in(joined), voxels_in(whole));
  EXPECT_EQ(whole.size(), 100U);
}

TEST(MapDownsampling, PointsComeToTheMiddleOfTheirSquares) {
  libgtd::TileStoreIndex index;
  index.lattice = {{1, 2, 3}, 0.1};
  PointCloud map = map_of({{-1, 5, 2}});
  libgtd::snap_to_square_centers(index, 4, map);
  EXPECT_TRUE(map.positions[0].isApprox(Eigen::Vector3d(0.8, 2.6, 3.25), 1e-12));
  index.frame = libgtd::MapFrame::input;
  const libmap::Pose terrain_from_input = libmap::make_pose_from_rpy({1, 0, 0}, {0, 0, 90});
  index.manifest.transforms.emplace_back("terrain_from_input", terrain_from_input);
  libgtd::snap_to_square_centers(index, 4, map);
  EXPECT_TRUE(
      (terrain_from_input * map.positions[0]).isApprox(Eigen::Vector3d(0.8, 2.6, 3.25), 1e-12));
}

TEST(MapDownsampling, InCubesSteepFacesStay) {
  // A wall: one column of nine voxels, and a voxel beside it.
  std::vector<Voxel> wall;
  for (int k = -3; k < 6; ++k) wall.push_back({1, 1, k});
  wall.push_back({2, 1, 4});
  const PointCloud map = map_of(wall);
  EXPECT_EQ(voxels_in(libgtd::voxel_downsample_map(map, 3)),
            (std::vector<Voxel>{{1, 1, -2}, {1, 1, 1}, {1, 1, 4}}));
  // The upper of two equally near points.
  EXPECT_EQ(voxels_in(libgtd::voxel_downsample_map(map_of({{1, 1, 0}, {1, 1, 2}}), 3)),
            (std::vector<Voxel>{{1, 1, 2}}));
  EXPECT_EQ(voxels_in(libgtd::voxel_downsample_map(map, 1)), voxels_in(map));
}

}  // namespace map_downsampling_test
