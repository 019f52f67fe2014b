#include "libmap/scan/scan_verification.h"

#include <gtest/gtest.h>

#include <cmath>

#include "libmap/camera/matrix_codec.h"
#include "tests/libmap/scan/sample_database.h"
#include "tests/support/test_support.h"

namespace laser_scan_test {

using graspmap_test::bytes_of;
using graspmap_test::error_of;
using graspmap_test::is_error;
using libmap::MatrixElement;

std::string scan_blob(int channels, const std::vector<float>& numbers) {
  return encode_matrix(libmap::StoredMatrix{1, static_cast<int>(numbers.size()) / channels,
                                            channels, MatrixElement::float32, bytes_of(numbers)});
}

std::string info_76(float format) {
  return bytes_of(std::vector<float>{format, 0.25F, 30, -1.5F, 1.5F, 0.125F, 360}) +
         graspmap_test::pose_bytes(libmap::make_pose_from_rpy({1, 2, 3}, {0, 0, 90}));
}

TEST(LaserScan, ChannelsOfEveryFormat) {
  const std::vector<int> channels = {2, 3, 5, 6, 3, 4, 4, 6, 7, 7, 5, 6};
  for (std::size_t n = 0; n < channels.size(); ++n) {
    SCOPED_TRACE(n + 1);
    const std::string info = info_76(static_cast<float>(n + 1));
    const std::vector<float> numbers(2 * static_cast<std::size_t>(channels[n]), 1.0F);
    EXPECT_NO_THROW(libmap::check_laser_scan(scan_blob(channels[n], numbers), info));
    const std::vector<float> more(2 * static_cast<std::size_t>(channels[n] + 1), 1.0F);
    EXPECT_EQ(error_of([&] { libmap::check_laser_scan(scan_blob(channels[n] + 1, more), info); })
                  .context()
                  .bound,
              std::to_string(channels[n]));
  }
}

TEST(LaserScan, InfoOfEachVersion) {
  const std::string blob = scan_blob(3, {1, 2, 3});
  const std::string local = info_76(5).substr(28);
  libmap::check_laser_scan(blob, info_76(5));
  libmap::check_laser_scan(blob, bytes_of(std::vector<float>{90, 12, 2}) + local);
  libmap::check_laser_scan(blob, bytes_of(std::vector<float>{90, 12}) + local);
  libmap::check_laser_scan(blob, "");
}

TEST(LaserScan, WhatIsBroken) {
  const std::string blob = scan_blob(3, {1, 2, 3});
  EXPECT_TRUE(
      is_error(error_of([&] { libmap::check_laser_scan(blob, info_76(13)); }), {.value = "13"}));
  EXPECT_TRUE(
      is_error(error_of([&] { libmap::check_laser_scan(blob, info_76(NAN)); }), {.value = "nan"}));
  EXPECT_TRUE(is_error(error_of([&] { libmap::check_laser_scan(blob, info_76(1)); }),
                       {.value = "3", .bound = "2"}));
  EXPECT_TRUE(is_error(error_of([&] { libmap::check_laser_scan(blob, info_76(5).substr(1)); }),
                       {.value = "75 bytes", .bound = "56, 60 or 76 bytes"}));
  EXPECT_TRUE(is_error(error_of([&] { libmap::check_laser_scan(blob.substr(1), info_76(5)); }),
                       {.field = "compressed matrix"}));
  for (const float points : {-1.0F, NAN, 3e9F}) {
    std::string info = info_76(5);
    info.replace(24, 4, bytes_of(std::vector<float>{points}));
    EXPECT_TRUE(is_error(error_of([&] { libmap::check_laser_scan(blob, info); }),
                         {.field = "number of points in scan_info"}));
  }
  EXPECT_TRUE(is_error(
      error_of([&] { libmap::check_laser_scan(scan_blob(9, std::vector<float>(9, 1.0F)), ""); }),
      {.value = "9"}));
}

}  // namespace laser_scan_test
