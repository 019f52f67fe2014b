#include "libmap/scan/rig_io.h"

#include <gtest/gtest.h>

#include "libmap/camera/camera_io.h"
#include "tests/support/test_support.h"

namespace rig_io_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::scratch_folder;
using libmap::CameraRig;
using libmap::parse_rig;

// The thesis's six cameras, 60 degrees apart, 20 cm from the robot's center.
CameraRig six_cameras() {
  CameraRig rig;
  for (int n = 0; n < 6; ++n) {
    libmap::RigCamera camera;
    camera.name = "camera_" + std::to_string(n);
    camera.camera.width = 640;
    camera.camera.height = 360;
    camera.camera.fx = 337.2 + n / 3.0;
    camera.camera.fy = 338.5;
    camera.camera.cx = 319.5;
    camera.camera.cy = 179.5;
    camera.camera.distortion_model = libmap::DistortionModel::radial_tangential;
    camera.camera.distortion = {0.1, -0.2, 0.001, 0.0, 1.0 / 3};
    camera.camera.base_from_camera = libmap::make_pose_from_rpy({0, 0, 0}, {0, 0, 60.0 * n}) *
                                     libmap::make_pose_from_rpy({0.2, 0, 0}, {0, 30, 0}) *
                                     libmap::optical_to_body_rotation();
    camera.depth_scale_m = 0.001 / (n + 1);
    camera.near_m = 0.28;
    if (n % 2 == 0) camera.far_m = 1.5;
    rig.cameras.push_back(camera);
  }
  return rig;
}

TEST(RigIo, ReadsBackBitForBit) {
  const CameraRig rig = six_cameras();
  const CameraRig back = parse_rig(to_yaml(rig), "rig.yaml");
  ASSERT_EQ(back.cameras.size(), 6U);
  for (std::size_t n = 0; n < 6; ++n) {
    const libmap::RigCamera& a = rig.cameras[n];
    const libmap::RigCamera& b = back.cameras[n];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.camera.fx, b.camera.fx);
    EXPECT_EQ(a.camera.distortion, b.camera.distortion);
    EXPECT_EQ(a.camera.base_from_camera.matrix(), b.camera.base_from_camera.matrix());
    EXPECT_EQ(a.depth_scale_m, b.depth_scale_m);
    EXPECT_EQ(a.near_m, b.near_m);
    EXPECT_EQ(a.far_m, b.far_m);
  }
}

const std::string intrinsics =
    "    image_width: 640\n    image_height: 360\n"
    "    camera_matrix: [337.2, 0, 319.5, 0, 337.2, 179.5, 0, 0, 1]\n";

TEST(RigIo, PosesByMatrixByHousingAndByCalibration) {
  libmap::CameraFile file;
  file.camera = six_cameras().cameras[3].camera;
  graspmap_test::write_text(scratch_folder() / "own.yaml", to_yaml(file));
  const std::string text =
      "depth_scale_m: 0.00025\nnear_m: 0.28\nfar_m: .inf\ncameras:\n"
      "  - name: front\n" +
      intrinsics +
      "    robot_from_camera: [0, 0, 1, 0.2, -1, 0, 0, 0, 0, -1, 0, 0.1]\n"
      "  - name: left\n" +
      intrinsics +
      "    position_m: [0.1, 0.17, 0.1]\n    roll_pitch_yaw_deg: [0, 0, 90]\n"
      "    far_m: 2\n    depth_scale_m: 0.001\n"
      "  - name: own\n    calibration: own.yaml\n";
  const CameraRig rig = parse_rig(text, (scratch_folder() / "rig.yaml").string());
  ASSERT_EQ(rig.cameras.size(), 3U);
  EXPECT_EQ(rig.cameras[0].depth_scale_m, 0.00025);
  EXPECT_TRUE(std::isinf(rig.cameras[0].far_m));
  EXPECT_EQ(rig.cameras[1].far_m, 2.0);
  EXPECT_EQ(rig.cameras[1].near_m, 0.28);
  EXPECT_EQ(rig.cameras[1].depth_scale_m, 0.001);
  // A meter ahead of each camera: ahead of the robot, and to its left.
  const Eigen::Vector3d ahead(0, 0, 1);
  EXPECT_LT((rig.cameras[0].camera.base_from_camera * ahead - Eigen::Vector3d(1.2, 0, 0.1)).norm(),
            1e-12);
  EXPECT_LT(
      (rig.cameras[1].camera.base_from_camera * ahead - Eigen::Vector3d(0.1, 1.17, 0.1)).norm(),
      1e-12);
  EXPECT_EQ(rig.cameras[2].camera.base_from_camera.matrix(), file.camera.base_from_camera.matrix());
  EXPECT_EQ(rig.cameras[2].camera.distortion, file.camera.distortion);
}

TEST(RigIo, BadFilesNameCameraAndKey) {
  const std::string head = "cameras:\n  - name: front\n" + intrinsics;
  const std::string pose = "    robot_from_camera: [0, 0, 1, 0, -1, 0, 0, 0, 0, -1, 0, 0]\n";
  const std::vector<std::pair<std::string, graspmap_test::ExpectedError>> files = {
      {"", {.file = "bad.yaml"}},
      {"cameras: []", {.file = "bad.yaml", .field = "cameras"}},
      {"cameras: 3", {.file = "bad.yaml", .field = "cameras"}},
      {"camera: []", {.file = "bad.yaml", .field = "camera", .about = "'cameras'"}},
      {head, {.file = "bad.yaml", .field = "cameras[0] (front).robot_from_camera"}},
      {head + "    near: 1\n" + pose,
       {.file = "bad.yaml", .field = "cameras[0] (front).near", .about = "'near_m'"}},
      {head + pose + "    position_m: [0, 0, 0]\n",
       {.file = "bad.yaml", .field = "cameras[0] (front).robot_from_camera"}},
      {head + "    position_m: [0, 0]\n",
       {.file = "bad.yaml", .field = "cameras[0] (front).position_m"}},
      {head + "    position_m: [0, 0, a]\n",
       {.file = "bad.yaml", .field = "cameras[0] (front).position_m", .value = "a"}},
      {head + "    robot_from_camera: [1, 2, 3]\n",
       {.file = "bad.yaml",
        .field = "cameras[0] (front).robot_from_camera",
        .value = "3 numbers",
        .bound = "3 x 4 or 4 x 4"}},
      {head + pose + "    near_m: 2\n    far_m: 1\n",
       {.file = "bad.yaml", .field = "front: far_m", .value = "1"}},
      {head + pose + "    near_m: -1\n",
       {.file = "bad.yaml", .field = "front: near_m", .value = "-1", .bound = ">= 0"}},
      {head + pose + "    depth_scale_m: 0\n",
       {.file = "bad.yaml", .field = "front: depth_scale_m", .value = "0", .bound = "> 0"}},
      {head + pose + head.substr(9) + pose,
       {.file = "bad.yaml", .field = "name", .value = "front"}},
      {head + pose + "    near_m: 1\n    near_m: 1\n",
       {.file = "bad.yaml", .field = "cameras[0] (front).near_m"}},
      {"cameras:\n  - name: a/b\n" + intrinsics + pose,
       {.file = "bad.yaml", .field = "name", .value = "a/b"}},
      {"cameras:\n  - name: ..\n" + intrinsics + pose,
       {.file = "bad.yaml", .field = "name", .value = ".."}},
      {"cameras:\n  - {name: a, calibration: none.yaml}\n",
       {.file = "none.yaml", .field = "cameras[0] (a)"}},
      {head + "    calibration: a.yaml\n",
       {.file = "bad.yaml", .field = "cameras[0] (front).image_width"}},
      {"cameras:\n  - name: a\n    image_width: 3\n" + pose,
       {.file = "bad.yaml", .field = "cameras[0] (a).image_height"}}};
  for (const auto& [text, expected] : files) {
    const libmap::Error error = error_of([&, &text = text] { parse_rig(text, "bad.yaml"); });
    EXPECT_TRUE(is_error(error, expected)) << text;
  }
}

}  // namespace rig_io_test
