#include "libgtd/terrain/voxel_grid.h"

#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <map>
#include <set>

#include "tests/libgtd/score/score_test_support.h"

namespace voxel_grid_test {

using graspmap_test::uniform;
using libgtd::Voxel;
using libgtd::VoxelGrid;
using libgtd::VoxelLattice;

TEST(VoxelLattice, CentersComeBackToTheirVoxel) {
  for (int round = 0; round < 1000; ++round) {
    const VoxelLattice lattice{{uniform(-5, 5), uniform(-5, 5), uniform(-5, 5)},
                               uniform(0.0005, 0.3)};
    const Voxel voxel{static_cast<int>(uniform(-3000, 3000)),
                      static_cast<int>(uniform(-3000, 3000)),
                      static_cast<int>(uniform(-3000, 3000))};
    EXPECT_EQ(lattice.voxel_of(lattice.center_of(voxel)), voxel);
  }
}

TEST(VoxelLattice, PointsLieWithinHalfAVoxelOfTheirCenter) {
  for (int round = 0; round < 1000; ++round) {
    const VoxelLattice lattice{{0, 0, 0}, 0.01};
    const Eigen::Vector3d point(uniform(-9, 9), uniform(-9, 9), uniform(-9, 9));
    const Eigen::Vector3d off = point - lattice.center_of(lattice.voxel_of(point));
    EXPECT_LE(off.cwiseAbs().maxCoeff(), 0.005 + 1e-12);
  }
}

TEST(FloorDivide, RoundsDown) {
  for (int dividend = -20; dividend <= 20; ++dividend)
    for (const int divisor : {1, 3, 7})
      EXPECT_EQ(libgtd::floor_divide(dividend, divisor),
                static_cast<int>(std::floor(static_cast<double>(dividend) / divisor)));
}

// Fault 5 of the author's program: two lattices that are not aligned lose voxels.
TEST(Voxelize, KeepsEveryPointsVoxelWhateverElseIsThere) {
  std::vector<Eigen::Vector3d> points;
  for (int n = 0; n < 3000; ++n)
    points.emplace_back(uniform(-1, 1), uniform(-1, 1), uniform(-0.2, 0.2));
  const VoxelGrid whole = libgtd::voxelize(points, 0.01);
  const VoxelGrid half = libgtd::voxelize({points.begin(), points.begin() + 1500}, 0.01);
  for (const Voxel& voxel : half.voxels)
    EXPECT_TRUE(std::binary_search(whole.voxels.begin(), whole.voxels.end(), voxel));
  for (const Eigen::Vector3d& point : points)
    EXPECT_TRUE(std::binary_search(whole.voxels.begin(), whole.voxels.end(),
                                   whole.lattice.voxel_of(point)));
}

TEST(Voxelize, DoesNotDependOnTheOrderOfPoints) {
  std::vector<Eigen::Vector3d> points;
  for (int n = 0; n < 2000; ++n)
    points.emplace_back(uniform(-0.3, 0.3), uniform(-0.3, 0.3), uniform(-0.1, 0.1));
  const auto voxels = libgtd::voxelize(points, 0.02).voxels;
  std::shuffle(points.begin(), points.end(), graspmap_test::random_engine());
  EXPECT_EQ(libgtd::voxelize(points, 0.02).voxels, voxels);
}

TEST(Voxelize, BadSizesAreErrorsThatSayHowMuchMemory) {
  const std::vector<Eigen::Vector3d> points = {{0, 0, 0}, {3, 3, 0.7}};
  for (const double size : {0.0, -0.01, std::numeric_limits<double>::quiet_NaN(),
                            std::numeric_limits<double>::infinity()}) {
    const libmap::Error error = graspmap_test::error_of([&] { libgtd::voxelize(points, size); });
    EXPECT_EQ(error.context().field, "voxel_size_m");
  }
  const libmap::Error error = graspmap_test::error_of([&] { libgtd::voxelize(points, 1e-9); });
  EXPECT_TRUE(graspmap_test::is_error(error, {.field = "voxel_size_m", .value = "1e-09"}))
      << error.what();
}

TEST(Downsampling, AveragesThePointsOfACell) {
  const std::vector<Eigen::Vector3f> points = {
      {0.001F, 0.001F, 0.001F}, {0.003F, 0.005F, 0.001F}, {0.015F, 0.001F, 0.001F}};
  const auto centroids = libgtd::voxel_centroids(points, 0.01);
  ASSERT_EQ(centroids.size(), 2U);
  EXPECT_FLOAT_EQ(centroids[0].x(), 0.002F);
  EXPECT_FLOAT_EQ(centroids[0].y(), 0.003F);
  EXPECT_EQ(centroids[1], points[2]);
}

// Boxes with few voxels and with too many for numbers of 64 bits.
TEST(CountLone, LooksAtAll26Neighbors) {
  using libgtd::count_isolated;
  EXPECT_EQ(count_isolated({}), 0U);
  EXPECT_EQ(count_isolated({{0, 0, 0}}), 1U);
  EXPECT_EQ(count_isolated({{0, 0, 0}, {1, 1, 1}}), 0U);
  EXPECT_EQ(count_isolated({{0, 0, 0}, {1, -1, 1}, {3, 0, 0}}), 1U);
  EXPECT_EQ(count_isolated({{0, 0, 0}, {0, 0, 2}, {0, 2, 0}, {2, 0, 0}}), 4U);
}

TEST(Voxelize, SortsVoxelsOfAnyBox) {
  for (const double extent_m : {0.05, 0.9, 2e6}) {
    std::vector<Eigen::Vector3d> points;
    std::set<Voxel> expected;
    for (int n = 0; n < 4000; ++n) {
      points.emplace_back(uniform(-extent_m, extent_m), uniform(-extent_m, extent_m),
                          uniform(-extent_m, extent_m));
      if (n % 3 == 0) points.push_back(points[points.size() / 2]);
    }
    for (const Eigen::Vector3d& point : points) expected.insert(VoxelLattice().voxel_of(point));
    const auto voxels = libgtd::voxelize(points, 0.01).voxels;
    EXPECT_TRUE(std::equal(voxels.begin(), voxels.end(), expected.begin(), expected.end()));
  }
}

TEST(VoxelMeans, DensityHasNoWeight) {
  libmap::PointCloud cloud;
  for (int n = 0; n < 100; ++n) cloud.positions.emplace_back(0.031, -0.001, 0.002);
  cloud.positions.emplace_back(0.039, -0.003, 0.006);
  cloud.positions.emplace_back(-0.005, 0.5, 0.005);
  cloud.normals.assign(cloud.size(), {0, 0, 1});
  cloud.normals.back() = {0, 1, 0};
  const libmap::PointCloud means = libgtd::voxel_means(cloud, 0.01);
  ASSERT_EQ(means.size(), 2U);
  EXPECT_EQ(means.positions[0], Eigen::Vector3d(-0.005, 0.5, 0.005));
  EXPECT_NEAR(means.positions[1].x(), 0.031 + 0.008 / 101, 1e-12);
  EXPECT_NEAR(means.positions[1].z(), 0.002 + 0.004 / 101, 1e-12);
  EXPECT_EQ(means.normals[0], Eigen::Vector3f(0, 1, 0));
  EXPECT_EQ(means.normals[1], Eigen::Vector3f(0, 0, 101));
  EXPECT_TRUE(libgtd::voxel_means({}, 0.01).empty());
  EXPECT_EQ(graspmap_test::error_of([&] { libgtd::voxel_means(cloud, 1e-11); }).context().field,
            "voxel_size_m");
}

// Compared with a slow implementation: the points of each voxel in a map.
TEST(VoxelMeans, AsAveragedByHand) {
  libmap::PointCloud cloud;
  std::map<Voxel, std::vector<Eigen::Vector3d>> voxels;
  for (int n = 0; n < 3000; ++n) {
    cloud.positions.emplace_back(uniform(-0.1, 0.1), uniform(-0.1, 0.1), uniform(-0.1, 0.1));
    voxels[VoxelLattice().voxel_of(cloud.positions.back())].push_back(cloud.positions.back());
  }
  const libmap::PointCloud means = libgtd::voxel_means(cloud, 0.01);
  ASSERT_EQ(means.size(), voxels.size());
  EXPECT_TRUE(means.normals.empty());
  auto mean = means.positions.begin();
  for (const auto& [voxel, members] : voxels) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& member : members) sum += member;
    EXPECT_EQ(*mean++, (sum / static_cast<double>(members.size())).eval());
  }
}

TEST(Downsampling, CellsOfAnyBoxInOrder) {
  for (const float extent_m : {0.2F, 4e6F}) {
    std::vector<Eigen::Vector3f> points;
    std::map<std::array<int, 3>, std::vector<Eigen::Vector3f>> cells;
    const auto coordinate = [&] { return static_cast<float>(uniform(-1, 1)) * extent_m; };
    for (int n = 0; n < 3000; ++n) {
      points.emplace_back(coordinate(), coordinate(), coordinate());
      if (n % 2 == 0) points.push_back(points[points.size() / 3]);
    }
    const float inverse = 1.0F / static_cast<float>(0.02);
    for (const Eigen::Vector3f& p : points)
      cells[{static_cast<int>(std::floor(p.z() * inverse)),
             static_cast<int>(std::floor(p.y() * inverse)),
             static_cast<int>(std::floor(p.x() * inverse))}]
          .push_back(p);
    const auto centroids = libgtd::voxel_centroids(points, 0.02);
    ASSERT_EQ(centroids.size(), cells.size());
    auto centroid = centroids.begin();
    for (const auto& [cell, members] : cells) {
      Eigen::Vector3f sum = Eigen::Vector3f::Zero();
      for (const Eigen::Vector3f& p : members) sum += p;
      EXPECT_EQ(*centroid++, (sum / static_cast<float>(members.size())).eval());
    }
  }
}

TEST(Voxelize, OfNothingIsNothing) {
  EXPECT_TRUE(libgtd::voxelize({}, 0.01).voxels.empty());
  EXPECT_TRUE(libgtd::voxelize_thesis({}, 0.01).voxels.empty());
}

}  // namespace voxel_grid_test
