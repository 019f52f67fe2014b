#include "libmap/scan/image_export.h"

#include <gtest/gtest.h>

#include "libmap/camera/image_codec.h"
#include "libmap/scan/rtabmap_reader.h"
#include "tests/libmap/scan/sample_checks.h"
#include "tests/libmap/scan/sample_database.h"
#include "tests/support/test_support.h"

namespace image_export_test {

using namespace graspmap_test;
using libmap::RtabmapDatabase;

TEST(ImageExport, NamesSortByNodeThenCamera) {
  EXPECT_EQ(libmap::image_file_name(12, 0, ".jpg"), "000012.jpg");
  EXPECT_EQ(libmap::image_file_name(12, 1, ".png"), "000012_1.png");
  EXPECT_EQ(libmap::image_file_name(1234567, 0, ".png"), "1234567.png");
}

TEST(ImageExport, HoldsTheStoredBytesOfTheOnlyCamera) {
  const std::filesystem::path file = sample_file();
  const std::string jpeg = libmap::encode_jpeg(sample_color(1), 60);
  execute(file, "UPDATE Data SET image = ? WHERE id = 1", {jpeg});
  const RtabmapDatabase scan(file);
  const auto views = libmap::read_views(scan, 1, {});
  ASSERT_EQ(views.size(), 1U);
  const libmap::ImageFile image = libmap::image_file_of(scan, 1, views, 0);
  EXPECT_EQ(image.name, "000001.jpg");
  EXPECT_EQ(image.bytes, jpeg);
}

TEST(ImageExport, NodesWithoutColorOrCalibrationAreNamed) {
  const std::filesystem::path file = sample_file();
  execute(file, "UPDATE Data SET image = NULL WHERE id = 1");
  execute(file, "UPDATE Data SET calibration = NULL WHERE id = 2");
  const RtabmapDatabase scan(file);
  const auto refusal_of = [&](int node) {
    return error_of([&] { libmap::read_views(scan, node, {}); });
  };
  EXPECT_TRUE(is_error(refusal_of(1), {.file = file, .field = "node 1"}));
  EXPECT_TRUE(is_error(refusal_of(2), {.file = file, .field = "node 2"}));
}

}  // namespace image_export_test
