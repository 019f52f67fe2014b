#include <gtest/gtest.h>

#include <cmath>

#include "libmap/cloud/cloud_io.h"
#include "libmap/mesh/mesh_io.h"
#include "libmap/scan/rig_images.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/tools/tool_test_support.h"

namespace {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::write_text;

const Eigen::Vector3d ball_centre(0.8, 0.3, 0.2);

void write_ground() {
  libmap::write_mesh(scratch("ground.ply"),
                     libmap::join_meshes(graspmap_test::square_mesh(0.1, 3.0),
                                         graspmap_test::ball_mesh(60, 120, ball_centre, 0.3)));
}

std::vector<std::string> cameras(std::vector<std::string> words) {
  words.insert(words.begin(), {"simulate", "cameras", "ground.ply"});
  return words;
}

TEST(SimulateCamerasCommand, PanoramaPutsTheImagesBackOnTheMesh) {
  write_ground();
  for (const std::string scale : {"0", "0.0001"}) {
    ASSERT_TRUE(succeeded(graspmap(
        cameras({"-o", "rig", "--x", "0.1", "--y", "-0.2", "--z", "0.3", "--roll", "2", "--pitch",
                 "-4", "--yaw", "30", "--depth-scale", scale, "--stamp", "5"}))));
    ASSERT_TRUE(succeeded(graspmap({"panorama", "rig", "-o", "cloud.ply", "--strict"})));
    libmap::PointCloud cloud = libmap::read_cloud(scratch("cloud.ply")).cloud;
    EXPECT_GT(cloud.size(), 300000U);
    const libmap::Pose body = libmap::make_pose_from_rpy({0.1, -0.2, 0.4}, {2, -4, 30});
    cloud = libmap::transform_cloud(cloud, body);
    const double unit = scale == "0" ? 0.001 : 0.0001;
    std::size_t on_ball = 0;
    for (const Eigen::Vector3d& point : cloud.positions) {
      const double ball = std::abs((point - ball_centre).norm() - 0.3);
      on_ball += ball < std::abs(point.z() - 0.1);
      // Half a unit along rays of up to 1.5 z, and the ball's facets.
      EXPECT_LT(std::min(std::abs(point.z() - 0.1), ball), 0.75 * unit + 5e-4);
    }
    EXPECT_GT(on_ball, 10000U);
    const auto manifest = json_of("rig.json");
    EXPECT_EQ(manifest["frame"], "robot");
    EXPECT_EQ(manifest["results"]["measured_pixels"], cloud.size());
    EXPECT_NEAR(manifest["transforms"]["mesh_from_robot"][11], 0.4, 1e-6);
  }
  const libmap::CameraRig rig = libmap::read_rig(scratch("rig") / "rig.yaml");
  EXPECT_EQ(rig.cameras[0].depth_scale_m, 0.0001);
  const auto images = libmap::list_rig_images(scratch("rig"), rig);
  ASSERT_EQ(images.size(), 6U);
  for (const auto& image : images) {
    EXPECT_GE(image.stamp_s, 5.0);
    EXPECT_LE(image.stamp_s, 5.004);
  }
}

TEST(SimulateCamerasCommand, AnotherRunLeavesNothingOfTheFirst) {
  write_ground();
  ASSERT_TRUE(succeeded(graspmap(cameras({"-o", "rig"}))));
  const std::string first = content("rig/front.png");
  ASSERT_TRUE(succeeded(graspmap(cameras({"-o", "rig", "--seed", "2", "--noise", "0.003"}))));
  EXPECT_NE(content("rig/front.png"), first);
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(scratch("rig")))
    files += entry.is_regular_file();
  EXPECT_EQ(files, 8U);
  ASSERT_TRUE(succeeded(graspmap(cameras({"-o", "rig", "--threads", "1"}))));
  EXPECT_EQ(content("rig/front.png"), first);
}

TEST(SimulateCamerasCommand, BadInputIsOneLine) {
  write_ground();
  EXPECT_TRUE(
      bad_input(graspmap(cameras({"-o", "rig", "--x", "9"})), {"ground.ply", "no ground", "9, 0"}));
  EXPECT_TRUE(bad_input(graspmap(cameras({"-o", "rig", "--rig", "scare"})), {"scar-e"}));
  write_text(scratch("bad.yaml"), "cameras: []\n");
  EXPECT_TRUE(bad_input(graspmap(cameras({"-o", "rig", "--rig", "bad.yaml"})), {"bad.yaml"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("rig")));
  // Above all it sees: images without a measurement, and a warning.
  const auto high = graspmap(cameras({"-o", "rig", "--absolute-z", "--z", "30"}));
  ASSERT_TRUE(succeeded(high));
  EXPECT_NE(high.standard_error.find("nothing within its range"), std::string::npos);
}

}  // namespace
