// A PCD written in parts is identical to the file of the whole cloud.

#include <gtest/gtest.h>

#include "libmap/io/cloud_io.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace pcd_parts_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::scratch_folder;
using graspmap_test::uniform;

PointCloud some_cloud(std::size_t count, double offset_m) {
  PointCloud cloud;
  cloud.viewpoint.translation() = Eigen::Vector3d(1, 2, 3);
  for (std::size_t n = 0; n < count; ++n) {
    cloud.positions.emplace_back(offset_m + uniform(0, 1), uniform(0, 1), uniform(0, 1));
    cloud.normals.emplace_back(0.0F, 0.0F, 1.0F);
    cloud.colors.push_back({1, 2, static_cast<std::uint8_t>(n)});
  }
  for (double& value : cloud.add_field("score", ScalarType::float32).values) value = uniform(0, 1);
  for (double& value : cloud.add_field("i", ScalarType::int32).values) value = -7;
  return cloud;
}

PointCloud part_of(const PointCloud& cloud, std::size_t begin, std::size_t end) {
  std::vector<std::size_t> indices;
  for (std::size_t n = begin; n < end; ++n) indices.push_back(n);
  return select_points(cloud, indices);
}

TEST(PcdParts, AreTheFileOfTheWhole) {
  for (const double offset_m : {0.0, 5000.0}) {
    const PointCloud whole = some_cloud(1000, offset_m);
    write_cloud(scratch_folder() / "whole.pcd", whole);
    PcdPartsWriter writer(scratch_folder() / "parts.pcd",
                          {.points = 1000, .float64_positions = offset_m > 0});
    for (const auto& [begin, end] : {std::pair(0, 1), {1, 700}, {700, 700}, {700, 1000}})
      writer.append(part_of(whole, static_cast<std::size_t>(begin), static_cast<std::size_t>(end)));
    writer.finish();
    EXPECT_EQ(graspmap_test::read_text(scratch_folder() / "parts.pcd"),
              graspmap_test::read_text(scratch_folder() / "whole.pcd"));
  }
}

TEST(PcdParts, KeepTheirPromise) {
  const PointCloud cloud = some_cloud(10, 0);
  const auto path = scratch_folder() / "parts.pcd";
  EXPECT_TRUE(is_error(error_of([&] {
                         PcdPartsWriter writer(path, {.points = 9});
                         writer.append(cloud);
                       }),
                       {.field = "number of points", .value = "10", .bound = "9"}));
  EXPECT_TRUE(is_error(error_of([&] {
                         PcdPartsWriter writer(path, {.points = 11});
                         writer.append(cloud);
                         writer.finish();
                       }),
                       {.field = "number of points", .value = "10", .bound = "11"}));
  EXPECT_TRUE(is_error(error_of([&] {
                         PcdPartsWriter writer(path, {.points = 20});
                         writer.append(cloud);
                         PointCloud other = cloud;
                         other.fields.pop_back();
                         writer.append(other);
                       }),
                       {.field = "fields or viewpoints"}));
  EXPECT_TRUE(is_error(error_of([] { PcdPartsWriter("/no/such/folder/a.pcd", {}); }),
                       {.file = "/no/such/folder/a.pcd", .kind = ErrorKind::failed}));
}

}  // namespace pcd_parts_test
}  // namespace libmap
