#include "libmap/io/cloud_tiles.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "libmap/core/error.h"
#include "libmap/io/cloud_io.h"
#include "tests/support/test_support.h"

namespace cloud_tiles_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::scratch_folder;
using graspmap_test::uniform;
using libmap::PointCloud;
using libmap::PointStream;
using libmap::TileStream;

PointCloud random_cloud(std::size_t count, bool normals) {
  PointCloud cloud;
  for (std::size_t n = 0; n < count; ++n) {
    cloud.positions.emplace_back(static_cast<float>(uniform(-9, 9)),
                                 static_cast<float>(uniform(-9, 9)),
                                 static_cast<float>(uniform(0, 1)));
    if (normals) cloud.normals.emplace_back(0.0F, static_cast<float>(uniform(-1, 1)), 1.0F);
    cloud.colors.push_back({1, 2, 3});
  }
  cloud.add_field("score", libmap::ScalarType::float32);
  return cloud;
}

std::filesystem::path write(const std::string& name, const PointCloud& cloud,
                            const libmap::GeometryWriteOptions& options = {}) {
  libmap::write_cloud(scratch_folder() / name, cloud, options);
  return scratch_folder() / name;
}

TEST(CloudTiles, BlocksAreFullAndHoldAllPointsInOrder) {
  const std::size_t block = PointStream::block_points;
  PointCloud first = random_cloud(block + 5, true);
  const PointCloud second = random_cloud(block - 7, true);
  const PointCloud third = random_cloud(11, true);
  first.positions[3].x() = std::nan("");
  const TileStream stream({write("a.pcd", first), write("b.ply", second, {.big_endian = true}),
                           write("empty.pcd", PointCloud{}), write("c.csv", third)});
  std::vector<Eigen::Vector3d> expected = first.positions;
  expected.erase(expected.begin() + 3);
  expected.insert(expected.end(), second.positions.begin(), second.positions.end());
  expected.insert(expected.end(), third.positions.begin(), third.positions.end());
  for (const auto need : {PointStream::Need::positions, PointStream::Need::positions_and_normals}) {
    std::vector<std::size_t> sizes;
    std::vector<Eigen::Vector3d> positions;
    std::vector<Eigen::Vector3f> normals;
    stream.for_each_block(need, [&](const PointCloud& part) {
      sizes.push_back(part.size());
      positions.insert(positions.end(), part.positions.begin(), part.positions.end());
      normals.insert(normals.end(), part.normals.begin(), part.normals.end());
    });
    EXPECT_EQ(sizes, (std::vector<std::size_t>{block, block, 8}));
    ASSERT_EQ(positions.size(), expected.size());
    for (std::size_t n = 0; n < expected.size(); ++n)
      ASSERT_LT((positions[n] - expected[n]).norm(), 1e-6) << n;
    ASSERT_EQ(normals.size(), need == PointStream::Need::positions ? 0 : expected.size());
    if (!normals.empty()) {
      EXPECT_EQ(normals[block + 9], second.normals[5]);
    }
  }
}

TEST(CloudTiles, SameValuesAsReadWhole) {
  for (const char* name : {"a.pcd", "a.ply", "a.csv"}) {
    const auto path = write(name, random_cloud(70001, false));
    const PointCloud whole = libmap::read_cloud(path).cloud;
    const PointCloud pieces = libmap::read_tiles({path}).cloud;
    EXPECT_EQ(pieces.positions, whole.positions) << name;
  }
}

TEST(CloudTiles, SurveyCountsAndBounds) {
  PointCloud cloud = random_cloud(100000, true);
  cloud.positions[0] = {std::nan(""), 0, 0};
  cloud.positions[99999] = {50, -60, 7};
  cloud.positions[70000] = {-50, 60, -7};
  const libmap::TileInfo info = libmap::read_tile_info(write("a.pcd", cloud));
  EXPECT_EQ(info.points, 99999u);
  EXPECT_EQ(info.dropped_points, 1u);
  EXPECT_EQ(info.box.min, Eigen::Vector3d(-50, -60, -7));
  EXPECT_EQ(info.box.max, Eigen::Vector3d(50, 60, 7));
}

TEST(CloudTiles, ViewpointIsKnownIfAllAgree) {
  PointCloud cloud = random_cloud(10, false);
  cloud.viewpoint.translation() = Eigen::Vector3d(1, 2, 3);
  const auto a = write("a.pcd", cloud);
  const auto b = write("b.pcd", cloud);
  EXPECT_EQ(TileStream({a, b}).viewpoint().translation(), Eigen::Vector3d(1, 2, 3));
  cloud.viewpoint.translation().z() = 4;
  write("b.pcd", cloud);
  EXPECT_TRUE(TileStream({a, b}).viewpoint().matrix().isIdentity(0));
}

TEST(CloudTiles, BadFiles) {
  EXPECT_TRUE(
      is_error(error_of([] { libmap::cloud_tiles("/no/such.pcd"); }), {.file = "/no/such.pcd"}));
  const auto path = write("a.pcd", random_cloud(1000, false));
  std::filesystem::resize_file(path, std::filesystem::file_size(path) - 1);
  EXPECT_TRUE(
      is_error(error_of([&] { TileStream stream({path}); }),
               {.file = path, .field = "number of points", .value = "1000", .bound = "<= 999"}));
  graspmap_test::write_text(scratch_folder() / "b.pcd",
                            "VERSION 0.7\nFIELDS x y\nSIZE 4 4\nTYPE F F\nPOINTS 0\nDATA binary\n");
  EXPECT_TRUE(is_error(error_of([&] { TileStream stream({scratch_folder() / "b.pcd"}); }),
                       {.field = "fields x, y and z"}));
}

}  // namespace cloud_tiles_test
