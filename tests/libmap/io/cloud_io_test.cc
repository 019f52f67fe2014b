// Round trips of all cloud formats; CSV; the clouds of the thesis.
#include "libmap/io/cloud_io.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <algorithm>
#include <clocale>
#include <cmath>
#include <fstream>
#include <limits>
#include <locale>

#include "libmap/core/parallel.h"
#include "tests/libmap/io/cloud_samples.h"
#include "tests/libmap/io/given_bytes.h"
#include "tests/support/lower_limit.h"
#include "tests/support/sanitizers.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace cloud_io_test {

namespace fs = std::filesystem;
using graspmap_test::error_as;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::read_as;
using graspmap_test::read_text;
using graspmap_test::sample_cloud;
using graspmap_test::scratch_folder;
using graspmap_test::write_text;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

struct Format {
  const char* extension;
  FileEncoding encoding;
  bool big_endian;
  const char* name;
};

std::ostream& operator<<(std::ostream& out, const Format& format) { return out << format.name; }

const Format formats[] = {{".pcd", FileEncoding::ascii, false, "pcd_ascii"},
                          {".pcd", FileEncoding::binary, false, "pcd_binary"},
                          {".pcd", FileEncoding::binary_compressed, false, "pcd_compressed"},
                          {".ply", FileEncoding::ascii, false, "ply_ascii"},
                          {".ply", FileEncoding::binary, false, "ply_little_endian"},
                          {".ply", FileEncoding::binary, true, "ply_big_endian"},
                          {".csv", FileEncoding::ascii, false, "csv"}};

fs::path write_sample(const Format& format, const PointCloud& cloud) {
  const fs::path path = scratch_folder() / (std::string("cloud") + format.extension);
  write_cloud(path, cloud, {format.encoding, format.big_endian});
  return path;
}

// CSV has the decimals of the floats, which parse to different doubles.
void expect_positions(const PointCloud& read, const PointCloud& written, bool as_floats) {
  ASSERT_EQ(read.size(), written.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    if (as_floats)
      ASSERT_EQ(read.positions[i].cast<float>(), written.positions[i].cast<float>()) << i;
    else
      ASSERT_EQ(read.positions[i], written.positions[i]) << i;
  }
}

class CloudFormat : public ::testing::TestWithParam<Format> {
 protected:
  bool is_csv() const { return std::string(GetParam().extension) == ".csv"; }
};

INSTANTIATE_TEST_SUITE_P(All, CloudFormat, ::testing::ValuesIn(formats),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_P(CloudFormat, KeepsEveryFieldBothWays) {
  const PointCloud cloud = sample_cloud(257);
  const CloudReadResult read = read_cloud(write_sample(GetParam(), cloud));
  EXPECT_EQ(read.dropped_points, 0U);
  EXPECT_EQ(read.info.points, 257U);
  expect_positions(read.cloud, cloud, is_csv());
  EXPECT_EQ(read.cloud.normals, cloud.normals);
  EXPECT_EQ(read.cloud.colors, cloud.colors);
  ASSERT_EQ(read.cloud.fields.size(), cloud.fields.size());
  for (std::size_t i = 0; i < cloud.fields.size(); ++i) {
    EXPECT_EQ(read.cloud.fields[i].name, cloud.fields[i].name);
    if (is_csv() && cloud.fields[i].type == ScalarType::float32) {
      // The shortest decimal number of a float parses to a different double.
      for (std::size_t k = 0; k < cloud.size(); ++k)
        EXPECT_EQ(static_cast<float>(read.cloud.fields[i].values[k]),
                  static_cast<float>(cloud.fields[i].values[k]));
      continue;
    }
    EXPECT_EQ(read.cloud.fields[i].values, cloud.fields[i].values) << cloud.fields[i].name;
    if (!is_csv()) {
      EXPECT_EQ(read.cloud.fields[i].type, cloud.fields[i].type) << cloud.fields[i].name;
    }
  }
  if (!is_csv()) {
    EXPECT_TRUE(read.cloud.viewpoint.isApprox(cloud.viewpoint, 1e-15));
  }
}

TEST_P(CloudFormat, InfoSaysWhatTheReaderFinds) {
  const fs::path path = write_sample(GetParam(), sample_cloud(40));
  const GeometryFileInfo info = read_cloud_info(path);
  const GeometryFileInfo read = read_cloud(path).info;
  EXPECT_EQ(info.format, std::string(GetParam().extension).substr(1));
  EXPECT_EQ(info.encoding, GetParam().encoding);
  EXPECT_EQ(info.big_endian, GetParam().big_endian);
  EXPECT_EQ(info.points, 40U);
  EXPECT_EQ(info.faces, 0U);
  EXPECT_EQ(info.bytes, fs::file_size(path));
  EXPECT_EQ(info.fields, read.fields);
  EXPECT_EQ(info.points, read.points);
  EXPECT_THAT(info.skipped, IsEmpty());
  EXPECT_THAT(info.fields, Contains(::testing::Field(&FileField::name, "field3")));
}

TEST_P(CloudFormat, WritesTheSameBytesTwice) {
  PointCloud cloud = sample_cloud(100);
  cloud.viewpoint = Pose::Identity();  // a rotation is preserved to the last digit but one
  const std::string first = read_text(write_sample(GetParam(), cloud));
  EXPECT_EQ(read_text(write_sample(GetParam(), cloud)), first);
  // Equal after a round trip, too.
  PointCloud again = read_cloud(write_sample(GetParam(), cloud)).cloud;
  if (is_csv()) return;
  EXPECT_EQ(read_text(write_sample(GetParam(), again)), first);
}

TEST_P(CloudFormat, FieldsAreRoundedToTheirTypesAndKeptWithinThem) {
  PointCloud cloud;
  cloud.positions.assign(4, Eigen::Vector3d(1, 2, 3));
  cloud.add_field("byte", ScalarType::uint8).values = {1.6, 300, -2, 7};
  cloud.add_field("whole", ScalarType::int32).values = {-1.6, 1e12, 2.4, -7};
  const PointCloud read = read_cloud(write_sample(GetParam(), cloud)).cloud;
  EXPECT_THAT(read.find_field("byte")->values, ElementsAre(2, 255, 0, 7));
  EXPECT_THAT(read.find_field("whole")->values, ElementsAre(-2, 2147483647, 2, -7));
}

// More rows than one parallel chunk.
TEST_P(CloudFormat, ThreadsDoNotMatter) {
  if (GetParam().encoding == FileEncoding::ascii) return;
  const PointCloud cloud = sample_cloud(40000);
  const std::string bytes = read_text(write_sample(GetParam(), cloud));
  const PointCloud read = read_as(GetParam().extension, bytes).cloud;
  const ThreadLimit one(1);
  EXPECT_EQ(read_text(write_sample(GetParam(), cloud)), bytes);
  const PointCloud again = read_as(GetParam().extension, bytes).cloud;
  for (const PointCloud* const one_read : {&read, &again}) {
    EXPECT_EQ(one_read->positions, cloud.positions);
    EXPECT_EQ(one_read->normals, cloud.normals);
    EXPECT_EQ(one_read->colors, cloud.colors);
    ASSERT_EQ(one_read->fields.size(), cloud.fields.size());
    for (const ScalarField& field : cloud.fields)
      EXPECT_EQ(one_read->find_field(field.name)->values, field.values) << field.name;
  }
}

TEST_P(CloudFormat, HoldsEmptyAndSinglePoint) {
  for (const std::size_t size : {0u, 1u}) {
    const CloudReadResult read = read_cloud(write_sample(GetParam(), sample_cloud(size)));
    EXPECT_EQ(read.cloud.size(), size);
    EXPECT_EQ(read.cloud.fields.size(), 8U);
    EXPECT_NO_THROW(read.cloud.check());
  }
}

TEST_P(CloudFormat, FarCoordinatesAreKeptAsDoubles) {
  PointCloud cloud;
  cloud.positions = {{500000.123456789, 4100000.987654321, -12.3}, {0.1, 0.2, 0.3}};
  EXPECT_EQ(read_cloud(write_sample(GetParam(), cloud)).cloud.positions, cloud.positions);
}

TEST_P(CloudFormat, NearCoordinatesAreFloats) {
  PointCloud cloud;
  cloud.positions = {{0.1, 100.7, -12.3}};
  const CloudReadResult read = read_cloud(write_sample(GetParam(), cloud));
  EXPECT_LE((read.cloud.positions[0] - cloud.positions[0]).cwiseAbs().maxCoeff(), 1e-5);
  if (!is_csv()) {
    EXPECT_EQ(read.info.fields[0].type, ScalarType::float32);
  }
}

TEST_P(CloudFormat, DropsAndCountsPointsThatAreNotFinite) {
  PointCloud cloud = sample_cloud(10);
  cloud.positions[3].y() = nan;
  cloud.positions[7].z() = -std::numeric_limits<double>::infinity();
  const CloudReadResult read = read_cloud(write_sample(GetParam(), cloud));
  EXPECT_EQ(read.dropped_points, 2U);
  EXPECT_EQ(read.info.points, 10U);
  ASSERT_EQ(read.cloud.size(), 8U);
  EXPECT_NO_THROW(read.cloud.check());
  EXPECT_EQ(read.cloud.positions[3].cast<float>(), cloud.positions[4].cast<float>());
  EXPECT_EQ(read.cloud.colors[7], cloud.colors[9]);
  EXPECT_EQ(read.cloud.find_field("field7")->values[3], cloud.fields[7].values[4]);
}

TEST_P(CloudFormat, KeepsNotANumberInFields) {
  PointCloud cloud;
  cloud.positions = {{1, 2, 3}, {4, 5, 6}};
  cloud.add_field("score", ScalarType::float32).values = {nan, 0.25};
  const PointCloud read = read_cloud(write_sample(GetParam(), cloud)).cloud;
  EXPECT_TRUE(std::isnan(read.find_field("score")->values[0]));
  EXPECT_EQ(read.find_field("score")->values[1], 0.25);
}

TEST_P(CloudFormat, DamageIsAnErrorAndNeverACrash) {
  const std::string bytes = read_text(write_sample(GetParam(), sample_cloud(12)));
  graspmap_test::expect_no_crash(
      bytes, [&](const std::string& damaged) { read_as(GetParam().extension, damaged); }, 400);
  graspmap_test::expect_no_crash(
      bytes,
      [&](const std::string& damaged) {
        const fs::path path = scratch_folder() / (std::string("info") + GetParam().extension);
        write_text(path, damaged);
        read_cloud_info(path);
      },
      100);
}

TEST_P(CloudFormat, TruncationIsAnError) {
  const std::string bytes = read_text(write_sample(GetParam(), sample_cloud(30)));
  if (is_csv()) return;  // a table cut between lines is a shorter table
  for (const double part : {0.02, 0.3, 0.6, 0.9, 0.98})
    error_as(GetParam().extension,
             bytes.substr(0, static_cast<std::size_t>(part * static_cast<double>(bytes.size()))));
}

TEST_P(CloudFormat, FilesThatAreNone) {
  const std::string extension = GetParam().extension;
  EXPECT_TRUE(is_error(error_as(extension, ""), {.file = "given" + extension}));
  error_as(extension, std::string(1, '\0'));
  error_as(extension, std::string(1000, '\0'));
  error_as(extension, "\xff\xfe\x80 not a cloud \xc3\x28\n\xf0\x28\x8c\xbc\n");
  const fs::path folder = scratch_folder() / ("folder" + extension);
  fs::create_directories(folder);
  for (const fs::path& path : {folder, scratch_folder() / ("missing" + extension)}) {
    EXPECT_EQ(error_of([&] { read_cloud(path); }).context().file, path.string());
    EXPECT_EQ(error_of([&] { read_cloud_info(path); }).context().file, path.string());
  }
  const fs::path nowhere = scratch_folder() / "no_such_folder" / ("cloud" + extension);
  for (const fs::path& path : {nowhere, folder})
    EXPECT_TRUE(is_error(error_of([&] { write_cloud(path, sample_cloud(2)); }),
                         {.file = path, .kind = ErrorKind::failed}));
}

TEST_P(CloudFormat, FieldNamesThatWouldBeReadAsSomethingElseAreRefused) {
  PointCloud cloud = sample_cloud(3);
  cloud.add_field("x", ScalarType::float32);
  EXPECT_TRUE(is_error(error_of([&] { write_sample(GetParam(), cloud); }), {.field = "field 'x'"}));
  cloud = sample_cloud(3);
  cloud.fields.clear();
  for (const char* const name : {"r", "g", "b"}) cloud.add_field(name, ScalarType::uint8);
  EXPECT_TRUE(is_error(error_of([&] { write_sample(GetParam(), cloud); }), {.field = "r g b"}));
}

// A locale with a decimal comma that needs no installation.
class CommaPoint : public std::numpunct<char> {
  char do_decimal_point() const override { return ','; }
  char do_thousands_sep() const override { return '.'; }
  std::string do_grouping() const override { return "\3"; }
};

TEST_P(CloudFormat, DoesNotFollowTheLocale) {
  const PointCloud cloud = sample_cloud(2000);
  const std::string usual = read_text(write_sample(GetParam(), cloud));
  const std::locale before = std::locale::global(std::locale(std::locale(), new CommaPoint));
  std::setlocale(LC_ALL, "de_DE.UTF-8");
  const fs::path path = write_sample(GetParam(), cloud);
  const PointCloud read = read_cloud(path).cloud;
  std::setlocale(LC_ALL, "C");
  std::locale::global(before);
  EXPECT_EQ(read_text(path), usual);
  expect_positions(read, cloud, is_csv());
}

TEST(CloudIo, UnknownExtensionNamesTheKnownOnes) {
  for (const char* const name : {"cloud.xyz", "cloud", "cloud.plyy", ".ply"}) {
    const fs::path path = scratch_folder() / name;
    write_text(path, "x");
    const Error error = error_of([&] { read_cloud(path); });
    EXPECT_TRUE(is_error(error, {.field = "extension", .bound = ".pcd, .ply, .csv or .tif"}));
    EXPECT_EQ(error.context().file, path.string());
    EXPECT_TRUE(
        is_error(error_of([&] { write_cloud(path, sample_cloud(1)); }),
                 {.file = path, .field = "extension", .bound = ".pcd, .ply, .csv or .vtp"}));
    EXPECT_TRUE(
        is_error(error_of([&] { read_cloud_info(path); }),
                 {.file = path, .field = "extension", .bound = ".pcd, .ply, .csv or .tif"}));
  }
  EXPECT_TRUE(is_error(error_of([] { read_cloud("site.laz"); }), {.file = "site.laz"}));
  EXPECT_EQ(format_of("A.B.PcD"), ".pcd");
}

TEST(CsvFiles, NamesTypesAndTextColumns) {
  const CloudReadResult read =
      read_as(".csv",
              "# comment\r\nlabel,Z,X,Y,r,g,b,normal_x,normal_y,normal_z,count,score,none\r\n"
              "rock,3,1,2,10,20,30,0,0,1,7,0.5,\r\n\"a, b\",6,4,5.5,255,0,1,0,1,0,-8,,\r\n");
  ASSERT_EQ(read.cloud.size(), 2U);
  EXPECT_EQ(read.cloud.positions[1], Eigen::Vector3d(4, 5.5, 6));
  EXPECT_EQ(read.cloud.colors[0], (Color{10, 20, 30}));
  EXPECT_EQ(read.cloud.normals[1], Eigen::Vector3f(0, 1, 0));
  ASSERT_EQ(read.cloud.fields.size(), 2U);
  EXPECT_EQ(read.cloud.fields[0], (ScalarField{"count", ScalarType::int32, {7, -8}}));
  EXPECT_EQ(read.cloud.fields[1].type, ScalarType::float64);
  EXPECT_TRUE(std::isnan(read.cloud.fields[1].values[1]));
  EXPECT_THAT(read.info.skipped, ElementsAre("column label", "column none"));
}

TEST(CsvFiles, BadCells) {
  EXPECT_TRUE(is_error(error_as(".csv", "x,y,z\n1,2,3\n1,2,\n"),
                       {.field = "row 2, column 'z'", .value = "''"}));
  EXPECT_TRUE(is_error(error_as(".csv", "x,y,z,score\n1,2,3,1\n1,2,3,high\n"),
                       {.field = "row 2, column 'score'", .value = "'high'"}));
  EXPECT_TRUE(is_error(error_as(".csv", "x,y\n1,2\n"), {.field = "fields x, y and z"}));
  EXPECT_TRUE(is_error(error_as(".csv", "x,y,z,x\n1,2,3,4\n"), {.field = "field 'x'"}));
}

TEST(RealClouds, HoldThePublishedNumbersOfPoints) {
  GRASPMAP_REQUIRE_DATA();
  const std::pair<const char*, std::size_t> clouds[] = {
      {"artificial_rocks.pcd", 72930},         {"scanned_cloud_primitive.pcd", 193904},
      {"simulated_cloud_pre-scan.pcd", 70322}, {"scanned_cloud_realtime.pcd", 659898},
      {"leaning_bouldering_holds.pcd", 18401}, {"realsense_octree.pcd", 131366}};
  for (const auto& [name, points] : clouds) {
    const fs::path path = graspmap_test::data_folder() / "clouds" / name;
    const CloudReadResult read = read_cloud(path);
    EXPECT_EQ(read.info.points, points) << name;
    EXPECT_EQ(read.cloud.size() + read.dropped_points, points) << name;
    EXPECT_EQ(read_cloud_info(path).points, points) << name;
    EXPECT_TRUE(read.cloud.has_colors()) << name;
  }
}

// A sparse file, larger than the remaining address space.
TEST(CloudFiles, PcdThatCannotBeMapped) {
  if (!graspmap_test::memory_can_be_limited) return;
  constexpr std::uint64_t gibibyte = std::uint64_t{1} << 30U;
  const fs::path path = scratch_folder() / "large.pcd";
  write_text(path, "VERSION 0.7\n");
  fs::resize_file(path, 4 * gibibyte);
  std::uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  const graspmap_test::LowerLimit limit(
      RLIMIT_AS, pages * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE)) + gibibyte);
  const Error error = error_of([&] { read_cloud(path); });
  EXPECT_TRUE(is_error(error, {.file = "large.pcd"}));
  EXPECT_EQ(error.context().file, path.string());
}

TEST(RealClouds, TheTestSiteIsAsDescribed) {
  GRASPMAP_REQUIRE_DATA();
  const PointCloud cloud =
      read_cloud(graspmap_test::data_folder() / "clouds" / "artificial_rocks.pcd").cloud;
  const Bounds3d bounds = bounds_of(cloud.positions);
  EXPECT_NEAR(bounds.min.x(), -1.5, 0.06);
  EXPECT_NEAR(bounds.max.y(), 1.5, 0.06);
  EXPECT_NEAR(bounds.max.z(), 0.70, 0.02);
  ASSERT_TRUE(cloud.has_normals());
  for (const Color& color : cloud.colors) ASSERT_EQ(color, cloud.colors.front());
  float shortest = 1e9F, longest = 0.0F;
  for (const Eigen::Vector3f& normal : cloud.normals) {
    shortest = std::min(shortest, normal.norm());
    longest = std::max(longest, normal.norm());
  }
  EXPECT_NEAR(shortest, 0.38F, 0.01F);
  EXPECT_NEAR(longest, 1.0F, 0.01F);
}

}  // namespace cloud_io_test
}  // namespace libmap
