// PLY files of other programs, and PLY files with wrong headers.
#include "libmap/io/cloud_io.h"

#include <gmock/gmock.h>

#include <sstream>
#include <string>
#include <vector>

#include "libmap/io/ply_codec.h"
#include "tests/libmap/io/cloud_samples.h"
#include "tests/libmap/io/given_bytes.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace ply_codec_test {

using graspmap_test::error_as;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::raw;
using graspmap_test::read_as;
using ::testing::ElementsAre;

std::string ply_header(const std::string& encoding, const std::string& points) {
  return "ply\nformat " + encoding + " 1.0\nelement vertex " + points +
         "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
}

TEST(PlyFiles, ForeignElementsListsAndNames) {
  const std::string bytes =
      "ply\r\nformat ascii 1.0\r\ncomment made elsewhere\r\nobj_info 3\r\nelement camera 1\r\n"
      "property float view_px\r\nelement vertex 2\r\nproperty double Y\r\nproperty double X\r\n"
      "property list uchar int neighbors\r\nproperty float64 Z\r\nproperty float diffuse_red\r\n"
      "property float diffuse_green\r\nproperty float diffuse_blue\r\nproperty uint16 quality\r\n"
      "element face 1\r\nproperty list uchar int vertex_indices\r\nend_header\r\n"
      "7\r\n2 1 3 5 6 7 3 1 0.5 0 77\r\n\r\n5 4 0 6 0 0 1 78\r\n3 0 1 0\r\n";
  const CloudReadResult read = read_as(".ply", bytes);
  ASSERT_EQ(read.cloud.size(), 2U);
  EXPECT_EQ(read.cloud.positions[0], Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(read.cloud.positions[1], Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(read.cloud.colors[0], (Color{255, 128, 0}));
  ASSERT_EQ(read.cloud.fields.size(), 1U);
  EXPECT_EQ(read.cloud.fields[0].type, ScalarType::uint16);
  EXPECT_EQ(read.cloud.fields[0].values, (std::vector<double>{77, 78}));
  EXPECT_THAT(read.info.skipped, ElementsAre("element camera", "list neighbors", "1 faces"));
}

TEST(PlyFiles, ListsInBinary) {
  const std::string header =
      "ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty float x\n"
      "property list ushort double extra\nproperty float y\nproperty float z\nend_header\n";
  const std::string first =
      raw(1.0F) + raw<std::uint16_t>(2) + raw(9.0) + raw(8.0) + raw(2.0F) + raw(3.0F);
  const std::string second = raw(4.0F) + raw<std::uint16_t>(0) + raw(5.0F) + raw(6.0F);
  const CloudReadResult read = read_as(".ply", header + first + second);
  EXPECT_EQ(read.cloud.positions[0], Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(read.cloud.positions[1], Eigen::Vector3d(4, 5, 6));
  const std::string lying = raw(4.0F) + raw<std::uint16_t>(60000) + raw(5.0F) + raw(6.0F);
  EXPECT_TRUE(
      is_error(error_as(".ply", header + first + lying), {.field = "extra", .value = "60000"}));
}

TEST(PlyFiles, HeadersThatLie) {
  EXPECT_TRUE(
      is_error(error_as(".ply", ply_header("binary_little_endian", "11") + std::string(120, '\1')),
               {.field = "number of rows of 'vertex'", .value = "11", .bound = "<= 10"}));
  EXPECT_TRUE(is_error(error_as(".ply", ply_header("ascii", "3") + "1.5 2.5 3.5\n1.5 2.5 3.5\n"),
                       {.about = "row 2"}));
  EXPECT_TRUE(
      is_error(error_as(".ply", ply_header("ascii", "1") + "1 2 3 4\n"), {.field = "line 8"}));
  EXPECT_TRUE(is_error(error_as(".ply", ply_header("ascii", "1") + "1 22 \n"), {.field = "z"}));
  for (const char* const points : {"9223372036854775807", "1537228672809129302", "1000000000000"})
    for (const char* const encoding : {"ascii", "binary_little_endian", "binary_big_endian"})
      EXPECT_TRUE(is_error(error_as(".ply", ply_header(encoding, points) + std::string(100, '1')),
                           {.field = "number of rows of 'vertex'"}));
  for (const char* const points : {"-1", "1e3", "99999999999999999999", "x", ""})
    error_as(".ply", ply_header("ascii", points) + "1 2 3\n");
  error_as(".ply", ply_header("binary_middle_endian", "1") + "1 2 3\n");
  EXPECT_TRUE(is_error(error_as(".ply",
                                "ply\nformat ascii 1.0\nelement vertex 1\nproperty uchar x\n"
                                "property uchar y\nproperty uchar z\nend_header\n1 2 256\n"),
                       {.field = "z", .value = "256"}));
  EXPECT_TRUE(is_error(error_as(".ply",
                                "ply\nformat ascii 1.0\nelement point 1\nproperty float x\n"
                                "end_header\n1\n"),
                       {.field = "PLY header"}));
}

TEST(PlyFiles, HeaderLinesThatDoNotFit) {
  EXPECT_TRUE(is_error(error_as(".ply",
                                "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n"
                                "property list float int extra\nend_header\n1 1 1\n"),
                       {.field = "PLY header line 5", .value = "float"}));
  EXPECT_TRUE(is_error(error_as(".ply",
                                "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n"
                                "element vertex 1\nproperty float x\nend_header\n1\n1\n"),
                       {.field = "PLY header line 5", .value = "vertex"}));
}

// Each name is compared with all previous names.
TEST(PlyFiles, VeryManyElementsOrProperties) {
  std::string elements = "ply\nformat ascii 1.0\n";
  std::string properties = elements + "element vertex 1\n";
  for (int n = 0; n < 10'001; ++n) {
    elements += "element e" + std::to_string(n) + " 0\n";
    properties += "property float p" + std::to_string(n) + "\n";
  }
  EXPECT_TRUE(
      is_error(error_as(".ply", elements + "end_header\n"), {.field = "PLY header line 1003"}));
  EXPECT_TRUE(
      is_error(error_as(".ply", properties + "end_header\n"), {.field = "PLY header line 10004"}));
}

// All rows are one number in memory.
TEST(PlyFiles, MoreVerticesThanAMeshCanName) {
  const float number = 1.0F;
  ColumnSet set;
  set.rows = std::size_t{1} << 31U;
  set.columns.push_back({"x", ScalarType::float32, StoredType::float32,
                         reinterpret_cast<const std::byte*>(&number), 0, false});
  const std::vector<Triangle> triangles;
  std::ostringstream out;
  const Error error =
      error_of([&] { encode_ply({.vertices = &set, .triangles = &triangles}, {}, out); });
  EXPECT_TRUE(is_error(error, {.field = "vertices", .value = "2147483648"}));
  EXPECT_EQ(error.context().value, "2147483648");
}

}  // namespace ply_codec_test
}  // namespace libmap
