#include <gtest/gtest.h>

#include <cmath>

#include "libmap/camera/image_codec.h"
#include "libmap/io/cloud_io.h"
#include "libmap/scan/rig_io.h"
#include "tests/tools/tool_test_support.h"

namespace panorama_test {

namespace fs = std::filesystem;
using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::ended_with;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::warned;

constexpr int width = 48;
constexpr int height = 27;

// Six cameras in the middle of a room with walls 1 m away, a prism of six sides.
libmap::CameraRig rig() {
  libmap::CameraRig cameras;
  for (int n = 0; n < 6; ++n) {
    libmap::RigCamera camera;
    camera.name = "camera_" + std::to_string(n);
    camera.camera.width = width;
    camera.camera.height = height;
    camera.camera.fx = camera.camera.fy = 25;
    camera.camera.cx = 23.5;
    camera.camera.cy = 13;
    camera.camera.base_from_camera = libmap::make_pose_from_rpy({0, 0, 0}, {0, 0, 60.0 * n}) *
                                     libmap::make_pose_from_rpy({0.2, 0, 0}, {0, 0, 0}) *
                                     libmap::optical_to_body_rotation();
    camera.depth_scale_m = 0.0005;
    camera.near_m = 0.28;
    camera.far_m = 1.5;
    cameras.cameras.push_back(camera);
  }
  return cameras;
}

void write_image(const std::string& camera, double stamp_s, std::uint16_t units = 1600) {
  const fs::path file = scratch("run") / libmap::rig_image_name(camera, stamp_s);
  fs::create_directories(file.parent_path());
  graspmap_test::write_text(file,
                            libmap::encode_png(libmap::Image<std::uint16_t>(width, height, units)));
}

void write_run() {
  for (int n = 0; n < 6; ++n) write_image("camera_" + std::to_string(n), 12.0 + 0.003 * n);
  graspmap_test::write_text(scratch("run") / "rig.yaml", to_yaml(rig()));
}

TEST(PanoramaCommand, WallsOfARoom) {
  write_run();
  ASSERT_TRUE(succeeded(graspmap({"fuse", "run", "-o", "cloud.pcd"})));
  const libmap::PointCloud cloud = libmap::read_cloud(scratch("cloud.pcd")).cloud;
  ASSERT_EQ(cloud.size(), 6U * width * height);
  const std::vector<double>& camera = cloud.find_field("camera")->values;
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    // 1600 units of 0.5 mm from a camera 0.2 m off the center: 1 m along the wall's normal.
    const double angle = camera[n] * M_PI / 3;
    ASSERT_NEAR(cloud.positions[n].dot(Eigen::Vector3d(std::cos(angle), std::sin(angle), 0)), 1.0,
                1e-6);
  }
  const nlohmann::json manifest = json_of("cloud.pcd.json");
  EXPECT_EQ(manifest.at("frame"), "robot");
  EXPECT_EQ(manifest.at("results").at("cameras_seen"), 6);
  EXPECT_EQ(manifest.at("results").at("camera_5.points"), width * height);
  EXPECT_EQ(manifest.at("inputs").size(), 7U);
}

TEST(PanoramaCommand, SameBytesForAnyThreads) {
  write_run();
  ASSERT_TRUE(succeeded(graspmap({"fuse", "run", "-o", "a.pcd", "--normals", "--threads", "1"})));
  ASSERT_TRUE(succeeded(graspmap({"fuse", "run", "-o", "b.pcd", "--normals", "--threads", "3"})));
  EXPECT_EQ(content("a.pcd"), content("b.pcd"));
}

TEST(PanoramaCommand, LateAndMissingCamerasAreNamed) {
  write_run();
  fs::remove_all(scratch("run") / "camera_2");
  fs::remove_all(scratch("run") / "camera_4");
  write_image("camera_4", 12.055);
  const auto result = graspmap({"fuse", "run", "-o", "cloud.pcd"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_TRUE(warned(result, {"camera_2"}));
  EXPECT_TRUE(warned(result, {"camera_4", " ms "}));
  EXPECT_EQ(json_of("cloud.pcd.json").at("results").at("camera_2.state"), "missing");
  ASSERT_TRUE(succeeded(graspmap({"fuse", "run", "-o", "cloud.pcd", "--tolerance", "0.06"})));
  EXPECT_EQ(json_of("cloud.pcd.json").at("results").at("cameras_seen"), 5);
  EXPECT_TRUE(bad_input(graspmap({"fuse", "run", "-o", "c.pcd", "--strict"}),
                        {.file = "run", .about = "camera_2"}));
  EXPECT_FALSE(fs::exists(scratch("c.pcd")));
}

TEST(PanoramaCommand, MomentsAreChosen) {
  write_run();
  write_image("camera_0", 20.0, 2000);
  ASSERT_TRUE(succeeded(graspmap({"fuse", "run", "-o", "cloud.pcd", "--stamp", "20.01"})));
  const libmap::PointCloud cloud = libmap::read_cloud(scratch("cloud.pcd")).cloud;
  ASSERT_EQ(cloud.size(), static_cast<std::size_t>(width * height));
  EXPECT_NEAR(cloud.positions[0].x(), 1.2, 1e-6);
  EXPECT_TRUE(bad_input(graspmap({"fuse", "run", "-o", "c.pcd", "--stamp", "15"}),
                        {.file = "run", .field = "--stamp", .value = "15"}));
  EXPECT_TRUE(bad_input(graspmap({"fuse", "run", "-o", "c.pcd", "--stamp", "noon"}),
                        {.field = "--stamp", .value = "noon"}));
}

TEST(PanoramaCommand, OwnRigAndTable) {
  write_run();
  fs::rename(scratch("run") / "rig.yaml", scratch("own.yaml"));
  fs::rename(scratch("run") / "camera_1", scratch("run") / "pictures");
  graspmap_test::write_text(scratch("run") / "images.csv",
                            "camera,stamp_s,file\ncamera_1,5,pictures/12.003000.png\n");
  ASSERT_TRUE(succeeded(graspmap({"fuse", "run", "--rig", "own.yaml", "-o", "cloud.pcd"})));
  EXPECT_EQ(json_of("cloud.pcd.json").at("results").at("stamp_s"), 5.0);
  EXPECT_EQ(json_of("cloud.pcd.json").at("results").at("points"), width * height);
}

TEST(PanoramaCommand, ShippedRigsGoByTheirNames) {
  // The shipped rig's own images, 1 m away, level.
  for (const char* camera : {"front", "rear"}) {
    const fs::path file = scratch("run") / libmap::rig_image_name(camera, 3.0);
    fs::create_directories(file.parent_path());
    graspmap_test::write_text(file,
                              libmap::encode_png(libmap::Image<std::uint16_t>(640, 360, 1000)));
  }
  ASSERT_TRUE(succeeded(graspmap({"fuse", "run", "--rig", "scar-e", "-o", "cloud.pcd"})));
  const nlohmann::json manifest = json_of("cloud.pcd.json");
  EXPECT_EQ(manifest.at("results").at("cameras"), 6);
  EXPECT_EQ(manifest.at("results").at("points"), 2 * 640 * 360);
  EXPECT_EQ(manifest.at("inputs").at(0).at("path"), "rigs/scar-e.yaml");
  EXPECT_TRUE(bad_input(graspmap({"fuse", "run", "--rig", "scare", "-o", "c.pcd"}),
                        {.field = "rig", .value = "scare", .about = "'scar-e'"}));
}

TEST(PanoramaCommand, BrokenImageCostsItsCameraAlone) {
  write_run();
  const std::string image = "run/" + libmap::rig_image_name("camera_3", 12.009);
  graspmap_test::write_text(scratch(image), content(image).substr(0, 60));
  const graspmap_test::ProgramResult result = graspmap({"fuse", "run", "-o", "cloud.pcd"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_TRUE(warned(result, {image}));
  EXPECT_EQ(json_of("cloud.pcd.json").at("results").at("cameras_seen"), 5);
}

TEST(PanoramaCommand, BrokenImagesOfAllCamerasAreAnError) {
  write_run();
  for (int n = 0; n < 6; ++n)
    graspmap_test::write_text(
        scratch("run") / libmap::rig_image_name("camera_" + std::to_string(n), 12.0 + 0.003 * n),
        "no image");
  const graspmap_test::ProgramResult result = graspmap({"fuse", "run", "-o", "cloud.pcd"});
  EXPECT_TRUE(ended_with(result, {.file = "run"}));
  EXPECT_TRUE(warned(result, {"camera_5"}));
  EXPECT_FALSE(fs::exists(scratch("cloud.pcd")));
}

TEST(PanoramaCommand, BadInputIsOneLineAndLeavesNothing) {
  write_run();
  const auto run = [](const std::string& folder) {
    return graspmap({"fuse", folder, "-o", "cloud.pcd"});
  };
  const auto strict = [](const std::string& folder) {
    return graspmap({"fuse", folder, "-o", "cloud.pcd", "--strict"});
  };
  EXPECT_TRUE(bad_input(run("none"), {.file = "none"}));
  EXPECT_TRUE(bad_input(run("run/rig.yaml"), {.file = "run/rig.yaml"}));
  EXPECT_TRUE(bad_input(graspmap({"fuse", "run", "-o", "cloud.xyz"}),
                        {.file = "cloud.xyz",
                         .field = "extension",
                         .value = ".xyz",
                         .bound = ".pcd, .ply, .csv or .vtp"}));
  EXPECT_TRUE(
      bad_input(graspmap({"fuse", "run", "-o", "c.pcd", "--rig", "no.yaml"}), {.file = "no.yaml"}));
  const std::string image = "run/" + libmap::rig_image_name("camera_3", 12.009);
  const std::string whole = content(image);
  for (const auto& [length, fault] :
       {std::pair{0U, "PNG"}, {20U, "20 bytes"}, {60U, "ends too early"}}) {
    graspmap_test::write_text(scratch(image), whole.substr(0, length));
    EXPECT_TRUE(bad_input(strict("run"), {.file = image, .about = fault})) << length;
  }
  graspmap_test::write_text(scratch(image), libmap::encode_png(libmap::GrayImage(width, height)));
  EXPECT_TRUE(bad_input(strict("run"), {.file = image,
                                        .bound = "a PNG of 1 x 16 bits per pixel",
                                        .about = "PNG of 1 x 8 bits per pixel"}));
  graspmap_test::write_text(scratch(image), libmap::encode_png(libmap::Image<std::uint16_t>(8, 8)));
  EXPECT_TRUE(bad_input(
      strict("run"), {.file = image, .field = "image size", .value = "8 x 8", .bound = "48 x 27"}));
  graspmap_test::write_text(scratch("run") / "rig.yaml", "cameras: []\n");
  EXPECT_TRUE(bad_input(run("run"), {.file = "run/rig.yaml", .field = "cameras"}));
  EXPECT_FALSE(fs::exists(scratch("cloud.pcd")));
}

}  // namespace panorama_test
