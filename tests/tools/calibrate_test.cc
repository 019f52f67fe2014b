#include <gtest/gtest.h>

#include <cmath>

#include "libmap/camera/camera_io.h"
#include "libmap/camera/image_codec.h"
#include "libmap/core/table.h"
#include "tests/support/chessboard_image.h"
#include "tests/tools/tool_test_support.h"

namespace calibrate_test {

namespace fs = std::filesystem;
using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::ended_with;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::warned;
using Words = std::vector<std::string>;

libmap::Camera true_camera() {
  libmap::Camera camera;
  camera.width = 320;
  camera.height = 240;
  camera.fx = 290.5;
  camera.fy = 291.5;
  camera.cx = 161.2;
  camera.cy = 117.4;
  camera.distortion_model = libmap::DistortionModel::radial_tangential;
  camera.distortion = {0.09, -0.27, 0.001, -0.0007, 0.0};
  return camera;
}

// shots/00.png, ...: 8-bit gray, 16-bit infrared and color JPEG in turn.
void write_shots(int count) {
  const libmap::Camera camera = true_camera();
  const graspmap_test::ChessboardPainter painter(camera, 4);
  fs::create_directories(scratch("shots"));
  int n = 0;
  for (const libmap::Pose& pose : graspmap_test::board_poses(camera, {}, count, 45)) {
    const libmap::GrayImage gray = graspmap_test::photographed(painter.paint({}, pose), 0.6, 2.0);
    libmap::Image<std::uint16_t> deep(gray.width, gray.height);
    libmap::ColorImage color(gray.width, gray.height);
    for (std::size_t pixel = 0; pixel < gray.pixels.size(); ++pixel) {
      const std::uint8_t value = gray.pixels[pixel];
      deep.pixels[pixel] = static_cast<std::uint16_t>(300 + 11 * value);
      color.pixels[pixel] = {value, value, value};
    }
    const std::string name = std::string(n < 10 ? "0" : "") + std::to_string(n);
    const fs::path place = scratch("shots") / name;
    if (n % 3 == 0) graspmap_test::write_text(place.string() + ".png", libmap::encode_png(gray));
    if (n % 3 == 1) graspmap_test::write_text(place.string() + ".png", libmap::encode_png(deep));
    if (n % 3 == 2) graspmap_test::write_text(place.string() + ".jpg", libmap::encode_jpeg(color));
    ++n;
  }
}

TEST(Calibrate, RecoversTheCameraOfItsImages) {
  write_shots(12);
  graspmap_test::write_text(scratch("shots") / "wall.png",
                            libmap::encode_png(libmap::GrayImage(320, 240, 90)));
  const auto result = graspmap({"calibrate", "shots", "--board", "8x6", "--square-mm", "30",
                                "--report", "report", "-o", "camera.yaml"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_TRUE(warned(result, {"shots/wall.png"}));
  const libmap::Camera truth = true_camera();
  const libmap::Camera camera = libmap::read_camera(scratch("camera.yaml")).camera;
  const nlohmann::json results = json_of("camera.yaml.json").at("results");
  EXPECT_EQ(results.at("images"), 13);
  EXPECT_EQ(results.at("images_without_board"), 1);
  EXPECT_LT(results.at("rms_px").get<double>(), 0.1);
  const auto deviation = [&](const std::string& name) {
    return results.at(name + "_deviation").get<double>();
  };
  EXPECT_LT(std::abs(camera.fx - truth.fx), 3 * deviation("fx"));
  EXPECT_LT(std::abs(camera.fy - truth.fy), 3 * deviation("fy"));
  EXPECT_LT(std::abs(camera.cx - truth.cx), 3 * deviation("cx"));
  EXPECT_LT(std::abs(camera.cy - truth.cy), 3 * deviation("cy"));
  EXPECT_LT(deviation("fx"), 1.0);
  EXPECT_NE(content("camera.yaml").find("+-"), std::string::npos);

  const libmap::Table images = libmap::read_csv(scratch("report") / "images.csv");
  ASSERT_EQ(images.rows.size(), 13U);
  EXPECT_EQ(images.rows[12][images.column("used")], "no board");
  for (std::size_t row = 0; row < 12; ++row) {
    EXPECT_LT(images.number(row, images.column("rms_px")), 0.5);
    EXPECT_LT(images.number(row, images.column("tilt_deg")), 46);
  }
  const libmap::Table residuals = libmap::read_csv(scratch("report") / "residuals.csv");
  ASSERT_EQ(residuals.rows.size(), 12U * 48);
  double sum = 0;
  for (std::size_t row = 0; row < residuals.rows.size(); ++row)
    sum += std::pow(residuals.number(row, residuals.column("residual_x_px")), 2) +
           std::pow(residuals.number(row, residuals.column("residual_y_px")), 2);
  EXPECT_NEAR(std::sqrt(sum / (12 * 48)), results.at("rms_px").get<double>(), 1e-9);
  for (const char* name : {"report/residuals.png", "report/errors.png"})
    EXPECT_GT(libmap::decode_color(content(name)).width, 100) << name;

  ASSERT_TRUE(succeeded(graspmap({"calibrate", "shots", "-o", "again.yaml", "--threads", "1"})));
  EXPECT_EQ(content("again.yaml"), content("camera.yaml"));
}

TEST(Calibrate, GoesOnWithoutImagesThatItCannotRead) {
  write_shots(6);
  graspmap_test::write_text(scratch("shots") / "00a.png", content("shots/00.png").substr(0, 3000));
  graspmap_test::write_text(scratch("shots") / "text.jpg", "no picture");
  const auto result = graspmap({"calibrate", "shots", "-o", "camera.yaml", "--report", "report"});
  ASSERT_TRUE(succeeded(result));
  for (const char* name : {"shots/00a.png", "shots/text.jpg"}) {
    EXPECT_TRUE(warned(result, {name}));
    EXPECT_EQ(result.standard_error.find(name), result.standard_error.rfind(name)) << "one warning";
  }
  const nlohmann::json results = json_of("camera.yaml.json").at("results");
  EXPECT_EQ(results.at("images"), 8);
  EXPECT_EQ(results.at("images_unreadable"), 2);
  EXPECT_EQ(results.at("images_without_board"), 0);
  EXPECT_EQ(results.at("images_used"), 6);
  const libmap::Table images = libmap::read_csv(scratch("report") / "images.csv");
  EXPECT_EQ(images.rows[1][images.column("used")], "unreadable");
  // The first readable image determines the size of all images.
  fs::remove(scratch("shots/00.png"));
  EXPECT_TRUE(succeeded(graspmap({"calibrate", "shots", "-o", "camera.yaml"})));
  // Too few remain.
  const auto few =
      graspmap({"calibrate", "shots/00a.png", "shots/01.png", "shots/02.jpg", "-o", "few.yaml"});
  EXPECT_TRUE(warned(few, {"shots/00a.png"}));
  EXPECT_TRUE(ended_with(
      few, {.field = "number of images", .value = "2", .bound = ">= 3, better 15 and more"}));
}

TEST(Calibrate, BadInputIsOneLineAndLeavesNothing) {
  write_shots(3);
  const auto run = [](Words words) {
    words.insert(words.begin(), "calibrate");
    words.insert(words.end(), {"-o", "camera.yaml"});
    return graspmap(words);
  };
  EXPECT_TRUE(bad_input(run({"none.png"}), {.file = "none.png"}));
  EXPECT_TRUE(bad_input(run({"shots/00.png", "shots/01.png"}),
                        {.field = "number of images", .value = "2"}));
  EXPECT_TRUE(bad_input(run({"shots", "--board", "9x7"}), {.field = "--board", .value = "9x7"}));
  EXPECT_TRUE(bad_input(run({"shots", "--board", "9"}), {.field = "--board", .value = "9"}));
  EXPECT_TRUE(bad_input(run({"shots", "--square-mm", "0"}),
                        {.field = "--square", .value = "0", .bound = "> 0"}));
  EXPECT_TRUE(
      bad_input(run({"shots", "--lens", "fisheye"}), {.field = "--lens", .value = "fisheye"}));
  fs::create_directories(scratch("empty"));
  EXPECT_TRUE(bad_input(run({"empty"}), {.file = "empty"}));
  graspmap_test::write_text(scratch("text.png"), "no picture");
  EXPECT_TRUE(bad_input(run({"text.png"}), {.file = "text.png"}));
  graspmap_test::write_text(scratch("cut.png"), content("shots/00.png").substr(0, 3000));
  EXPECT_TRUE(bad_input(run({"cut.png"}), {.file = "cut.png"}));
  graspmap_test::write_text(scratch("small.png"), libmap::encode_png(libmap::GrayImage(64, 48)));
  EXPECT_TRUE(bad_input(run({"shots/00.png", "small.png"}),
                        {.file = "small.png", .field = "size", .value = "64 x 48"}));
  graspmap_test::write_text(scratch("large.png"),
                            libmap::encode_png(libmap::GrayImage(4097, 4096)));
  EXPECT_TRUE(bad_input(run({"large.png"}),
                        {.file = "large.png", .field = "image size", .value = "4097 x 4096"}));
  EXPECT_TRUE(
      bad_input(graspmap({"calibrate", "shots", "-o", "camera.txt"}), {.file = "camera.txt"}));
  // Repeated images add no information.
  EXPECT_TRUE(bad_input(run({"shots/00.png", "shots/00.png", "shots/00.png", "shots/00.png"}),
                        {.field = "number of images", .value = "1"}));
  EXPECT_TRUE(
      bad_input(graspmap({"calibrate", "shots", "-o", "shots/00.png"}), {.file = "shots/00.png"}));
  EXPECT_FALSE(fs::exists(scratch("camera.yaml")));
}

}  // namespace calibrate_test
