#include <gtest/gtest.h>

#include <cmath>

#include "libmap/core/table.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "libmap/scan/rig_io.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/tools/tool_test_support.h"

namespace simulate_cameras_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::warned;
using graspmap_test::write_text;

const Eigen::Vector3d ball_center(0.8, 0.3, 0.2);

void write_ground() {
  libmap::write_mesh(
      scratch("ground.ply"),
      graspmap_test::join_meshes(graspmap_test::square_mesh(0.1, 3.0),
                                 graspmap_test::ball_mesh(60, 120, ball_center, 0.3)));
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
    ASSERT_TRUE(succeeded(graspmap({"fuse", "rig", "-o", "cloud.ply", "--strict"})));
    libmap::PointCloud cloud = libmap::read_cloud(scratch("cloud.ply")).cloud;
    EXPECT_GT(cloud.size(), 300000U);
    const libmap::Pose body = libmap::make_pose_from_rpy({0.1, -0.2, 0.4}, {2, -4, 30});
    cloud = libmap::transform_cloud(cloud, body);
    const double unit = scale == "0" ? 0.001 : 0.0001;
    std::size_t on_ball = 0;
    for (const Eigen::Vector3d& point : cloud.positions) {
      const double ball = std::abs((point - ball_center).norm() - 0.3);
      on_ball += ball < std::abs(point.z() - 0.1);
      // Half a unit along rays of up to 1.5 z, and the ball's facets.
      EXPECT_LT(std::min(std::abs(point.z() - 0.1), ball), 0.75 * unit + 5e-4);
    }
    EXPECT_GT(on_ball, 10000U);
    const auto manifest = json_of("rig.json");
    EXPECT_EQ(manifest["frame"], "robot");
    EXPECT_EQ(manifest["results"]["measured_pixels"], cloud.size());
    EXPECT_NEAR(manifest["transforms"]["mesh_from_robot"][11], 0.4, 1e-6);
    EXPECT_EQ(json_of("cloud.ply.json")["transforms"]["site_from_map"],
              manifest["transforms"]["site_from_map"]);
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

// The body inclined, on a mesh that was cut out of another: places listed in the first one's frame
// are found on the map of what the robot sees, and its plane is the ground.
TEST(SimulateCamerasCommand, PlacesOfTheMeshAreFoundOnTheRobotsMap) {
  write_ground();
  ASSERT_TRUE(succeeded(graspmap({"crop", "ground.ply", "--box=-1.2,-1.3,1.4,1.3", "--center",
                                  "--level", "none", "-o", "site.ply"})));
  ASSERT_TRUE(succeeded(graspmap({"simulate", "cameras", "site.ply", "-o", "rig", "--x", "-0.2",
                                  "--z", "0.3", "--pitch", "25", "--yaw", "40"})));
  ASSERT_TRUE(succeeded(graspmap({"fuse", "rig/", "-o", "cloud.pcd"})));
  ASSERT_TRUE(succeeded(
      graspmap({"score", "cloud.pcd", "--curvature-radius", "0", "-o", "map.pcd", "--quiet"})));
  // On the ball, towards the robot, which stands about (-0.1, 0, 0.4); the ground; out of sight.
  const Eigen::Vector3d seen = ball_center + 0.3 * Eigen::Vector3d(-0.9, -0.3, 0.2).normalized();
  write_text(scratch("places.csv"), "place,x,y,z\nball," + std::to_string(seen.x()) + "," +
                                        std::to_string(seen.y()) + "," + std::to_string(seen.z()) +
                                        "\nground,0.6,-0.5,0.1\nbehind,1.25,0.5,0.1\n");
  ASSERT_TRUE(succeeded(graspmap({"lookup", "map.pcd", "places.csv", "-o", "found.csv",
                                  "--points-frame", "map", "--visible", "cloud.pcd"})));
  const libmap::Table found = libmap::read_csv(scratch("found.csv"));
  for (const std::size_t row : {0U, 1U}) {
    EXPECT_EQ(found.rows[row][found.column("found")], "1") << row;
    EXPECT_LT(found.number(row, found.column("distance_m")), 0.01) << row;
  }
  EXPECT_EQ(found.rows[2][found.column("found")], "0");
  const auto info = graspmap({"info", "map.pcd", "--json"});
  ASSERT_TRUE(succeeded(info));
  const auto plane = nlohmann::json::parse(info.standard_output).at("plane");
  EXPECT_NEAR(plane.at("tilt_from_input_z_deg"), 25, 6);
  EXPECT_LT(plane.at("tilt_from_map_z_deg"), 8);
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

std::vector<double> depths_of(const std::string& folder) {
  std::vector<double> depths;
  const libmap::CameraRig rig = libmap::read_rig(scratch(folder) / "rig.yaml");
  for (const auto& image : libmap::list_rig_images(scratch(folder), rig))
    for (const float depth : libmap::read_rig_depth(image, rig.cameras[image.camera]).pixels)
      depths.push_back(static_cast<double>(depth));
  return depths;
}

// The noise and the range are those of the file, except that options replace the noise and the rig
// limits the range.
TEST(SimulateCamerasCommand, TakesASensorByName) {
  write_ground();
  write_text(scratch("short.yaml"),
             "noise_m: 0.004\nnoise_of_range: 0.01\nnear_m: 0.3\n"
             "far_m: 0.6\nrolling_shutter_s: 0.02\n");
  const auto made = [&](const std::string& folder, std::vector<std::string> more) {
    more.insert(more.begin(), {"-o", folder, "--z", "0.3"});
    EXPECT_TRUE(succeeded(graspmap(cameras(more))));
    return depths_of(folder);
  };
  const std::vector<double> ideal = made("ideal", {});
  const std::vector<double> noisy = made("noisy", {"--sensor", "short.yaml"});
  ASSERT_EQ(ideal.size(), noisy.size());
  double squares = 0.0;
  std::size_t count = 0;
  for (std::size_t n = 0; n < ideal.size(); ++n) {
    if (noisy[n] > 0.0) {
      EXPECT_GE(noisy[n], 0.299);
      EXPECT_LE(noisy[n], 0.601);
    }
    if (!(noisy[n] > 0.0) || !(ideal[n] > 0.35) || !(ideal[n] < 0.55)) continue;
    const double off = (noisy[n] - ideal[n]) / (0.004 + 0.01 * ideal[n]);
    squares += off * off;
    ++count;
  }
  ASSERT_GT(count, 1000U);
  // The noise is along the ray, so that less of it is along the optical axis.
  const double deviation = std::sqrt(squares / static_cast<double>(count));
  EXPECT_GT(deviation, 0.85);
  EXPECT_LT(deviation, 1.05);
  const std::vector<double> given = made("given", {"--sensor", "short.yaml", "--noise", "0.001"});
  EXPECT_EQ(made("same", {"--noise", "0.001"}).size(), given.size());
  EXPECT_LT(*std::max_element(given.begin(), given.end()), 0.61);
  EXPECT_EQ(made("d435", {"--sensor", "d435"}), made("name", {"--sensor", "realsense-d435"}));
}

TEST(SimulateCamerasCommand, UnknownAndUselessSensorsAreNamed) {
  write_ground();
  EXPECT_TRUE(bad_input(graspmap(cameras({"-o", "rig", "--sensor", "kinekt-v1"})),
                        {.field = "sensor", .value = "kinekt-v1", .about = "kinect-v1"}));
  write_text(scratch("far.yaml"), "noise_m: 0.004\nnear_m: 30\nfar_m: 40\n");
  EXPECT_TRUE(bad_input(graspmap(cameras({"-o", "rig", "--sensor", "far.yaml"})),
                        {.file = "far.yaml", .field = "far_m", .bound = "> 30"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("rig")));
}

TEST(SimulateCamerasCommand, UnitsTooFineForTheRangeAreRefused) {
  write_ground();
  libmap::CameraRig rig;
  libmap::RigCamera& camera = rig.cameras.emplace_back();
  camera.name = "front";
  camera.camera = {.width = 32, .height = 24, .fx = 30, .fy = 30, .cx = 15.5, .cy = 11.5};
  camera.depth_scale_m = 0.00001;
  camera.far_m = 1.5;
  write_text(scratch("far.yaml"), to_yaml(rig));
  const auto run = [](std::vector<std::string> more) {
    more.insert(more.begin(), {"-o", "rig", "--rig", "far.yaml"});
    return graspmap(cameras(more));
  };
  EXPECT_TRUE(bad_input(run({}), {.file = "far.yaml",
                                  .field = "depth_scale_m",
                                  .value = "1e-05",
                                  .bound = ">= far_m / 65534 = 2.2888882e-05"}));
  EXPECT_TRUE(
      bad_input(run({"--depth-scale", "0.00002"}), {.field = "depth_scale_m", .value = "2e-05"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("rig")));
  EXPECT_TRUE(succeeded(run({"--depth-scale", "2.2888882e-05"})));
}

TEST(SimulateCamerasCommand, BadInputIsOneLine) {
  write_ground();
  EXPECT_TRUE(bad_input(graspmap(cameras({"-o", "rig", "--x", "9"})),
                        {.file = "ground.ply", .field = "x, y", .value = "9, 0"}));
  EXPECT_TRUE(bad_input(graspmap(cameras({"-o", "rig", "--rig", "scare"})),
                        {.field = "rig", .value = "scare"}));
  write_text(scratch("bad.yaml"), "cameras: []\n");
  EXPECT_TRUE(bad_input(graspmap(cameras({"-o", "rig", "--rig", "bad.yaml"})),
                        {.file = "bad.yaml", .field = "cameras"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("rig")));
  // Above all it sees: images without a measurement, and a warning.
  const auto high = graspmap(cameras({"-o", "rig", "--absolute-z", "--z", "30"}));
  ASSERT_TRUE(succeeded(high));
  EXPECT_TRUE(warned(high, {"measurements"}));
}

}  // namespace simulate_cameras_test
