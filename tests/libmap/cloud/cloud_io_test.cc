#include "libmap/cloud/cloud_io.h"

#include <gmock/gmock.h>

#include <clocale>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <locale>

#include "libmap/core/parallel.h"
#include "tests/libmap/cloud/cloud_samples.h"
#include "tests/support/test_support.h"

// Third-party readers that give up on a broken file leave some of their own memory behind.
extern "C" const char* __lsan_default_suppressions() { return "leak:libvtk"; }

namespace libmap {
namespace {

namespace fs = std::filesystem;
using graspmap_test::error_of;
using graspmap_test::read_text;
using graspmap_test::sample_cloud;
using graspmap_test::scratch_folder;
using graspmap_test::write_text;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
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
                          {".vtp", FileEncoding::ascii, false, "vtp_ascii"},
                          {".vtp", FileEncoding::binary, false, "vtp_binary"},
                          {".vtp", FileEncoding::binary_compressed, false, "vtp_compressed"},
                          {".csv", FileEncoding::ascii, false, "csv"}};

fs::path write_sample(const Format& format, const PointCloud& cloud) {
  const fs::path path = scratch_folder() / (std::string("cloud") + format.extension);
  write_cloud(path, cloud, {format.encoding, format.big_endian});
  return path;
}

CloudReadResult read_as(const std::string& extension, const std::string& bytes) {
  const fs::path path = scratch_folder() / ("given" + extension);
  write_text(path, bytes);
  return read_cloud(path);
}

std::string error_as(const std::string& extension, const std::string& bytes) {
  const Error error = error_of([&] { read_as(extension, bytes); });
  EXPECT_EQ(error.kind(), ErrorKind::bad_input);
  EXPECT_THAT(error.context().file, HasSubstr("given" + extension));
  return error.what();
}

// The bytes of a number, little-endian as the machine's.
template <typename T>
std::string raw(T value) {
  std::string bytes(sizeof(T), '\0');
  std::memcpy(bytes.data(), &value, sizeof(T));
  return bytes;
}

std::string pcd_header(const std::string& points, const std::string& data) {
  return "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH " +
         points + "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + points + "\nDATA " + data + "\n";
}

std::string ply_header(const std::string& encoding, const std::string& points) {
  return "ply\nformat " + encoding + " 1.0\nelement vertex " + points +
         "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
}

// CSV's decimals are those of the floats, and read as other doubles.
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
      // The shortest decimal number of a float is another double than the float's.
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
  const CloudFileInfo info = read_cloud_info(path);
  const CloudFileInfo read = read_cloud(path).info;
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
  cloud.viewpoint = Pose::Identity();  // a rotation comes back to the last digit but one
  const std::string first = read_text(write_sample(GetParam(), cloud));
  EXPECT_EQ(read_text(write_sample(GetParam(), cloud)), first);
  // And after a round trip.
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

// More rows than one thread takes at once.
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
  for (const std::size_t size : {0, 1}) {
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
    EXPECT_THAT(
        error_as(
            GetParam().extension,
            bytes.substr(0, static_cast<std::size_t>(part * static_cast<double>(bytes.size())))),
        HasSubstr(GetParam().extension));
}

TEST_P(CloudFormat, FilesThatAreNone) {
  const std::string extension = GetParam().extension;
  EXPECT_THAT(error_as(extension, ""), HasSubstr("empty"));
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
  EXPECT_EQ(error_of([&] { write_cloud(nowhere, sample_cloud(2)); }).kind(), ErrorKind::failed);
  EXPECT_EQ(error_of([&] { write_cloud(folder, sample_cloud(2)); }).kind(), ErrorKind::failed);
}

TEST_P(CloudFormat, FieldNamesThatWouldBeReadAsSomethingElseAreRefused) {
  PointCloud cloud = sample_cloud(3);
  cloud.add_field("x", ScalarType::float32);
  EXPECT_THAT(error_of([&] { write_sample(GetParam(), cloud); }).what(), HasSubstr("'x'"));
  cloud = sample_cloud(3);
  cloud.fields.clear();
  for (const char* const name : {"r", "g", "b"}) cloud.add_field(name, ScalarType::uint8);
  EXPECT_THAT(error_of([&] { write_sample(GetParam(), cloud); }).what(), HasSubstr("r g b"));
}

// A locale with a decimal comma, whatever the machine has installed.
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
    EXPECT_THAT(error.what(), HasSubstr(".pcd, .ply, .vtp or .csv"));
    EXPECT_EQ(error.context().file, path.string());
    EXPECT_THROW(write_cloud(path, sample_cloud(1)), Error);
    EXPECT_THROW(read_cloud_info(path), Error);
  }
  EXPECT_THAT(error_of([] { read_cloud("site.laz"); }).what(), HasSubstr("Debian"));
  EXPECT_EQ(format_of("A.B.PcD"), ".pcd");
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
      EXPECT_THAT(error_as(".pcd", bytes.substr(0, bytes.size() - missing)),
                  HasSubstr("promises 3 points of 21 bytes, but only " +
                            std::to_string(data.size() - missing) + " bytes of data follow"));
  }
}

TEST(PcdFiles, PackedColoursInText) {
  const std::string header =
      "FIELDS x y z rgba\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 1\nHEIGHT 1\nPOINTS 1\n"
      "DATA ascii\n";
  EXPECT_EQ(read_as(".pcd", header + "1 2 3 4278194208\n").cloud.colors[0], (Color{0, 16, 32}));
  std::string as_float = header;
  as_float.replace(as_float.find("F F F U"), 7, "F F F F");
  // The documentation's own example; its bits are 0x4A8080E0.
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
  EXPECT_THAT(error_as(".pcd", pcd_header("11", "binary") + ten),
              HasSubstr("promises 11 points of 12 bytes, but only 120 bytes of data follow (10"));
  EXPECT_THAT(error_as(".pcd", pcd_header("3", "ascii") + "1 2 3\n4 5 6\n7777777 8\n"),
              HasSubstr("line 14 holds 2 of 3 numbers"));
  EXPECT_THAT(error_as(".pcd", pcd_header("3", "ascii") + "1.25 2.25 3.25\n4.25 5.25 6.25\n"),
              HasSubstr("promises 3 points, but only 2 lines of data follow"));
  EXPECT_THAT(error_as(".pcd", pcd_header("1", "ascii") + "1 2 three\n"), HasSubstr("three"));
  for (const char* const points : {"9223372036854775807", "4611686018427387904", "1000000000000"})
    for (const char* const data : {"binary", "ascii", "binary_compressed"})
      EXPECT_THAT(error_as(".pcd", pcd_header(points, data) + std::string(100, '\0')),
                  HasSubstr("promises"))
          << points;
  for (const char* const points : {"-1", "1e3", "99999999999999999999", "x", ""})
    error_as(".pcd", pcd_header(points, "binary") + ten);
  error_as(".pcd", pcd_header("10", "zip") + ten);
}

TEST(PcdFiles, CompressedSizesThatLie) {
  const std::string header = pcd_header("10", "binary_compressed");
  const auto sizes = [](std::uint32_t compressed, std::uint32_t uncompressed) {
    return raw(compressed) + raw(uncompressed);
  };
  EXPECT_THAT(error_as(".pcd", header + sizes(1000, 120) + "abc"),
              HasSubstr("end after 3 of 1000 bytes"));
  EXPECT_THAT(error_as(".pcd", header + sizes(3, 119) + "abc"), HasSubstr("hold 119 bytes"));
  EXPECT_THAT(error_as(".pcd", header + sizes(0, 120)), HasSubstr("cannot hold"));
  EXPECT_THAT(error_as(".pcd", header + sizes(3, 120) + "\xff\xff\xff"), HasSubstr("broken"));
  EXPECT_THAT(error_as(".pcd", header + "abc"), HasSubstr("no size"));
  EXPECT_THAT(error_as(".pcd", pcd_header("300000000", "binary_compressed") +
                                   sizes(3, 3600000000U) + "abc"),
              HasSubstr("cannot hold"));
}

TEST(PcdFiles, HeaderLinesThatDoNotFit) {
  const std::string good = pcd_header("1", "ascii") + "1 2 3\n";
  EXPECT_EQ(read_as(".pcd", good).cloud.size(), 1U);
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string bytes = good;
    bytes.replace(bytes.find(from), from.size(), to);
    return error_as(".pcd", bytes);
  };
  EXPECT_THAT(changed("COUNT 1 1 1", "COUNT 1 1"), HasSubstr("COUNT"));
  EXPECT_THAT(changed("COUNT 1 1 1", "COUNT 1 1 0"), HasSubstr("COUNT"));
  EXPECT_THAT(changed("COUNT 1 1 1", "COUNT 1 1 99999999999"), HasSubstr("COUNT"));
  EXPECT_THAT(changed("SIZE 4 4 4", "SIZE 4 4 3"), HasSubstr("SIZE"));
  EXPECT_THAT(changed("SIZE 4 4 4", "SIZE 4 4 4 4"), HasSubstr("SIZE"));
  EXPECT_THAT(changed("TYPE F F F", "TYPE F F Q"), HasSubstr("TYPE"));
  EXPECT_THAT(changed("SIZE 4 4 4", "SIZE 4 4 2"), HasSubstr("TYPE"));
  EXPECT_THAT(changed("FIELDS x y z", "FIELDS x y w"), HasSubstr("x, y and z"));
  EXPECT_THAT(changed("FIELDS x y z", "FIELDS x y z z"), HasSubstr("SIZE"));
  EXPECT_THAT(changed("FIELDS x y z", "FIELDS"), HasSubstr("FIELDS"));
  EXPECT_THAT(changed("HEIGHT 1", "HEIGHT 2"), HasSubstr("WIDTH x HEIGHT = 2"));
  EXPECT_THAT(changed("HEIGHT 1", "HEIGHT 1\nHEIGHT 1"), HasSubstr("twice"));
  EXPECT_THAT(changed("VIEWPOINT 0 0 0 1 0 0 0", "VIEWPOINT 0 0"), HasSubstr("VIEWPOINT"));
  EXPECT_THAT(changed("VIEWPOINT 0 0 0 1 0 0 0", "VIEWPOINT 0 0 0 1 0 0 nan"),
              HasSubstr("VIEWPOINT"));
  EXPECT_THAT(changed("DATA ascii", "ascii"), HasSubstr("unknown line"));
}

TEST(PcdFiles, FieldNameWithBlankIsRefused) {
  PointCloud cloud = sample_cloud(2);
  cloud.add_field("two words", ScalarType::float32);
  for (const char* const extension : {".pcd", ".ply"})
    EXPECT_THAT(error_of([&] {
                  write_cloud(scratch_folder() / (std::string("c") + extension), cloud);
                }).what(),
                HasSubstr("'two words'"));
  write_cloud(scratch_folder() / "c.csv", cloud);
  EXPECT_NE(read_cloud(scratch_folder() / "c.csv").cloud.find_field("two words"), nullptr);
}

TEST(PlyFiles, ForeignElementsListsAndNames) {
  const std::string bytes =
      "ply\r\nformat ascii 1.0\r\ncomment made elsewhere\r\nobj_info 3\r\nelement camera 1\r\n"
      "property float view_px\r\nelement vertex 2\r\nproperty double Y\r\nproperty double X\r\n"
      "property list uchar int neighbours\r\nproperty float64 Z\r\nproperty float diffuse_red\r\n"
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
  EXPECT_THAT(read.info.skipped, ElementsAre("element camera", "list neighbours", "1 faces"));
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
  EXPECT_THAT(error_as(".ply", header + first + lying), HasSubstr("list longer than the data"));
}

TEST(PlyFiles, HeadersThatLie) {
  EXPECT_THAT(error_as(".ply", ply_header("binary_little_endian", "11") + std::string(120, '\1')),
              HasSubstr("promises 11 rows of 'vertex' of 12 bytes, but only 120"));
  EXPECT_THAT(error_as(".ply", ply_header("ascii", "3") + "1.5 2.5 3.5\n1.5 2.5 3.5\n"),
              HasSubstr("promises 3 rows of 'vertex', but the data end in row 2"));
  EXPECT_THAT(error_as(".ply", ply_header("ascii", "1") + "1 2 3 4\n"), HasSubstr("more than one"));
  EXPECT_THAT(error_as(".ply", ply_header("ascii", "1") + "1 22 \n"), HasSubstr("z"));
  for (const char* const points : {"9223372036854775807", "1537228672809129302", "1000000000000"})
    for (const char* const encoding : {"ascii", "binary_little_endian", "binary_big_endian"})
      EXPECT_THAT(error_as(".ply", ply_header(encoding, points) + std::string(100, '1')),
                  HasSubstr("promises"));
  for (const char* const points : {"-1", "1e3", "99999999999999999999", "x", ""})
    error_as(".ply", ply_header("ascii", points) + "1 2 3\n");
  error_as(".ply", ply_header("binary_middle_endian", "1") + "1 2 3\n");
  EXPECT_THAT(error_as(".ply",
                       "ply\nformat ascii 1.0\nelement vertex 1\nproperty uchar x\n"
                       "property uchar y\nproperty uchar z\nend_header\n1 2 256\n"),
              HasSubstr("uint8"));
  EXPECT_THAT(error_as(".ply",
                       "ply\nformat ascii 1.0\nelement point 1\nproperty float x\n"
                       "end_header\n1\n"),
              HasSubstr("no element vertex"));
}

TEST(VtpFiles, PointsAreVertexCells) {
  const fs::path path = scratch_folder() / "cloud.vtp";
  write_cloud(path, sample_cloud(17), {FileEncoding::ascii, false});
  EXPECT_THAT(read_text(path), HasSubstr("NumberOfVerts=\"17\""));
  EXPECT_THAT(read_text(path), HasSubstr("Normals=\"Normals\""));
}

// As ParaView writes by default: base64 beside the XML, 32-bit block headers.
std::string inline_vtp(const std::string& points_base64, const std::string& score_base64) {
  return "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"0.1\" "
         "byte_order=\"LittleEndian\">\n<PolyData><Piece NumberOfPoints=\"2\" NumberOfVerts=\"0\" "
         "NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"0\">\n<PointData><DataArray "
         "type=\"Int16\" Name=\"level\" format=\"binary\">" +
         score_base64 +
         "</DataArray></PointData>\n<Points><DataArray type=\"Float32\" Name=\"Points\" "
         "NumberOfComponents=\"3\" format=\"binary\">\n  " +
         points_base64 + "\n</DataArray></Points></Piece></PolyData></VTKFile>\n";
}

TEST(VtpFiles, InlineBase64) {
  // A length of 24 and 1 2 3 4 5 6; a length of 4 and 7 -1.
  const std::string points = "GAAAAAAAgD8AAABAAABAQAAAgEAAAKBAAADAQA==";
  const CloudReadResult read = read_as(".vtp", inline_vtp(points, "BAAAAAcA//8="));
  ASSERT_EQ(read.cloud.size(), 2U);
  EXPECT_EQ(read.cloud.positions[1], Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(read.cloud.fields[0], (ScalarField{"level", ScalarType::int16, {7, -1}}));
  EXPECT_THAT(error_as(".vtp", inline_vtp("//8" + points, "BAAAAAcA//8=")),
              HasSubstr("claims more than the file holds"));
  error_as(".vtp", inline_vtp(points, ""));
}

TEST(VtpFiles, AppendedDataBeginWithAnUnderscore) {
  const fs::path path = scratch_folder() / "cloud.vtp";
  write_cloud(path, sample_cloud(17), {FileEncoding::binary_compressed, false});
  std::string bytes = read_text(path);
  bytes[bytes.find('>', bytes.find("<AppendedData")) + 1] = 'x';
  EXPECT_THAT(error_as(".vtp", bytes), HasSubstr("'_'"));
}

TEST(VtpFiles, CountsThatLie) {
  const fs::path path = scratch_folder() / "cloud.vtp";
  write_cloud(path, sample_cloud(17), {FileEncoding::ascii, false});
  const std::string good = read_text(path);
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string bytes = good;
    bytes.replace(bytes.find(from), from.size(), to);
    return error_as(".vtp", bytes);
  };
  changed("NumberOfPoints=\"17\"", "NumberOfPoints=\"18\"");
  EXPECT_THAT(changed("NumberOfPoints=\"17\"", "NumberOfPoints=\"17000000000000\""),
              HasSubstr("NumberOfPoints"));
  EXPECT_THAT(changed("NumberOfComponents=\"3\"", "NumberOfComponents=\"1000000000\""),
              HasSubstr("NumberOfComponents"));
  EXPECT_THAT(changed("</VTKFile>", "</VTKFil>"), HasSubstr("VTK cannot read it"));
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
  EXPECT_THAT(error_as(".csv", "x,y,z\n1,2,3\n1,2,\n"), HasSubstr("z"));
  EXPECT_THAT(error_as(".csv", "x,y,z,score\n1,2,3,1\n1,2,3,high\n"), HasSubstr("high"));
  EXPECT_THAT(error_as(".csv", "x,y\n1,2\n"), HasSubstr("x, y and z"));
  EXPECT_THAT(error_as(".csv", "x,y,z,x\n1,2,3,4\n"), HasSubstr("twice"));
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

}  // namespace
}  // namespace libmap
