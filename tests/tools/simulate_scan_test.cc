#include <gtest/gtest.h>

#include <cmath>

#include "libmap/camera/camera_io.h"
#include "libmap/io/mesh_io.h"
#include "libmap/scan/scan_source.h"
#include "libmap/simulate/terrain_tiles.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/tools/tool_test_support.h"

namespace simulate_scan_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::write_text;
using graspmap_test::wrong_usage;
using libmap::LinkType;
using libmap::PoseSource;
using Words = std::vector<std::string>;

const Eigen::Vector3d ball_center(0.2, 0.1, 0.3);

// With colors of its own, which are quicker to draw than rock.
void write_site() {
  libmap::TriangleMesh mesh = graspmap_test::join_meshes(
      graspmap_test::square_mesh(0.0, 1.5), graspmap_test::ball_mesh(60, 120, ball_center, 0.3));
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i)
    mesh.vertex_colors.push_back({static_cast<std::uint8_t>(40 * (i % 6)), 120, 90});
  libmap::write_mesh(scratch("site.ply"), mesh);
}

std::vector<std::string> scan(std::vector<std::string> words) {
  words.insert(words.begin(), {"simulate", "scan", "site.ply"});
  return words;
}

TEST(SimulateScanCommand, WritesAScanWhoseTruePosesPutItOnTheMesh) {
  write_site();
  ASSERT_TRUE(
      succeeded(graspmap(scan({"-o", "scan.db", "--frames", "9", "--noise", "0", "--noise-of-range",
                               "0", "--flying-pixels", "0", "--closures"}))));
  const auto source = libmap::open_scan(scratch("scan.db"));
  const libmap::PoseGraph& graph = source->graph();
  ASSERT_EQ(graph.nodes.size(), 9U);
  EXPECT_TRUE(graph.optimized_map_from_base.empty());
  EXPECT_EQ(libmap::trajectory_of(graph, PoseSource::odometry).size(), 9U);
  EXPECT_EQ(libmap::trajectory_of(graph, PoseSource::ground_truth).size(), 9U);
  std::size_t neighbors = 0;
  for (const libmap::PoseLink& link : graph.links) neighbors += link.type == LinkType::neighbor;
  EXPECT_EQ(neighbors, 8U);
  std::size_t points = 0;
  for (const libmap::GraphNode& node : graph.nodes) {
    if (node.id % 4 != 1) continue;
    const libmap::RgbdFrame frame = source->read_frame(node.id);
    ASSERT_EQ(frame.cameras.size(), 1U);
    const libmap::Camera& camera = frame.cameras[0];
    EXPECT_EQ(camera.fx, 365.0);
    EXPECT_EQ(frame.color.width, 512);
    EXPECT_EQ(frame.depth.height, 424);
    const auto rays = libmap::ray_table(camera);
    for (std::size_t p = 0; p < rays.size(); p += 7) {
      const auto depth = static_cast<double>(frame.depth.pixels[p]);
      if (depth == 0) continue;
      ++points;
      const Eigen::Vector3d point =
          *node.truth_from_base * (camera.base_from_camera * (depth * rays[p].homogeneous()));
      // Whole millimeters along rays of up to 1.3 z, and the ball's facets.
      EXPECT_LT(std::min(std::abs(point.z()), std::abs((point - ball_center).norm() - 0.3)),
                0.0015);
    }
  }
  EXPECT_GT(points, 30000U);
  const auto manifest = json_of("scan.db.json");
  EXPECT_EQ(manifest["frame"], "mesh");
  EXPECT_EQ(manifest["results"]["frames"], 9);
  EXPECT_EQ(manifest["results"]["links"], graph.links.size());
  EXPECT_EQ(manifest["results"]["flying_pixels"], 0);
  EXPECT_EQ(manifest["parameters"]["noise_of_range"], 0.0);
}

TEST(SimulateScanCommand, SeedsDecideTheBytesThreadsDoNot) {
  write_site();
  const auto run = [](const std::string& seed, const std::string& threads, const std::string& to) {
    return succeeded(graspmap(scan({"-o", to, "--frames", "3", "--closure-node-gap", "2", "--seed",
                                    seed, "--threads", threads, "--closures"})));
  };
  ASSERT_TRUE(run("1", "1", "a.db"));
  ASSERT_TRUE(run("1", "3", "b.db"));
  ASSERT_TRUE(run("2", "1", "c.db"));
  EXPECT_EQ(content("a.db"), content("b.db"));
  EXPECT_NE(content("a.db"), content("c.db"));
}

TEST(SimulateScanCommand, TakesACameraFileAndAnOffset) {
  write_site();
  libmap::CameraFile file;
  file.camera = {.width = 80, .height = 60, .fx = 70, .fy = 71, .cx = 40, .cy = 29};
  file.camera.distortion_model = libmap::DistortionModel::radial_tangential;
  file.camera.distortion = {0.05, -0.02, 0.0, 0.0, 0.0};
  write_text(scratch("camera.yaml"), libmap::to_yaml(file));
  const auto run = [](const std::string& offset, const std::string& to) {
    return succeeded(graspmap(
        scan({"-o", to, "--frames", "3", "--camera", "camera.yaml", "--depth-offset", offset,
              "--target", "0.1,0,0.1", "--depth-format", "float", "--depth-step", "0"})));
  };
  ASSERT_TRUE(run("0", "plain.db"));
  ASSERT_TRUE(run("0.018", "offset.db"));
  const auto plain = libmap::open_scan(scratch("plain.db"))->read_frame(2);
  const auto offset = libmap::open_scan(scratch("offset.db"))->read_frame(2);
  ASSERT_EQ(plain.depth.width, 80);
  EXPECT_EQ(plain.cameras[0].distortion, file.camera.distortion);
  const auto rays = libmap::ray_table(plain.cameras[0]);
  std::size_t both = 0;
  for (std::size_t p = 0; p < rays.size(); ++p) {
    if (plain.depth.pixels[p] == 0 || offset.depth.pixels[p] == 0) continue;
    ++both;
    const auto difference = static_cast<double>(offset.depth.pixels[p] - plain.depth.pixels[p]);
    EXPECT_NEAR(difference * rays[p].homogeneous().norm(), 0.018, 1e-5);
  }
  EXPECT_GT(both, 1000U);
}

void write_small_camera() {
  libmap::CameraFile file;
  file.camera = {.width = 48, .height = 40, .fx = 34, .fy = 34, .cx = 23.5, .cy = 19.5};
  write_text(scratch("small.yaml"), libmap::to_yaml(file));
}

void write_ground() {
  ASSERT_TRUE(succeeded(graspmap({"simulate", "terrain", "--size", "4x3", "--tile-size", "2",
                                  "--spacing", "0.02", "-o", "ground"})));
  write_small_camera();
}

TEST(SimulateScanCommand, TerrainAlongASerpentine) {
  write_ground();
  const auto run = [](const std::string& threads, const std::string& to) {
    return succeeded(graspmap({"simulate", "scan", "ground", "-o", to, "--camera", "small.yaml",
                               "--frames", "10", "--noise", "0", "--noise-of-range", "0",
                               "--flying-pixels", "0", "--threads", threads}));
  };
  ASSERT_TRUE(run("1", "a.db"));
  ASSERT_TRUE(run("3", "b.db"));
  EXPECT_EQ(content("a.db"), content("b.db"));
  const auto source = libmap::open_scan(scratch("a.db"));
  ASSERT_EQ(source->graph().nodes.size(), 10U);
  const libmap::RockyTerrain terrain({}, {Eigen::Vector2d(0, 0), Eigen::Vector2d(4, 3)});
  std::size_t points = 0;
  std::size_t off = 0;
  for (const libmap::GraphNode& node : source->graph().nodes) {
    const libmap::RgbdFrame frame = source->read_frame(node.id);
    const auto rays = libmap::ray_table(frame.cameras[0]);
    for (std::size_t p = 0; p < rays.size(); ++p) {
      const auto depth = static_cast<double>(frame.depth.pixels[p]);
      if (depth == 0) continue;
      const Eigen::Vector3d point = *node.truth_from_base * (frame.cameras[0].base_from_camera *
                                                             (depth * rays[p].homogeneous()));
      ++points;
      off += std::abs(point.z() - terrain.height(point.x(), point.y())) > 0.01;
    }
  }
  EXPECT_GT(points, 8000U);
  // Steep faces are cut by triangles of 2 cm.
  EXPECT_LT(static_cast<double>(off), 0.1 * static_cast<double>(points));
  const auto manifest = json_of("a.db.json");
  EXPECT_EQ(manifest["frame"], "terrain");
  EXPECT_EQ(manifest["inputs"].size(), 5U);
  EXPECT_GT(manifest["results"]["path_length_m"], 2.0);
}

// A sensor is weaker than flags and the values of --config.
TEST(SimulateScanCommand, TakesASensorByName) {
  write_site();
  const auto made = [&](const Words& options) {
    Words words = scan({"-o", "scan.db", "--frames", "2", "--force"});
    words.insert(words.end(), options.begin(), options.end());
    EXPECT_TRUE(succeeded(graspmap(words)));
    return content(scratch("scan.db"));
  };
  const std::string by_name = made({"--sensor", "kinect-v1"});
  EXPECT_EQ(by_name, made({"--config", "kinect-v1"}));
  EXPECT_NE(by_name, made({"--sensor", "auto"}));
  EXPECT_EQ(made({"--sensor", "kinect-v1", "--noise-of-square", "0.003"}),
            made({"--config", "kinect-v1", "--noise-of-square", "0.003"}));
  write_text(scratch("near.yaml"), "sensor: kinect-v1\nnear_m: 0.7\n");
  EXPECT_EQ(made({"--config", "near.yaml"}), made({"--sensor", "kinect-v1", "--near", "0.7"}));
  EXPECT_EQ(made({"--sensor", "d435"}), made({"--sensor", "realsense-d435"}));
  EXPECT_TRUE(bad_input(graspmap(scan({"-o", "x.db", "--sensor", "kinekt-v1"})),
                        {.field = "sensor", .value = "kinekt-v1", .about = "kinect-v1"}));
}

TEST(SimulateScanCommand, AlongAGivenTrajectory) {
  write_ground();
  write_text(scratch("way.tum"),
             "100.0 1.0 1.0 1.5 0 0.3826834 0 0.9238795\n"
             "100.5 1.2 1.1 1.5 0 0.3826834 0 0.9238795\n"
             "102.0 1.5 1.1 1.6 0 0.3826834 0 0.9238795\n");
  const Words command = {"simulate", "scan",       "ground",       "-o",     "way.db",
                         "--camera", "small.yaml", "--trajectory", "way.tum"};
  ASSERT_TRUE(succeeded(graspmap(command)));
  const libmap::PoseGraph& graph = libmap::open_scan(scratch("way.db"))->graph();
  ASSERT_EQ(graph.nodes.size(), 3U);
  EXPECT_DOUBLE_EQ(graph.nodes[1].stamp_s, 100.5);
  EXPECT_NEAR(graph.nodes[2].truth_from_base->translation().x(), 1.5, 1e-6);
  EXPECT_NEAR(graph.nodes[2].truth_from_base->linear()(2, 0), -std::sqrt(0.5), 1e-6);
  const auto with = [&](Words more) {
    more.insert(more.begin(), command.begin(), command.end());
    return graspmap(more);
  };
  EXPECT_TRUE(bad_input(with({"--frames", "5"}), {.field = "--frames"}));
  EXPECT_TRUE(bad_input(with({"--target", "0,0,0"}), {.field = "--target"}));
  write_text(scratch("way.tum"), "2 1 1 1.5 0 0 0 1\n1 1 1 1.5 0 0 0 1\n");
  EXPECT_TRUE(
      bad_input(with({"--force"}),
                {.file = "way.tum", .field = "stamp of pose 2", .value = "1", .bound = "> 2"}));
  EXPECT_TRUE(bad_input(graspmap({"simulate", "scan", "ground", "-o", "c.db", "--path", "loops"}),
                        {.field = "--path", .value = "loops"}));
  EXPECT_TRUE(bad_input(graspmap({"simulate", "scan", "ground", "-o", "c.db", "--texture", "mesh"}),
                        {.field = "--texture", .value = "mesh"}));
  std::filesystem::create_directory(scratch("empty"));
  EXPECT_TRUE(bad_input(graspmap({"simulate", "scan", "empty", "-o", "c.db"}), {.file = "empty"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("c.db")));
}

TEST(SimulateScanCommand, BadInputIsOneLineAndLeavesNothing) {
  write_site();
  EXPECT_TRUE(
      bad_input(graspmap({"simulate", "scan", "none.ply", "-o", "a.db"}), {.file = "none.ply"}));
  EXPECT_TRUE(bad_input(graspmap(scan({"-o", "a.db", "--near", "3", "--far", "2"})),
                        {.field = "far_m", .value = "2", .bound = "> 3"}));
  EXPECT_TRUE(bad_input(graspmap(scan({"-o", "a.db", "--target", "1,2"})),
                        {.field = "--target", .value = "1,2", .bound = "X,Y,Z"}));
  EXPECT_TRUE(
      bad_input(graspmap(scan({"-o", "a.db", "--camera", "none.yaml"})), {.file = "none.yaml"}));
  EXPECT_TRUE(bad_input(
      graspmap(scan({"-o", "a.db", "--frames", "2", "--radius", "50", "--last-radius", "50"})),
      {.file = "site.ply"}));
  EXPECT_TRUE(bad_input(graspmap(scan({"-o", "site.ply"})), {.file = "site.ply"}));
  EXPECT_TRUE(bad_input(graspmap(scan({"-o", "a.bag"})), {.file = "a.bag"}));
  EXPECT_TRUE(
      bad_input(graspmap(scan({"-o", "a.db", "--flying-pixels", "0.9"})),
                {.field = "flying_pixels + edge_dropouts", .value = "1.25", .bound = "<= 1"}));
  EXPECT_TRUE(wrong_usage(graspmap(scan({"-o", "a.db", "--frmaes", "2"})), {"--frames"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("a.db")));
  ASSERT_TRUE(succeeded(graspmap(scan({"-o", "a.db", "--dry-run"}))));
  EXPECT_FALSE(std::filesystem::exists(scratch("a.db")));
}

}  // namespace simulate_scan_test
