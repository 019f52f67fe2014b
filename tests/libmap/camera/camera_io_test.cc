#include "libmap/camera/camera_io.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "tests/support/test_support.h"

namespace camera_io_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::scratch_folder;
using graspmap_test::uniform;
using libmap::Camera;
using libmap::CameraFile;
using libmap::DistortionModel;
using libmap::parse_camera;
using libmap::to_yaml;

Camera random_camera(DistortionModel model, std::size_t terms) {
  Camera camera;
  camera.width = 640;
  camera.height = 360;
  camera.fx = uniform(300, 700);
  camera.fy = uniform(300, 700);
  camera.cx = uniform(200, 400);
  camera.cy = uniform(100, 200);
  camera.distortion_model = model;
  for (std::size_t n = 0; n < terms; ++n) camera.distortion.push_back(uniform(-0.3, 0.3));
  camera.base_from_camera =
      libmap::make_pose_from_rpy({uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)},
                                 {uniform(-180, 180), uniform(-80, 80), uniform(-180, 180)});
  return camera;
}

void expect_equal(const Camera& a, const Camera& b) {
  EXPECT_EQ(a.width, b.width);
  EXPECT_EQ(a.height, b.height);
  EXPECT_EQ(a.fx, b.fx);
  EXPECT_EQ(a.fy, b.fy);
  EXPECT_EQ(a.cx, b.cx);
  EXPECT_EQ(a.cy, b.cy);
  EXPECT_EQ(a.distortion_model, b.distortion_model);
  EXPECT_EQ(a.distortion, b.distortion);
  EXPECT_EQ(a.base_from_camera.matrix(), b.base_from_camera.matrix());
}

struct Lens {
  DistortionModel model;
  std::size_t terms;
};
constexpr Lens lenses[] = {{DistortionModel::none, 0},
                           {DistortionModel::radial_tangential, 4},
                           {DistortionModel::radial_tangential, 5},
                           {DistortionModel::radial_tangential, 8},
                           {DistortionModel::radial_tangential, 12},
                           {DistortionModel::equidistant, 4}};

TEST(CameraIo, DepthCorrectionsComeBackBitForBit) {
  CameraFile file{.name = "a", .camera = random_camera(DistortionModel::none, 0)};
  file.depth = {0.61, 0.2, {0.001, -0.002, 1e-7, 0.25, -0.125}, {0.1, -0.003, 1.0 / 3.0}};
  const CameraFile read = parse_camera(to_yaml(file), "a.yaml");
  EXPECT_EQ(read.depth, file.depth);
  expect_equal(read.camera, file.camera);
  EXPECT_TRUE(parse_camera(to_yaml({.camera = file.camera}), "a.yaml").depth.empty());
  file.depth.spline_m.resize(3);
  EXPECT_TRUE(is_error(
      error_of([&] { parse_camera(to_yaml(file), "a.yaml"); }),
      {.file = "a.yaml", .field = "depth_correction", .value = "3", .bound = "4 to 1000"}));
  file.depth.spline_m = {0, 0, 0, 2};
  EXPECT_TRUE(is_error(
      error_of([&] { parse_camera(to_yaml(file), "a.yaml"); }),
      {.file = "a.yaml", .field = "depth_correction", .value = "2", .bound = "-1 to 1 m"}));
  file.depth.spline_m = {0, 0, 0, 0};
  file.depth.step_m = 0.0;
  EXPECT_TRUE(is_error(error_of([&] { parse_camera(to_yaml(file), "a.yaml"); }),
                       {.file = "a.yaml", .field = "depth_correction_range", .value = "0.61, 0"}));
}

// A spline of equal coefficients is a constant; of coefficients on a line that line; depths beyond
// the knots take what the last of them take.
TEST(DepthCorrection, IsTheSplineAndTheRadialTerms) {
  libmap::DepthCorrection correction{1.0, 0.5, {0, 0, 0, 0, 0, 0}, {0.01, 0.02, 0.03}};
  EXPECT_NEAR(correction.at(1.7, 0.25), 0.01 * 0.25 + 0.02 * 0.0625 + 0.03 * 1.7 * 0.25, 1e-15);
  correction.radial = {};
  for (std::size_t n = 0; n < 6; ++n) correction.spline_m[n] = 0.1 * (static_cast<double>(n) - 1.0);
  EXPECT_DOUBLE_EQ(correction.last_m(), 2.5);
  for (const double z : {1.0, 1.2, 1.5, 2.0, 2.49, 2.5})
    EXPECT_NEAR(correction.at(z, 0.0), 0.2 * (z - 1.0), 1e-12) << z;
  EXPECT_NEAR(correction.at(0.2, 0.0), 0.0, 1e-12);
  EXPECT_NEAR(correction.at(9.0, 0.0), 0.3, 1e-12);
  libmap::DepthImage image(3, 1, 2.0F);
  image.at(1, 0) = 0.0F;
  libmap::correct_depth(image, correction);
  EXPECT_FLOAT_EQ(image.at(0, 0), 2.2F);
  EXPECT_EQ(image.at(1, 0), 0.0F) << "what was not measured stays so";
}

TEST(CameraIo, EveryLensReadsBackBitForBit) {
  for (const Lens& lens : lenses) {
    for (int round = 0; round < 20; ++round) {
      const Camera camera = random_camera(lens.model, lens.terms);
      const CameraFile file =
          parse_camera(to_yaml({"infra \"red\" #1: \\", camera}, "two\nlines"), "a.yaml");
      EXPECT_EQ(file.name, "infra \"red\" #1: \\");
      expect_equal(file.camera, camera);
    }
  }
}

TEST(CameraIo, OpenCvReadsWhatIsWritten) {
  const Camera camera = random_camera(DistortionModel::radial_tangential, 12);
  const std::filesystem::path path = scratch_folder() / "camera.yaml";
  graspmap_test::write_text(path, to_yaml({"left", camera}, "a comment"));
  cv::FileStorage storage(path.string(), cv::FileStorage::READ);
  ASSERT_TRUE(storage.isOpened());
  cv::Mat matrix;
  cv::Mat terms;
  cv::Mat transform;
  storage["camera_matrix"] >> matrix;
  storage["distortion_coefficients"] >> terms;
  storage["local_transform"] >> transform;
  EXPECT_EQ(static_cast<int>(storage["image_width"]), 640);
  EXPECT_EQ(static_cast<std::string>(storage["camera_name"]), "left");
  ASSERT_EQ(matrix.size(), cv::Size(3, 3));
  EXPECT_EQ(matrix.at<double>(0, 0), camera.fx);
  EXPECT_EQ(matrix.at<double>(0, 2), camera.cx);
  EXPECT_EQ(matrix.at<double>(1, 1), camera.fy);
  EXPECT_EQ(matrix.at<double>(1, 2), camera.cy);
  ASSERT_EQ(terms.size(), cv::Size(12, 1));
  for (int n = 0; n < 12; ++n)
    EXPECT_EQ(terms.at<double>(n), camera.distortion[static_cast<std::size_t>(n)]);
  ASSERT_EQ(transform.size(), cv::Size(4, 3));
  EXPECT_EQ(transform.at<double>(1, 3), camera.base_from_camera.translation().y());
}

TEST(CameraIo, ReadsWhatOpenCvWrites) {
  const Camera camera = random_camera(DistortionModel::radial_tangential, 5);
  const std::filesystem::path path = scratch_folder() / "opencv.yml";
  {
    // As OpenCV's calibration sample does.
    cv::FileStorage storage(path.string(), cv::FileStorage::WRITE);
    storage << "calibration_time"
            << "Sat Nov 21 2026";
    storage << "image_width" << 640 << "image_height" << 360 << "flags" << 0;
    storage << "fisheye_model" << 0;
    storage << "camera_matrix"
            << (cv::Mat_<double>(3, 3) << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0,
                1);
    storage << "distortion_coefficients" << cv::Mat(camera.distortion);
    storage << "avg_reprojection_error" << 0.25;
    storage << "per_view_reprojection_errors" << cv::Mat::ones(20, 1, CV_32F);
  }
  const CameraFile file = libmap::read_camera(path);
  EXPECT_EQ(file.name, "");
  EXPECT_EQ(file.camera.fx, camera.fx);
  EXPECT_EQ(file.camera.cy, camera.cy);
  EXPECT_EQ(file.camera.distortion, camera.distortion);
  EXPECT_EQ(file.camera.base_from_camera.matrix(), libmap::optical_to_body_rotation().matrix());
}

const std::string plain =
    "image_width: 640\nimage_height: 480\ncamera_name: narrow_stereo\n"
    "camera_matrix:\n  rows: 3\n  cols: 3\n  data: [500., 0, 320, 0, 500., 240, 0, 0, 1]\n";

TEST(CameraIo, ReadsRosAndRtabmapVariants) {
  const Camera ros =
      parse_camera(plain +
                       "distortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n"
                       "  cols: 5\n  data: [0.1, -0.2, 0.001, 0.002, 0]\n"
                       "rectification_matrix:\n  rows: 3\n  cols: 3\n"
                       "  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n",
                   "ros.yaml")
          .camera;
  EXPECT_EQ(ros.distortion, (std::vector<double>{0.1, -0.2, 0.001, 0.002, 0}));
  EXPECT_EQ(parse_camera(plain, "a").camera.distortion_model, DistortionModel::none);
  EXPECT_EQ(parse_camera(plain + "distortion_coefficients: [0, 0, 0, 0, 0]\n", "a")
                .camera.distortion_model,
            DistortionModel::none);
  const Camera fisheye = parse_camera(plain +
                                          "distortion_model: fisheye\n"
                                          "distortion_coefficients: [0.1, 0.2, 0, 0, 0.3, 0.4]\n",
                                      "a")
                             .camera;
  EXPECT_EQ(fisheye.distortion_model, DistortionModel::equidistant);
  EXPECT_EQ(fisheye.distortion, (std::vector<double>{0.1, 0.2, 0.3, 0.4}));
  // Notation of OpenCV's sample.
  const Camera sample =
      parse_camera(plain + "fisheye_model: 1\ndistortion_coefficients: [0.1, 0, 0, 0]\n", "a")
          .camera;
  EXPECT_EQ(sample.distortion_model, DistortionModel::equidistant);
  const Camera tilted =
      parse_camera(plain + "distortion_coefficients: [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0, 0]",
                   "a")
          .camera;
  EXPECT_EQ(tilted.distortion.size(), 12U);
}

TEST(CameraIo, RotationsNearlySoAreMadeExact) {
  const Camera camera =
      parse_camera(plain + "local_transform: [[0, 0, 1, 0.5], [-1.0001, 0, 0, 0], [0, -1, 0, 2]]",
                   "a")
          .camera;
  const Eigen::Matrix3d r = camera.base_from_camera.linear();
  EXPECT_LT((r * r.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
  EXPECT_EQ(camera.base_from_camera.translation(), Eigen::Vector3d(0.5, 0, 2));
}

struct Broken {
  std::string text;
  graspmap_test::ExpectedError expected;
};

TEST(CameraIo, BadFilesAreNamed) {
  const std::vector<Broken> files = {
      {"", {.file = "bad.yaml"}},
      {"[1, 2]", {.file = "bad.yaml"}},
      {"a: [1", {.file = "bad.yaml", .field = "line 1"}},
      {"image_width: 640\n", {.file = "bad.yaml", .field = "image_height"}},
      {"image_width: 640\nimage_height: 480\n", {.file = "bad.yaml", .field = "camera_matrix"}},
      {"image_width: 6.5\nimage_height: 480\n",
       {.file = "bad.yaml", .field = "image_width", .value = "6.5", .bound = ">= 1 and <= 65536"}},
      {"image_width: 1e9\nimage_height: 480\n",
       {.file = "bad.yaml", .field = "image_width", .value = "1e9", .bound = ">= 1 and <= 65536"}},
      {"image_width: -3\nimage_height: 480\n",
       {.file = "bad.yaml", .field = "image_width", .value = "-3", .bound = ">= 1 and <= 65536"}},
      {"image_width: [3]\nimage_height: 480\n", {.file = "bad.yaml", .field = "image_width"}},
      {"image_width: 3\nimage_height: 480\ncamera_matrix: [1, 2]",
       {.file = "bad.yaml", .field = "camera_matrix", .value = "2 numbers", .bound = "3 x 3"}},
      {"image_width: 3\nimage_height: 480\ncamera_matrix: [1, 1, 2, 0, 1, 2, 0, 0, 1]",
       {.file = "bad.yaml", .field = "skew of camera_matrix", .value = "1"}},
      {"image_width: 3\nimage_height: 480\ncamera_matrix: [0, 0, 2, 0, 1, 2, 0, 0, 1]",
       {.file = "bad.yaml", .field = "fx", .value = "0", .bound = "1e-06 to 1e+09"}},
      {"image_width: 3\nimage_height: 480\ncamera_matrix: [1, 0, 2, 0, 1, 2, 0, 0, 2]",
       {.file = "bad.yaml", .field = "camera_matrix"}},
      {"image_width: 3\nimage_height: 4\ncamera_matrix: [1, 0, .nan, 0, 1, 2, 0, 0, 1]",
       {.file = "bad.yaml", .field = "camera_matrix", .value = ".nan"}},
      {"image_width: 3\nimage_height: 4\ncamera_matrix: [1, 0, x, 0, 1, 2, 0, 0, 1]",
       {.file = "bad.yaml", .field = "camera_matrix", .value = "x"}},
      {"image_width: 3\nimage_height: 4\ncamera_matrix: {rows: 3, cols: 3}",
       {.file = "bad.yaml", .field = "camera_matrix.data"}},
      {"image_width: 3\nimage_height: 4\ncamera_matrix: {rows: 3, cols: 3, data: [1]}",
       {.file = "bad.yaml", .field = "camera_matrix.data", .value = "1 numbers"}},
      {plain + "distortion_model: plum_bob\n",
       {.file = "bad.yaml",
        .field = "distortion_model",
        .value = "plum_bob",
        .about = "'plumb_bob'"}},
      {plain + "distortion_coefficients: [1, 2, 3]\n",
       {.file = "bad.yaml",
        .field = "number of distortion terms",
        .value = "3",
        .bound = "4, 5, 8 or 12"}},
      {plain + "distortion_model: equidistant\ndistortion_coefficients: [1, 2, 3, 4, 5]\n",
       {.file = "bad.yaml", .field = "number of distortion terms", .value = "5", .bound = "4"}},
      {plain + "distortion_model: none\ndistortion_coefficients: [1, 2, 3, 4, 5]\n",
       {.file = "bad.yaml", .field = "distortion_coefficients"}},
      {plain + "local_transform: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0]\n",
       {.file = "bad.yaml",
        .field = "local_transform, rotation error",
        .value = "2",
        .bound = "<= 0.001"}},
      {plain + "local_transform: [1, 0, 0]\n",
       {.file = "bad.yaml",
        .field = "local_transform",
        .value = "3 numbers",
        .bound = "3 x 4 or 4 x 4"}}};
  for (const Broken& broken : files) {
    const libmap::Error error = error_of([&] { parse_camera(broken.text, "bad.yaml"); });
    EXPECT_TRUE(is_error(error, broken.expected)) << broken.text;
  }
}

TEST(CameraIo, TimingMotionsAndScaleAreReadBackAsWritten) {
  libmap::CameraFile file = parse_camera(plain, "a");
  file.depth.scale = 1.0081;
  file.depth_delay_s = 0.0103;
  file.rolling_shutter_s = 0.02;
  file.findings = {"depth: \"bent\", corrected", "scale x 1.0081"};
  file.motions = {{1.5, {0.1, 0.2, 0.3}, {0.4, 0.5, 0.6}}, {2.5, {1, 2, 3}, {-1, 0, 0.25}}};
  const libmap::CameraFile read = parse_camera(libmap::to_yaml(file), "a");
  EXPECT_EQ(read.depth.scale, 1.0081);
  EXPECT_EQ(read.depth_delay_s, 0.0103);
  EXPECT_EQ(read.rolling_shutter_s, 0.02);
  EXPECT_EQ(read.findings, file.findings);
  ASSERT_EQ(read.motions.size(), 2U);
  EXPECT_EQ(read.motions[1].stamp_s, 2.5);
  EXPECT_EQ(read.motions[1].velocity, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(read.motions[1].turn_rate, Eigen::Vector3d(-1, 0, 0.25));
  EXPECT_TRUE(read.changes_depth());
  // Depth of the second frame is taken 10.3 ms later: the base has gone 1, 2, 3 m/s on.
  const libmap::Pose base_from_camera = read.camera.base_from_camera;
  const libmap::Pose base_motion =
      base_from_camera * read.color_from_depth_at(2.5) * base_from_camera.inverse();
  EXPECT_LT((base_motion.translation() - 0.0103 * Eigen::Vector3d(1, 2, 3)).norm(), 1e-12);
  EXPECT_TRUE(read.color_from_depth_at(2.0).matrix().isIdentity(0.0)) << "no such frame";
  const auto refuses = [](const std::string& text, const std::string& field) {
    EXPECT_EQ(error_of([&] { parse_camera(plain + text, "a"); }).context().field, field);
  };
  refuses("depth_scale: 3\n", "depth_scale");
  refuses("findings: bent\n", "findings");
  refuses("findings: [[bent]]\n", "findings");
  refuses("camera_timing: [1]\n", "camera_timing");
  refuses("camera_timing: [11, 0]\n", "camera_timing");
  refuses("frame_motions: [1, 2, 3]\n", "frame_motions");
  refuses("frame_motions: [2, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0]\n", "frame_motions");
}

TEST(CameraIo, HugeListsEndEarly) {
  std::string text = "image_width: 3\nimage_height: 4\ncamera_matrix: [1";
  for (int n = 0; n < 10000; ++n) text += ", 1";
  EXPECT_TRUE(is_error(error_of([&] { parse_camera(text + "]", "a"); }),
                       {.file = "a", .field = "camera_matrix"}));
}

}  // namespace camera_io_test
