#include "libmap/scan/frame_folder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "libmap/camera/camera_io.h"
#include "libmap/camera/depth_codec.h"
#include "libmap/camera/image_codec.h"
#include "libmap/scan/frame_folder_writer.h"
#include "libmap/scan/rtabmap_reader.h"
#include "tests/libmap/scan/example_scan.h"
#include "tests/support/test_support.h"

namespace frame_folder_test {

namespace fs = std::filesystem;
using graspmap_test::ExampleScan;
using graspmap_test::write_text;
using libmap::FrameFolder;
using libmap::Pose;

fs::path new_folder(const std::string& name = "scan") {
  const fs::path folder = graspmap_test::scratch_folder() / name;
  fs::create_directories(folder);
  return folder;
}

libmap::FrameFolderCounts write_scan(const fs::path& folder, const ExampleScan& scan) {
  libmap::FrameFolderWriter writer(folder);
  for (const auto& [id, frame] : scan.frames) writer.add_frame(frame);
  return writer.finish(scan.graph);
}

TEST(FrameFolder, GivesBackWhatWasWritten) {
  const ExampleScan scan = graspmap_test::example_scan();
  const fs::path folder = new_folder();
  const libmap::FrameFolderCounts counts = write_scan(folder, scan);
  EXPECT_EQ(counts.color_images, 4U);
  EXPECT_EQ(counts.depth_images, 4U);
  EXPECT_EQ(counts.right_images, 0U);
  EXPECT_EQ(counts.calibrations, 4U);
  EXPECT_EQ(counts.associations, 4U);
  const FrameFolder read(folder);
  EXPECT_EQ(read.warnings(), std::vector<std::string>());
  // Poses are stored as quaternions: not exact to the last digit of float32.
  graspmap_test::expect_same_graph(read.graph(), scan.graph, 2e-7);
  for (const auto& [id, frame] : scan.frames) {
    SCOPED_TRACE("node " + std::to_string(id));
    graspmap_test::expect_same_frame(read.read_frame(id), frame);
  }
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const auto& names = libmap::frame_folder_names();
    EXPECT_EQ(std::count(names.begin(), names.end(), entry.path().filename().string()), 1)
        << entry.path();
  }
}

TEST(FrameFolder, KeepsOneFileForACameraOfManyNodes) {
  ExampleScan scan = graspmap_test::example_scan();
  for (auto& [id, frame] : scan.frames) frame.cameras = scan.frames.at(1).cameras;
  EXPECT_EQ(write_scan(new_folder(), scan).calibrations, 1U);
}

TEST(FrameFolder, KeepsStoredImageFilesByteForByte) {
  ExampleScan scan = graspmap_test::example_scan();
  libmap::RgbdFrame& frame = scan.frames.at(1);
  const std::string jpeg = libmap::encode_jpeg(frame.color, 60);
  const fs::path folder = new_folder();
  libmap::FrameFolderWriter writer(folder);
  writer.add_frame(frame, {.color = jpeg});
  writer.finish(scan.graph);
  EXPECT_EQ(graspmap_test::read_text(folder / "color/000001.jpg"), jpeg);
  EXPECT_TRUE(FrameFolder(folder).read_frame(1).color == libmap::decode_color(jpeg));
  // The other nodes have no images.
  const libmap::RgbdFrame empty = FrameFolder(folder).read_frame(2);
  EXPECT_TRUE(empty.color.empty());
  EXPECT_TRUE(empty.depth.empty());
  EXPECT_TRUE(empty.cameras.empty());
}

TEST(FrameFolder, KeepsSeveralCamerasAndStereoPairs) {
  ExampleScan scan = graspmap_test::example_scan();
  scan.frames.at(1).cameras = {graspmap_test::example_camera(20, 30),
                               graspmap_test::example_camera(20, 30)};
  libmap::RgbdFrame& stereo = scan.frames.at(2);
  stereo.cameras.clear();
  stereo.depth = {};
  stereo.right = libmap::GrayImage(40, 30, 9);
  for (const double baseline_m : {0.12, 0.0625})
    stereo.stereo.push_back({.left = graspmap_test::example_camera(20, 30),
                             .right = graspmap_test::example_camera(20, 30),
                             .baseline_m = baseline_m});
  for (const libmap::StereoCamera& pair : stereo.stereo) stereo.cameras.push_back(pair.left);
  const fs::path folder = new_folder();
  EXPECT_EQ(write_scan(folder, scan).right_images, 1U);
  const FrameFolder read(folder);
  graspmap_test::expect_same_frame(read.read_frame(1), scan.frames.at(1));
  const libmap::RgbdFrame pair = read.read_frame(2);
  graspmap_test::expect_same_frame(pair, stereo);
  ASSERT_EQ(pair.stereo.size(), 2U);
  EXPECT_EQ(pair.stereo[1].baseline_m, 0.0625);
  EXPECT_EQ(pair.stereo[1].right_from_left.translation(), Eigen::Vector3d(-0.0625, 0, 0));
  graspmap_test::expect_same_camera(pair.stereo[1].right, stereo.stereo[1].right);
}

TEST(FrameFolder, KeepsNodesOfTheSameStampApart) {
  ExampleScan scan = graspmap_test::example_scan();
  for (libmap::GraphNode& node : scan.graph.nodes) node.stamp_s = 5.0;
  for (auto& [id, frame] : scan.frames) frame.stamp_s = 5.0;
  const fs::path folder = new_folder();
  write_scan(folder, scan);
  graspmap_test::expect_same_graph(FrameFolder(folder).graph(), scan.graph, 2e-7);
}

// A node without a pose does not get the pose of its neighbor in time.
TEST(FrameFolder, KeepsNodesOfNearStampsApart) {
  ExampleScan scan = graspmap_test::example_scan();
  double stamp_s = 5.0;
  for (libmap::GraphNode& node : scan.graph.nodes) {
    node.stamp_s = stamp_s += 0.01;
    scan.frames.at(node.id).stamp_s = stamp_s;
  }
  scan.graph.nodes[1].odometry_from_base.reset();
  const fs::path folder = new_folder();
  write_scan(folder, scan);
  EXPECT_FALSE(FrameFolder(folder).graph().nodes[1].odometry_from_base.has_value());
}

TEST(FrameFolder, ReadsOnlyThePartsThatAreAskedFor) {
  const ExampleScan scan = graspmap_test::example_scan();
  const fs::path folder = new_folder();
  write_scan(folder, scan);
  fs::remove(folder / "depth/000005.png");
  const FrameFolder read(folder);
  const libmap::RgbdFrame color = read.read_frame(5, {.color = true, .depth = false});
  EXPECT_FALSE(color.color.empty());
  EXPECT_TRUE(color.depth.empty());
  EXPECT_EQ(color.cameras.size(), 1U);
  const libmap::Error error = graspmap_test::error_of([&] { read.read_frame(5); });
  EXPECT_EQ(error.context().file, (folder / "depth/000005.png").string());
  EXPECT_EQ(error.context().field, "node 5: depth");
}

// A folder in the TUM benchmark's layout: images of other times and names, poses of the camera.
class TumFolder : public testing::Test {
 protected:
  fs::path folder_ = new_folder();
  libmap::Camera camera_ = graspmap_test::example_camera(40, 30);
  std::map<std::string, libmap::MillimeterImage> depth_;

  void SetUp() override {
    for (const char* name : {"rgb", "depth"}) fs::create_directory(folder_ / name);
    write_text(folder_ / "calibration.yaml", to_yaml(libmap::CameraFile{.camera = camera_}));
  }

  void write_color(const std::string& name) {
    write_text(folder_ / "rgb" / name, libmap::encode_png(graspmap_test::random_color(40, 30)));
  }

  void write_depth(const std::string& name) {
    libmap::MillimeterImage units(40, 30);
    for (std::uint16_t& unit : units.pixels)
      unit = static_cast<std::uint16_t>(graspmap_test::uniform(0.0, 65535.0));
    units.pixels[0] = 65535;
    write_text(folder_ / "depth" / name, libmap::encode_png(units));
    depth_[name] = units;
  }

  void write_pair() {
    write_color("1.png");
    write_depth("1.png");
  }
};

TEST_F(TumFolder, PairsListsOfImagesByTime) {
  for (const char* name : {"a.png", "b.png", "c.png"}) write_color(name);
  for (const char* name : {"x.png", "y.png", "z.png"}) write_depth(name);
  write_text(folder_ / "rgb.txt",
             "# color images\n# file: 'x.bag'\n# timestamp filename\n"
             "1305031102.175304 rgb/a.png\n1305031102.211214 rgb/b.png\n"
             "1305031103.000000 rgb/c.png\n");
  write_text(folder_ / "depth.txt",
             "# depth maps\n1305031102.226738 depth/y.png\n1305031102.160407 depth/x.png\n"
             "1305031102.526330 depth/z.png\n");
  const FrameFolder read(folder_);
  ASSERT_EQ(read.graph().nodes.size(), 2U);
  EXPECT_EQ(read.graph().nodes[0].id, 1);
  EXPECT_EQ(read.graph().nodes[0].stamp_s, 1305031102.160407);
  EXPECT_EQ(read.graph().nodes[1].stamp_s, 1305031102.226738);
  ASSERT_EQ(read.warnings().size(), 2U);
  EXPECT_TRUE(read.warnings()[0].starts_with("skipped 1 depth image "));
  EXPECT_TRUE(read.warnings()[1].starts_with("skipped 1 color image "));
  EXPECT_NEAR(read.read_frame(1).depth_stamp_offset_s, 1102.160407 - 1102.175304, 1e-6);
  const libmap::RgbdFrame frame = read.read_frame(2);
  EXPECT_NEAR(frame.depth_stamp_offset_s, 1102.226738 - 1102.211214, 1e-6);
  EXPECT_TRUE(frame.color == libmap::decode_color(graspmap_test::read_text(folder_ / "rgb/b.png")));
  ASSERT_EQ(frame.cameras.size(), 1U);
  graspmap_test::expect_same_camera(frame.cameras[0], camera_);
  // 5000 units per meter; 65535 is not a measurement.
  const libmap::MillimeterImage& units = depth_.at("y.png");
  EXPECT_EQ(frame.depth.pixels[0], 0.0F);
  for (std::size_t i = 1; i < units.pixels.size(); ++i)
    EXPECT_FLOAT_EQ(frame.depth.pixels[i], static_cast<float>(units.pixels[i]) / 5000.0F);
}

// The arrival stamps jitter by 8 ms; the phase of the two cameras is 5 ms, then -16 ms.
TEST_F(TumFolder, SmoothsTheDelayOfDepthByItsStamps) {
  write_pair();
  std::string color;
  std::string depth;
  for (int n = 0; n < 40; ++n) {
    const double phase_s = n < 20 ? 0.005 : -0.016;
    color += std::to_string(0.07 * n) + " rgb/1.png\n";
    depth += std::to_string(0.07 * n + phase_s + (n % 3 == 0 ? 0.008 : 0.0)) + " depth/1.png\n";
  }
  write_text(folder_ / "rgb.txt", color);
  write_text(folder_ / "depth.txt", depth);
  const FrameFolder read(folder_);
  ASSERT_EQ(read.graph().nodes.size(), 40U);
  for (int n = 0; n < 40; ++n)
    EXPECT_NEAR(read.read_frame(n + 1).depth_stamp_offset_s, n < 20 ? 0.005 : -0.016, 1e-5) << n;
}

TEST_F(TumFolder, TakesAssociationsInEitherOrder) {
  write_pair();
  for (const char* line : {"3.5 rgb/1.png 3.51 depth/1.png", "3.51 depth/1.png 3.5 rgb/1.png"}) {
    SCOPED_TRACE(line);
    write_text(folder_ / "associations.txt", std::string("# comment\n\n") + line + "\n");
    const FrameFolder read(folder_);
    EXPECT_EQ(read.graph().nodes.at(0).stamp_s, 3.51);
    EXPECT_FALSE(read.read_frame(1).color.empty());
    EXPECT_EQ(read.read_frame(1).depth.width, 40);
  }
}

TEST_F(TumFolder, ReadsDepthAlone) {
  write_pair();
  write_text(folder_ / "depth.txt", "3.51 depth/1.png\n");
  const FrameFolder read(folder_);
  EXPECT_TRUE(read.read_frame(1).color.empty());
  EXPECT_FALSE(read.read_frame(1).depth.empty());
}

TEST_F(TumFolder, TurnsPosesOfTheCameraIntoPosesOfTheBase) {
  write_pair();
  write_text(folder_ / "associations.txt", "3.5 rgb/1.png 3.5 depth/1.png\n");
  const Pose world_from_camera = graspmap_test::random_float_pose();
  const Pose world_from_base = world_from_camera * camera_.base_from_camera.inverse();
  const Eigen::Quaterniond q(world_from_camera.linear());
  const Eigen::Vector3d t = world_from_camera.translation();
  std::string line = "3.5";
  for (const double value : {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()})
    line += " " + std::to_string(value);
  write_text(folder_ / "groundtruth.txt", line + "\n");
  const auto truth_of = [&] { return FrameFolder(folder_).graph().nodes.at(0).truth_from_base; };
  ASSERT_TRUE(truth_of());
  EXPECT_TRUE(truth_of()->isApprox(world_from_base, 1e-5));
  write_text(folder_ / "scan.yaml", "pose_frame: base\n");
  EXPECT_TRUE(truth_of()->isApprox(world_from_camera, 1e-5));
}

TEST_F(TumFolder, InterpolatesBetweenPosesThatAreNear) {
  write_pair();
  write_text(folder_ / "associations.txt", "3.5 rgb/1.png 3.5 depth/1.png\n");
  write_text(folder_ / "scan.yaml", "pose_frame: base\n");
  const double s = std::sqrt(0.5);
  const std::string turned = " 4 0 0 0 0 " + std::to_string(s) + " " + std::to_string(s) + "\n";
  const auto odometry_with = [&](const std::string& text) {
    write_text(folder_ / "poses.tum", text);
    return FrameFolder(folder_).graph().nodes.at(0).odometry_from_base;
  };
  // A quarter of the distance, and of the quarter turn.
  const auto between = odometry_with("3.495 0 0 0 0 0 0 1\n3.515" + turned);
  ASSERT_TRUE(between);
  EXPECT_TRUE(between->isApprox(libmap::make_pose_from_rpy({1, 0, 0}, {0, 0, 22.5}), 1e-5));
  const auto nearest = odometry_with("3.485" + turned + "3.6 0 0 0 0 0 0 1\n");
  ASSERT_TRUE(nearest);
  EXPECT_NEAR(nearest->translation().x(), 4.0, 1e-12);
  EXPECT_FALSE(odometry_with("3.47" + turned + "3.53" + turned));
  EXPECT_EQ(FrameFolder(folder_).warnings().size(), 1U);
}

TEST_F(TumFolder, FollowsItsOptions) {
  write_pair();
  write_text(folder_ / "associations.txt", "3.5 rgb/1.png 3.9 depth/1.png\n");
  EXPECT_TRUE(graspmap_test::is_error(graspmap_test::error_of([&] { FrameFolder read(folder_); }),
                                      {.file = folder_, .about = "0.02 s"}));
  fs::rename(folder_ / "calibration.yaml", folder_ / "kinect.yaml");
  write_text(folder_ / "scan.yaml",
             "depth_unit_m: 0.001\ncalibration: kinect.yaml\npairing_tolerance_s: 0.4\n");
  const FrameFolder read(folder_);
  EXPECT_TRUE(read.read_frame(1).depth == libmap::to_meters(depth_.at("1.png")));
  write_text(folder_ / "scan.yaml", "depth_unit: 0.001\n");
  const libmap::Error error = graspmap_test::error_of([&] { FrameFolder again(folder_); });
  EXPECT_EQ(error.context().file, (folder_ / "scan.yaml").string());
  EXPECT_TRUE(graspmap_test::is_error(error, {.field = "depth_unit"}));
}

// A wall at 2 m before a depth camera of half the size, 40 cm to the right: the left of the image
// has no depth.
TEST_F(TumFolder, RegistersADepthCameraToColor) {
  write_color("1.png");
  const libmap::MillimeterImage wall(20, 15, 10000);
  write_text(folder_ / "depth/1.png", libmap::encode_png(wall));
  write_text(folder_ / "associations.txt", "3.5 rgb/1.png 3.5 depth/1.png\n");
  libmap::Camera depth_camera{.width = 20, .height = 15, .fx = 20, .fy = 20, .cx = 9.5, .cy = 7};
  depth_camera.base_from_camera = camera_.base_from_camera * Eigen::Translation3d(0.4, 0, 0);
  write_text(folder_ / "infrared.yaml", to_yaml(libmap::CameraFile{.camera = depth_camera}));
  write_text(folder_ / "scan.yaml", "depth_calibration: infrared.yaml\n");
  const libmap::RgbdFrame frame = FrameFolder(folder_).read_frame(1);
  const libmap::Camera seen_by = libmap::camera_views(frame).front().depth_camera;
  ASSERT_EQ(frame.depth.width, 20);
  ASSERT_EQ(frame.depth.height, 15);
  std::size_t seen = 0;
  for (int x = 0; x < 20; ++x) {
    const auto ray = libmap::pixel_to_ray(seen_by, Eigen::Vector2d(x, 7));
    const auto pixel =
        libmap::project_point(depth_camera, 2.0 * ray->homogeneous() - Eigen::Vector3d(0.4, 0, 0));
    // Except for one pixel of rounding.
    const bool inside = pixel->x() > 0.5 && pixel->x() < 18.5;
    const bool outside = pixel->x() < -1.5 || pixel->x() > 20.5;
    if (inside || outside) {
      EXPECT_FLOAT_EQ(frame.depth.at(x, 7), inside ? 2.0F : 0.0F) << x;
    }
    seen += frame.depth.at(x, 7) > 0.0F;
  }
  EXPECT_GT(seen, 5U);
  EXPECT_LT(seen, 20U);

  depth_camera.width = 40;
  write_text(folder_ / "infrared.yaml", to_yaml(libmap::CameraFile{.camera = depth_camera}));
  const FrameFolder other_size(folder_);
  libmap::Error error = graspmap_test::error_of([&] { other_size.read_frame(1); });
  EXPECT_EQ(error.context().file, (folder_ / "depth/1.png").string());
  EXPECT_EQ(error.context().field, "node 1: depth: size of the depth image");
  EXPECT_EQ(error.context().bound, "40 x 15");
  fs::remove(folder_ / "infrared.yaml");
  error = graspmap_test::error_of([&] { FrameFolder missing(folder_); });
  EXPECT_EQ(error.context().file, (folder_ / "infrared.yaml").string());
}

TEST_F(TumFolder, NamesTheCalibrationThatItMisses) {
  write_pair();
  write_text(folder_ / "depth.txt", "3.51 depth/1.png\n");
  fs::remove(folder_ / "calibration.yaml");
  const libmap::Error error = graspmap_test::error_of([&] { FrameFolder read(folder_); });
  EXPECT_EQ(error.context().file, (folder_ / "calibration.yaml").string());
  EXPECT_TRUE(graspmap_test::is_error(error, {.about = "'calibration'"}));
}

TEST_F(TumFolder, NamesWhatIsBroken) {
  write_pair();
  for (const auto& [file, text] : std::vector<std::pair<std::string, std::string>>{
           {"associations.txt", "\n1.0 rgb/1.png 1.0\n"},
           {"associations.txt", "\none rgb/1.png 1.0 depth/1.png\n"},
           {"depth.txt", "# x\n1.0\n"},
           {"nodes.csv", "node,stamp_s\n\nx,1\n"},
           {"nodes.csv", "node,stamp_s\n1,1\n1,2\n"},
           {"nodes.csv", "node,stamp_s,velocity\n1,1,1 2 3\n"},
           {"nodes.csv", "node,stamp_s,baseline_m\n1,1,0.1\n"},
           {"nodes.csv", "name,stamp_s\n1,1\n"}}) {
    SCOPED_TRACE(text);
    write_text(folder_ / file, text);
    const libmap::Error error = graspmap_test::error_of([&] { FrameFolder read(folder_); });
    EXPECT_EQ(error.context().file, (folder_ / file).string());
    EXPECT_FALSE(error.context().field.empty());
    fs::remove(folder_ / file);
  }
}

TEST_F(TumFolder, RefusesDepthOfAnotherAspectRatio) {
  write_pair();
  write_text(folder_ / "depth.txt", "3.51 depth/1.png\n");
  write_text(folder_ / "depth/1.png", libmap::encode_png(libmap::MillimeterImage(30, 40)));
  const FrameFolder read(folder_);
  const libmap::Error error = graspmap_test::error_of([&] { read.read_frame(1); });
  EXPECT_EQ(error.context().file, (folder_ / "depth/1.png").string());
  EXPECT_EQ(error.context().field, "node 1: depth: size of the depth image");
  EXPECT_EQ(error.context().value, "30 x 40");
  EXPECT_NE(error.context().bound.find("40 x 30"), std::string::npos);
  // Another size of the same aspect ratio within rounding is valid.
  write_text(folder_ / "depth/1.png", libmap::encode_png(libmap::MillimeterImage(53, 40)));
  EXPECT_EQ(read.read_frame(1).depth.width, 53);
}

TEST_F(TumFolder, NamesTheCellThatIsNoNumber) {
  const std::vector<std::pair<std::string, graspmap_test::ExpectedError>> refusals{
      {"node,stamp_s,baseline_m\n1,5,0.1 x\n",
       {.field = "row 1, column baseline_m", .value = "0.1 x"}},
      {"node,stamp_s,gps\n1,5,1 2 3 4 5 inf\n",
       {.field = "row 1, column gps", .value = "1 2 3 4 5 inf"}},
      {"node,stamp_s\n7,5\n0,6\n", {.field = "row 2, column node", .value = "0", .bound = "> 0"}},
      {"node,stamp_s\n1,nan\n", {.field = "row 1, column stamp_s", .value = "nan"}},
      {"node,stamp_s,session\n1,5,2147483648\n",
       {.field = "row 1, column session",
        .value = "2147483648",
        .bound = "a whole number of 32 bits"}},
      {"node,stamp_s,session\n1,5,-9223372036854775808\n",
       {.field = "row 1, column session",
        .value = "-9223372036854775808",
        .bound = "a whole number of 32 bits"}}};
  for (const auto& [text, expected] : refusals) {
    write_text(folder_ / "nodes.csv", text);
    const libmap::Error error = graspmap_test::error_of([&] { FrameFolder read(folder_); });
    EXPECT_EQ(error.context().file, (folder_ / "nodes.csv").string());
    EXPECT_TRUE(graspmap_test::is_error(error, expected));
  }
}

TEST_F(TumFolder, DropsLinksOfMissingNodes) {
  write_pair();
  write_text(folder_ / "nodes.csv", "node,stamp_s\n3,1\n4,2\n");
  const std::string rest = " 0 0 0 0 0 0 1 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";
  write_text(folder_ / "links.g2o", "EDGE_SE3:QUAT 3 4" + rest + "EDGE_SE3:QUAT 4 5" + rest);
  EXPECT_EQ(FrameFolder(folder_).graph().links.size(), 0U);  // poses of cameras
  write_text(folder_ / "scan.yaml", "pose_frame: base\n");
  const FrameFolder read(folder_);
  EXPECT_EQ(read.graph().links.size(), 1U);
  ASSERT_EQ(read.warnings().size(), 1U);
  EXPECT_TRUE(graspmap_test::is_error_text(read.warnings()[0],
                                           {.file = "links.g2o", .about = "1 link to or from"}));
}

TEST_F(TumFolder, DropsLinksOfANodeToItself) {
  write_pair();
  write_text(folder_ / "nodes.csv", "node,stamp_s\n3,1\n4,2\n");
  const std::string rest = " 0 0 0 0 0 0 1 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";
  write_text(folder_ / "links.g2o", "EDGE_SE3:QUAT 3 4" + rest + "EDGE_SE3:QUAT 4 4" + rest);
  write_text(folder_ / "scan.yaml", "pose_frame: base\n");
  const FrameFolder read(folder_);
  EXPECT_EQ(read.graph().links.size(), 1U);
  ASSERT_EQ(read.warnings().size(), 1U);
  EXPECT_TRUE(graspmap_test::is_error_text(read.warnings()[0], {.file = "links.g2o"}));
}

TEST(FrameFolderError, OfFoldersThatAreNoScan) {
  const fs::path folder = new_folder();
  const libmap::Error error = graspmap_test::error_of([&] { libmap::open_scan(folder); });
  EXPECT_EQ(error.context().file, folder.string());
  EXPECT_TRUE(graspmap_test::is_error(error, {.file = "scan"}));
  EXPECT_TRUE(
      graspmap_test::is_error(graspmap_test::error_of([&] { FrameFolder(folder / "missing"); }),
                              {.file = folder / "missing"}));
}

TEST(FrameFolderError, OfNodesThatAreNotThere) {
  const fs::path folder = new_folder();
  write_scan(folder, graspmap_test::example_scan());
  const FrameFolder read(folder);
  EXPECT_TRUE(graspmap_test::is_error(graspmap_test::error_of([&] { read.read_frame(4); }),
                                      {.file = folder, .field = "node", .value = "4"}));
}

TEST(FrameFolderError, OfFoldersThatCannotBeMade) {
  const fs::path folder = new_folder();
  write_text(folder / "color", "a file");
  for (const fs::path& place : {folder, folder / "missing"}) {
    const libmap::Error error =
        graspmap_test::error_of([&] { libmap::FrameFolderWriter writer(place); });
    EXPECT_EQ(error.context().file, (place / "color").string());
    EXPECT_TRUE(
        graspmap_test::is_error(error, {.file = "color", .kind = libmap::ErrorKind::failed}))
        << error.what();
    EXPECT_EQ(error.kind(), libmap::ErrorKind::failed);
  }
}

TEST(FrameFolder, HoldsARealScan) {
  GRASPMAP_REQUIRE_DATA();
  const libmap::RtabmapDatabase database(graspmap_test::data_folder() / "scans/site_tiny.db");
  const fs::path folder = new_folder();
  libmap::FrameFolderWriter writer(folder);
  for (const libmap::GraphNode& node : database.graph().nodes)
    writer.add_frame(database.read_frame(node.id), {.color = database.read_blobs(node.id).image});
  writer.finish(database.graph());
  const auto read = libmap::open_scan(folder);
  graspmap_test::expect_same_graph(read->graph(), database.graph(), 1e-14);
  for (const libmap::GraphNode& node : database.graph().nodes)
    graspmap_test::expect_same_frame(read->read_frame(node.id), database.read_frame(node.id));
}

}  // namespace frame_folder_test
