// PCD files of other programs, and PCD files with wrong headers.
#include "libmap/io/cloud_io.h"

#include <gmock/gmock.h>

#include <sstream>
#include <string>

#include "libmap/io/pcd_codec.h"
#include "tests/libmap/io/cloud_samples.h"
#include "tests/libmap/io/given_bytes.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace pcd_codec_test {

namespace fs = std::filesystem;
using graspmap_test::error_as;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::raw;
using graspmap_test::read_as;
using graspmap_test::read_text;
using graspmap_test::sample_cloud;
using graspmap_test::scratch_folder;
using ::testing::Contains;
using ::testing::ElementsAre;

std::string pcd_header(const std::string& points, const std::string& data) {
  return "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH " +
         points + "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + points + "\nDATA " + data + "\n";
}

TEST(PcdFiles, AnyOrderTypesCountsAndPadding) {
  std::string bytes =
      "# .PCD v.7 - Point Cloud Data file format\nVERSION .7\n"
      "FIELDS intensity _ z rgb x y histogram _ id\nSIZE 2 1 8 4 8 8 4 4 8\n"
      "TYPE U U F F F F F F I\nCOUNT 1 3 1 1 1 1 2 1 1\nWIDTH 2\nHEIGHT 1\n"
      "VIEWPOINT 1 2 3 1 0 0 0\nPOINTS 2\nDATA binary\n";
  const std::uint32_t packed = 0xFF102030;  // as float32 it is not a number
  for (int i = 0; i < 2; ++i)
    bytes += raw<std::uint16_t>(static_cast<std::uint16_t>(65000 + i)) + "abc" + raw(3.5 + i) +
             raw(packed) + raw(1.25) + raw(2.25) + raw(0.5F) + raw(0.75F) + "pad!" +
             raw<std::int64_t>(-5000000000LL - i);
  const CloudReadResult read = read_as(".pcd", bytes);
  ASSERT_EQ(read.cloud.size(), 2U);
  EXPECT_EQ(read.cloud.positions[1], Eigen::Vector3d(1.25, 2.25, 4.5));
  EXPECT_EQ(read.cloud.colors[1], (Color{0x10, 0x20, 0x30}));
  ASSERT_EQ(read.cloud.fields.size(), 4U);
  EXPECT_EQ(read.cloud.find_field("intensity")->type, ScalarType::uint16);
  EXPECT_EQ(read.cloud.find_field("intensity")->values[1], 65001.0);
  EXPECT_EQ(read.cloud.find_field("histogram_0")->values[0], 0.5);
  EXPECT_EQ(read.cloud.find_field("histogram_1")->values[1], 0.75);
  EXPECT_EQ(read.cloud.find_field("id")->values[1], -5000000001.0);
  EXPECT_EQ(read.cloud.viewpoint.translation(), Eigen::Vector3d(1, 2, 3));
  EXPECT_THAT(read.info.skipped, ElementsAre("padding of 3 bytes", "padding of 4 bytes"));
  EXPECT_THAT(read.info.fields, Contains(FileField{"histogram", ScalarType::float32, 2}));
}

// A header of any length, so that the numbers behind it lie on no whole multiple of their size, and
// a file whose last byte is the last of a page of memory.
TEST(PcdFiles, NumbersMayLieAnywhere) {
  for (const std::size_t filling : {1u, 2u, 3u, 4u, 5u, 6u, 7u, 8u, 3900u}) {
    std::string head =
        "FIELDS tag x y z\nSIZE 1 8 8 4\nTYPE U F F F\nWIDTH 3\nHEIGHT 1\nDATA binary\n";
    std::string data;
    for (int n = 0; n < 3; ++n)
      data += raw(static_cast<std::uint8_t>(7 + n)) + raw(0.1 + n) + raw(-2.0 * n) + raw(0.5F);
    std::size_t comment = filling;
    if (filling == 3900u) comment = 4096 - head.size() - data.size() - 2;
    const std::string bytes = "#" + std::string(comment, '-') + "\n" + head + data;
    if (filling == 3900u) {
      ASSERT_EQ(bytes.size(), 4096u);
    }
    const PointCloud cloud = read_as(".pcd", bytes).cloud;
    ASSERT_EQ(cloud.size(), 3u);
    for (int n = 0; n < 3; ++n) {
      const auto at = static_cast<std::size_t>(n);
      EXPECT_EQ(cloud.positions[at], Eigen::Vector3d(0.1 + n, -2.0 * n, 0.5));
      EXPECT_EQ(cloud.find_field("tag")->values[at], 7 + n);
    }
    for (const std::size_t missing : {1u, 4u, 12u, 21u, 22u, 63u})
      EXPECT_TRUE(is_error(error_as(".pcd", bytes.substr(0, bytes.size() - missing)),
                           {.field = "number of points", .value = "3"}));
  }
}

TEST(PcdFiles, PackedColorsInText) {
  const std::string header =
      "FIELDS x y z rgba\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 1\nHEIGHT 1\nPOINTS 1\n"
      "DATA ascii\n";
  EXPECT_EQ(read_as(".pcd", header + "1 2 3 4278194208\n").cloud.colors[0], (Color{0, 16, 32}));
  std::string as_float = header;
  as_float.replace(as_float.find("F F F U"), 7, "F F F F");
  // The example of the documentation; its bits are 0x4A8080E0.
  EXPECT_EQ(read_as(".pcd", as_float + "0.93773 0.33763 0 4.2108e+06\n").cloud.colors[0],
            (Color{128, 128, 224}));
}

TEST(PcdFiles, CompressedPaddingMayBeLeftOut) {
  const fs::path path = scratch_folder() / "padded.pcd";
  PointCloud cloud = sample_cloud(50);
  cloud.fields.clear();
  write_cloud(path, cloud, {FileEncoding::binary_compressed, false});
  std::string bytes = read_text(path);
  for (const auto& [from, to] : {std::pair<std::string, std::string>{"FIELDS x", "FIELDS _ x"},
                                 {"SIZE 4", "SIZE 1 4"},
                                 {"TYPE F", "TYPE U F"},
                                 {"COUNT 1", "COUNT 4 1"}})
    bytes.replace(bytes.find(from), from.size(), to);
  EXPECT_EQ(read_as(".pcd", bytes).cloud.positions, cloud.positions);
}

TEST(PcdFiles, HeadersThatLie) {
  const std::string ten(10 * 12, '\1');
  EXPECT_TRUE(is_error(error_as(".pcd", pcd_header("11", "binary") + ten),
                       {.field = "number of points", .value = "11", .bound = "<= 10"}));
  EXPECT_TRUE(is_error(error_as(".pcd", pcd_header("3", "ascii") + "1 2 3\n4 5 6\n7777777 8\n"),
                       {.field = "numbers of line 14", .value = "2", .bound = "3"}));
  EXPECT_TRUE(
      is_error(error_as(".pcd", pcd_header("3", "ascii") + "1.25 2.25 3.25\n4.25 5.25 6.25\n"),
               {.field = "number of points", .value = "3", .bound = "<= 2"}));
  EXPECT_TRUE(is_error(error_as(".pcd", pcd_header("1", "ascii") + "1 2 three\n"),
                       {.field = "z", .value = "three"}));
  for (const char* const points : {"9223372036854775807", "4611686018427387904", "1000000000000"})
    for (const char* const data : {"binary", "ascii", "binary_compressed"})
      EXPECT_TRUE(is_error(error_as(".pcd", pcd_header(points, data) + std::string(100, '\0')),
                           {.file = "given.pcd"}))
          << points;
  for (const char* const points : {"-1", "1e3", "99999999999999999999", "x", ""})
    error_as(".pcd", pcd_header(points, "binary") + ten);
  error_as(".pcd", pcd_header("10", "zip") + ten);
  // The end of a header is searched in the first MiB only.
  const std::string whole = pcd_header("10", "binary") + ten;
  EXPECT_EQ(read_as(".pcd", "# " + std::string(1000, 'x') + "\n" + whole).cloud.size(), 10U);
  EXPECT_TRUE(
      is_error(error_as(".pcd", "# " + std::string(std::size_t{1} << 20U, 'x') + "\n" + whole),
               {.field = "DATA line of the PCD header"}));
}

TEST(PcdFiles, CompressedSizesThatLie) {
  const std::string header = pcd_header("10", "binary_compressed");
  const auto sizes = [](std::uint32_t compressed, std::uint32_t uncompressed) {
    return raw(compressed) + raw(uncompressed);
  };
  EXPECT_TRUE(
      is_error(error_as(".pcd", header + sizes(1000, 120) + "abc"),
               {.field = "bytes of the compressed data", .value = "1000", .bound = "<= 3"}));
  EXPECT_TRUE(
      is_error(error_as(".pcd", header + sizes(3, 119) + "abc"),
               {.field = "bytes of the uncompressed data", .value = "119", .bound = "10 * 12"}));
  EXPECT_TRUE(is_error(error_as(".pcd", header + sizes(0, 120)), {.field = "compressed data"}));
  EXPECT_TRUE(is_error(error_as(".pcd", header + sizes(3, 120) + "\xff\xff\xff"),
                       {.field = "compressed data"}));
  EXPECT_TRUE(is_error(error_as(".pcd", header + "abc"), {.field = "compressed size"}));
  EXPECT_TRUE(is_error(error_as(".pcd", pcd_header("300000000", "binary_compressed") +
                                            sizes(3, 3600000000U) + "abc"),
                       {.field = "compressed data"}));
}

TEST(PcdFiles, HeaderLinesThatDoNotFit) {
  const std::string good = pcd_header("1", "ascii") + "1 2 3\n";
  EXPECT_EQ(read_as(".pcd", good).cloud.size(), 1U);
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string bytes = good;
    bytes.replace(bytes.find(from), from.size(), to);
    return error_as(".pcd", bytes);
  };
  EXPECT_TRUE(is_error(changed("COUNT 1 1 1", "COUNT 1 1"),
                       {.field = "header line COUNT", .value = "2 words long"}));
  EXPECT_TRUE(is_error(changed("COUNT 1 1 1", "COUNT 1 1 0"),
                       {.field = "header line COUNT", .value = "0", .bound = ">= 1"}));
  EXPECT_TRUE(is_error(changed("COUNT 1 1 1", "COUNT 1 1 99999999999"),
                       {.field = "header line COUNT", .value = "99999999999"}));
  EXPECT_TRUE(is_error(changed("SIZE 4 4 4", "SIZE 4 4 3"),
                       {.field = "TYPE and SIZE of field 'z'", .value = "F 3"}));
  EXPECT_TRUE(is_error(changed("SIZE 4 4 4", "SIZE 4 4 4 4"),
                       {.field = "header line SIZE", .value = "4 words long"}));
  EXPECT_TRUE(is_error(changed("TYPE F F F", "TYPE F F Q"),
                       {.field = "TYPE and SIZE of field 'z'", .value = "Q 4"}));
  EXPECT_TRUE(is_error(changed("SIZE 4 4 4", "SIZE 4 4 2"),
                       {.field = "TYPE and SIZE of field 'z'", .value = "F 2"}));
  EXPECT_TRUE(is_error(changed("FIELDS x y z", "FIELDS x y w"), {.field = "fields x, y and z"}));
  EXPECT_TRUE(is_error(changed("FIELDS x y z", "FIELDS x y z z"),
                       {.field = "header line SIZE", .value = "3 words long"}));
  EXPECT_TRUE(is_error(changed("FIELDS x y z", "FIELDS"), {.field = "header line FIELDS"}));
  EXPECT_TRUE(
      is_error(changed("HEIGHT 1", "HEIGHT 2"), {.field = "header line POINTS", .value = "1"}));
  EXPECT_TRUE(is_error(changed("HEIGHT 1", "HEIGHT 1\nHEIGHT 1"), {.field = "header line HEIGHT"}));
  EXPECT_TRUE(is_error(changed("WIDTH 1\nHEIGHT 1", "WIDTH 4611686018427387904\nHEIGHT 2"),
                       {.field = "header line WIDTH", .value = "4611686018427387904"}));
  EXPECT_TRUE(is_error(changed("VIEWPOINT 0 0 0 1 0 0 0", "VIEWPOINT 0 0"),
                       {.field = "header line VIEWPOINT", .bound = "tx ty tz qw qx qy qz"}));
  EXPECT_TRUE(is_error(changed("VIEWPOINT 0 0 0 1 0 0 0", "VIEWPOINT 0 0 0 1 0 0 nan"),
                       {.field = "header line VIEWPOINT", .value = "nan"}));
  EXPECT_TRUE(is_error(changed("DATA ascii", "ascii"), {.field = "line 11"}));
}

// LZF counts bytes in 32 bits. All rows are one number in memory.
TEST(PcdFiles, TooLargeToBeCompressed) {
  const float number = 1.0F;
  ColumnSet set;
  set.rows = 800'000'000;
  set.columns.push_back({"x", ScalarType::float32, StoredType::float32,
                         reinterpret_cast<const std::byte*>(&number), 0, false});
  std::ostringstream out;
  const Error error =
      error_of([&] { encode_pcd(set, Pose::Identity(), FileEncoding::binary_compressed, out); });
  EXPECT_TRUE(is_error(error, {.field = "data", .value = "3200000000 bytes"}));
  EXPECT_EQ(error.context().value, "3200000000 bytes");
}

TEST(PcdFiles, FieldNameWithBlankIsRefused) {
  PointCloud cloud = sample_cloud(2);
  cloud.add_field("two words", ScalarType::float32);
  for (const char* const extension : {".pcd", ".ply"})
    EXPECT_TRUE(is_error(
        error_of([&] { write_cloud(scratch_folder() / (std::string("c") + extension), cloud); }),
        {.field = "field 'two words'"}));
  write_cloud(scratch_folder() / "c.csv", cloud);
  EXPECT_NE(read_cloud(scratch_folder() / "c.csv").cloud.find_field("two words"), nullptr);
}

TEST(PcdFiles, VeryManyColumns) {
  const std::string rest = "\nPOINTS 0\nDATA ascii\n";
  std::string names;
  for (int n = 0; n < 10'001; ++n) names += " f" + std::to_string(n);
  EXPECT_TRUE(is_error(error_as(".pcd", "FIELDS" + names + rest), {.field = "header line FIELDS"}));
  EXPECT_TRUE(is_error(error_as(".pcd", "FIELDS x y z a\nCOUNT 1 1 1 10000" + rest),
                       {.field = "header line FIELDS"}));
}

}  // namespace pcd_codec_test
}  // namespace libmap
