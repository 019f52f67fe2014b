#include "libmap/scan/laser_scan.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "libmap/image/matrix_codec.h"
#include "tests/libmap/scan/sample_database.h"
#include "tests/support/test_support.h"

namespace laser_scan_test {

using graspmap_test::bytes_of;
using graspmap_test::error_of;
using libmap::LaserScan;
using libmap::LaserScanFormat;
using libmap::MatrixElement;

std::string scan_blob(int channels, const std::vector<float>& numbers) {
  return encode_matrix(libmap::StoredMatrix{1, static_cast<int>(numbers.size()) / channels,
                                            channels, MatrixElement::float32, bytes_of(numbers)});
}

std::string info_76(float format) {
  return bytes_of(std::vector<float>{format, 0.25F, 30, -1.5F, 1.5F, 0.125F, 360}) +
         graspmap_test::pose_bytes(libmap::make_pose_from_rpy({1, 2, 3}, {0, 0, 90}));
}

struct Layout {
  int format;
  std::vector<float> point;
  Eigen::Vector3d position;
  bool has_normal;
  bool has_color;
  std::vector<std::pair<std::string, double>> fields;
};

std::vector<Layout> layouts() {
  const auto rgb = std::bit_cast<float>(0x00102030U);
  return {{1, {1, 2}, {1, 2, 0}, false, false, {}},
          {2, {1, 2, 7}, {1, 2, 0}, false, false, {{"intensity", 7}}},
          {3, {1, 2, 0, 0, 1}, {1, 2, 0}, true, false, {}},
          {4, {1, 2, 7, 0, 0, 1}, {1, 2, 0}, true, false, {{"intensity", 7}}},
          {5, {1, 2, 3}, {1, 2, 3}, false, false, {}},
          {6, {1, 2, 3, 7}, {1, 2, 3}, false, false, {{"intensity", 7}}},
          {7, {1, 2, 3, rgb}, {1, 2, 3}, false, true, {}},
          {8, {1, 2, 3, 0, 0, 1}, {1, 2, 3}, true, false, {}},
          {9, {1, 2, 3, 7, 0, 0, 1}, {1, 2, 3}, true, false, {{"intensity", 7}}},
          {10, {1, 2, 3, rgb, 0, 0, 1}, {1, 2, 3}, true, true, {}},
          {11, {1, 2, 3, 7, 0.5F}, {1, 2, 3}, false, false, {{"intensity", 7}, {"time", 0.5}}},
          {12,
           {1, 2, 3, 7, 4, 0.5F},
           {1, 2, 3},
           false,
           false,
           {{"intensity", 7}, {"ring", 4}, {"time", 0.5}}}};
}

TEST(LaserScan, AllFormats) {
  for (const Layout& layout : layouts()) {
    SCOPED_TRACE(layout.format);
    std::vector<float> numbers = layout.point;
    numbers.insert(numbers.end(), layout.point.begin(), layout.point.end());
    const LaserScan scan =
        libmap::decode_laser_scan(scan_blob(static_cast<int>(layout.point.size()), numbers),
                                  info_76(static_cast<float>(layout.format)));
    EXPECT_EQ(static_cast<int>(scan.format), layout.format);
    ASSERT_EQ(scan.points.size(), 2U);
    EXPECT_NO_THROW(scan.points.check());
    EXPECT_EQ(scan.points.positions[1], layout.position);
    EXPECT_EQ(scan.points.has_normals(), layout.has_normal);
    if (layout.has_normal) {
      EXPECT_EQ(scan.points.normals[1], Eigen::Vector3f(0, 0, 1));
    }
    EXPECT_EQ(scan.points.has_colors(), layout.has_color);
    if (layout.has_color) {
      EXPECT_EQ(scan.points.colors[1], (libmap::Color{0x10, 0x20, 0x30}));
    }
    ASSERT_EQ(scan.points.fields.size(), layout.fields.size());
    for (const auto& [name, value] : layout.fields)
      EXPECT_EQ(scan.points.find_field(name)->values.at(1), value) << name;
  }
}

TEST(LaserScan, InfoOfEachVersion) {
  const std::string blob = scan_blob(3, {1, 2, 3});
  const LaserScan today = libmap::decode_laser_scan(blob, info_76(5));
  EXPECT_EQ(today.range_min_m, 0.25);
  EXPECT_EQ(today.range_max_m, 30);
  EXPECT_EQ(today.angle_min_rad, -1.5);
  EXPECT_EQ(today.angle_increment_rad, 0.125);
  EXPECT_EQ(today.max_points, 360);
  EXPECT_NEAR(today.base_from_scan.translation().z(), 3, 1e-6);
  EXPECT_NEAR(today.base_from_scan.linear()(1, 0), 1, 1e-6);

  const std::string local = info_76(5).substr(28);
  const LaserScan middle =
      libmap::decode_laser_scan(blob, bytes_of(std::vector<float>{90, 12, 2}) + local);
  EXPECT_EQ(middle.format, LaserScanFormat::xy_intensity);
  EXPECT_EQ(middle.max_points, 90);
  EXPECT_EQ(middle.range_max_m, 12);
  const LaserScan early =
      libmap::decode_laser_scan(blob, bytes_of(std::vector<float>{90, 12}) + local);
  EXPECT_EQ(early.format, LaserScanFormat::xyz);
  EXPECT_NEAR(early.base_from_scan.translation().x(), 1, 1e-6);
  EXPECT_EQ(libmap::decode_laser_scan(blob, "").format, LaserScanFormat::xyz);
}

TEST(LaserScan, PointsThatAreNotFiniteAreDropped) {
  const LaserScan scan =
      libmap::decode_laser_scan(scan_blob(3, {1, 2, 3, NAN, 2, 3, 1, 2, INFINITY}), info_76(5));
  EXPECT_EQ(scan.points.size(), 1U);
  EXPECT_EQ(scan.dropped_points, 2U);
}

TEST(LaserScan, WhatIsBroken) {
  const std::string blob = scan_blob(3, {1, 2, 3});
  error_of([&] { libmap::decode_laser_scan(blob, info_76(13)); });
  error_of([&] { libmap::decode_laser_scan(blob, info_76(NAN)); });
  error_of([&] { libmap::decode_laser_scan(blob, info_76(1)); });
  error_of([&] { libmap::decode_laser_scan(blob, info_76(5).substr(1)); });
  error_of([&] { libmap::decode_laser_scan(blob.substr(1), info_76(5)); });
  for (const float points : {-1.0F, NAN, 3e9F}) {
    std::string info = info_76(5);
    info.replace(24, 4, bytes_of(std::vector<float>{points}));
    EXPECT_EQ(error_of([&] { libmap::decode_laser_scan(blob, info); }).reason(),
              "scan_info contains no number of points");
  }
  error_of([&] { libmap::decode_laser_scan(scan_blob(9, std::vector<float>(9, 1.0F)), ""); });
}

}  // namespace laser_scan_test
