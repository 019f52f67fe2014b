#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/tools/tool_test_support.h"

namespace bag_test {

namespace fs = std::filesystem;
using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::ended_with;
using graspmap_test::ExpectedError;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::ProgramResult;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::warned;
using graspmap_test::write_text;
using graspmap_test::wrong_usage;

// Builds without ROS's packages have the commands too.
bool has_ros() {
  write_text(scratch("probe.bag"), "#ROSBAG V2.0\n");
  const ProgramResult result = graspmap({"info", "probe.bag"});
  fs::remove(scratch("probe.bag"));
  if (result.exit_code != 1) return true;
  EXPECT_TRUE(ended_with(result, {.about = "ROS 1", .kind = libmap::ErrorKind::failed}));
  return false;
}

#define REQUIRE_ROS() \
  if (!has_ros()) GTEST_SKIP() << "built without ROS 1"

// python3-rosbag, which shares no code with librosbag; empty where it is not installed.
std::string python() {
  const std::string debians = "/usr/bin/python3";
  if (!fs::exists(debians)) return {};
  return graspmap_test::run_program({debians, "-c", "import rosbag"}).exit_code == 0 ? debians : "";
}

// rosbag2_check.py, which needs nothing but Python itself.
ProgramResult check2(const std::vector<std::string>& words) {
  std::vector<std::string> line = {
      "/usr/bin/python3",
      (graspmap_test::source_folder() / "tests/tools/rosbag2_check.py").string()};
  line.insert(line.end(), words.begin(), words.end());
  return graspmap_test::run_program(line, {.folder = scratch("")});
}

ProgramResult check(const std::vector<std::string>& words) {
  std::vector<std::string> line = {
      python(), (graspmap_test::source_folder() / "tests/tools/rosbag_check.py").string()};
  line.insert(line.end(), words.begin(), words.end());
  return graspmap_test::run_program(line, {.folder = scratch("")});
}

const char* const camera_names[] = {"front", "front_left", "rear_left",
                                    "rear",  "rear_right", "front_right"};

// Writes images of a ball on the ground by six small cameras around a robot to the folder `run`.
void write_run(const std::string& stamp = "5", const std::string& scale = "0") {
  std::string rig = "near_m: 0.28\nfar_m: 1.5\ncameras:\n";
  for (int n = 0; n < 6; ++n)
    rig += "  - name: " + std::string(camera_names[n]) +
           "\n    image_width: 96\n    image_height: 54\n"
           "    camera_matrix: [50.6, 0, 47.5, 0, 48.7, 26.5, 0, 0, 1]\n"
           "    position_m: [" +
           std::to_string(0.2 * std::cos(n * M_PI / 3)) + ", " +
           std::to_string(0.2 * std::sin(n * M_PI / 3)) + ", 0]\n    roll_pitch_yaw_deg: [0, 10, " +
           std::to_string(60 * n) + "]\n";
  write_text(scratch("rig.yaml"), rig);
  libmap::write_mesh(
      scratch("ground.ply"),
      graspmap_test::join_meshes(graspmap_test::square_mesh(0.1, 3.0),
                                 graspmap_test::ball_mesh(20, 40, {0.8, 0, 0.2}, 0.3)));
  ASSERT_TRUE(
      succeeded(graspmap({"simulate", "cameras", "ground.ply", "--rig", "rig.yaml", "-o", "run",
                          "--stamp", stamp, "--z", "0.4", "--roll", "3", "--depth-scale", scale})));
}

void expect_same_panorama(const std::string& folder) {
  ASSERT_TRUE(succeeded(graspmap({"fuse", "run", "-o", "direct.pcd"})));
  ASSERT_TRUE(succeeded(graspmap({"fuse", folder, "-o", "back.pcd", "--strict"})));
  EXPECT_GT(libmap::read_cloud(scratch("direct.pcd")).cloud.size(), 5000U);
  EXPECT_TRUE(content("direct.pcd") == content("back.pcd"));
}

TEST(BagCommand, ImagesIntoABagAndBackGiveTheSamePanorama) {
  REQUIRE_ROS();
  write_run();
  ASSERT_TRUE(succeeded(graspmap({"convert", "run", "-o", "run.bag", "--compression", "lz4"})));
  ASSERT_TRUE(succeeded(graspmap(
      {"convert", "run.bag", "-o", "back", "--near", "0.28", "--far", "1.5", "--strict"})));
  expect_same_panorama("back");
  const nlohmann::json manifest = json_of("back.json");
  EXPECT_EQ(manifest["results"]["synchronized_sets"], 1);
  EXPECT_EQ(manifest["results"]["cameras_of_fullest_set"], 6);
  EXPECT_EQ(manifest["results"]["rear.topic"], "/rear/depth/image_raw");
  EXPECT_EQ(manifest["frame"], "robot");
  // The cloud can be scored.
  ASSERT_TRUE(succeeded(graspmap({"score", "back.pcd", "-o", "map.pcd", "--up", "0,0,1"})));
  EXPECT_GT(libmap::read_cloud(scratch("map.pcd")).cloud.size(), 1000U);
}

TEST(BagCommand, ImagesThroughBagsOfRos2GiveTheSamePanorama) {
  write_run();
  std::vector<std::string> range = {"--near", "0.28", "--far", "1.5", "--strict"};
  const auto back = [&](const std::string& bag, const std::string& folder) {
    std::vector<std::string> words = {"convert", bag, "-o", folder};
    words.insert(words.end(), range.begin(), range.end());
    return succeeded(graspmap(words));
  };
  ASSERT_TRUE(succeeded(graspmap({"convert", "run", "-o", "recorded"})));
  ASSERT_TRUE(back("recorded", "back"));
  expect_same_panorama("back");
  EXPECT_EQ(json_of("back.json")["inputs"].size(), 2U);
  ASSERT_TRUE(succeeded(graspmap({"convert", "run", "-o", "run.mcap", "--compression", "zstd"})));
  ASSERT_TRUE(back("run.mcap", "again"));
  expect_same_panorama("again");
  // Repacked by other code: big-endian, in two files, as a later version, topics in the order of
  // their stamps.
  for (const char* name : camera_names)
    range.insert(range.end(), {"--topic", "/" + std::string(name) + "/depth/image_raw"});
  ASSERT_EQ(check2({"copy", "recorded", "copied"}).standard_error, "");
  ASSERT_TRUE(back("copied", "of_copy"));
  expect_same_panorama("of_copy");
  EXPECT_EQ(json_of("of_copy.json")["inputs"].size(), 3U);
  // One file by its own name, without metadata.yaml.
  ASSERT_TRUE(back("recorded/bag_0.db3", "of_file"));
  expect_same_panorama("of_file");
}

TEST(BagCommand, FineDepthsComeBackWithARigOfOnesOwn) {
  REQUIRE_ROS();
  write_run("1600000000.25", "0.0001");
  ASSERT_TRUE(succeeded(graspmap({"convert", "run", "-o", "run.bag"})));
  ASSERT_TRUE(succeeded(graspmap(
      {"convert", "run.bag", "-o", "back", "--rig", "rig.yaml", "--depth-scale", "0.0001"})));
  expect_same_panorama("back");
}

TEST(BagCommand, PythonsBagsAreReadAlike) {
  REQUIRE_ROS();
  if (python().empty()) GTEST_SKIP() << "python3-rosbag is not installed";
  write_run();
  ASSERT_TRUE(succeeded(graspmap({"convert", "run", "-o", "run.bag"})));
  ASSERT_TRUE(succeeded(check({"copy", "run.bag", "copy.bag"})));
  ASSERT_FALSE(content("run.bag") == content("copy.bag"));
  // The copy's topics are in the order of their stamps.
  std::vector<std::string> words = {"convert", "copy.bag", "-o",    "back",
                                    "--near",  "0.28",     "--far", "1.5"};
  for (const char* name : camera_names)
    words.insert(words.end(), {"--topic", "/" + std::string(name) + "/depth/image_raw"});
  ASSERT_TRUE(succeeded(graspmap(words)));
  expect_same_panorama("back");
}

TEST(BagCommand, AnImageThatCannotBeUsedIsAWarningOrStrictlyAnError) {
  REQUIRE_ROS();
  write_run();
  ASSERT_TRUE(succeeded(graspmap({"convert", "run", "-o", "run.bag"})));
  std::string bag = content("run.bag");
  // The text's length, the text, a byte of the bytes' order, the bytes of a row.
  const std::size_t encoding = bag.find(std::string("\5\0\0\0", 4) + "16UC1");
  ASSERT_NE(encoding, std::string::npos);
  bag.replace(encoding + 10, 4, std::string("\7\0\0\0", 4));
  write_text(scratch("run.bag"), bag);
  EXPECT_TRUE(bad_input(graspmap({"convert", "run.bag", "-o", "strict", "--strict"}),
                        {.file = "run.bag",
                         .field = "/front/depth/image_raw",
                         .bound = ">= 192",
                         .about = "step is 7"}));
  EXPECT_FALSE(fs::exists(scratch("strict")));
  const ProgramResult result = graspmap({"convert", "run.bag", "-o", "back"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_TRUE(warned(result, {"/depth/image_raw", "step is 7", "96 pixels"}));
  EXPECT_EQ(json_of("back.json")["results"]["images_broken"], 1);
  EXPECT_EQ(json_of("back.json")["results"]["images"], 5);
}

// A small map with curvature, its terrain and its footholds.
void write_map_parts() {
  graspmap_test::write_terrain();
  ASSERT_TRUE(succeeded(
      graspmap({"score", "terrain.pcd", "-o", "map.pcd", "--solid-voxel-threshold", "1"})));
  ASSERT_TRUE(succeeded(
      graspmap({"footholds", "map.pcd", "-o", "f.csv", "--no-graspable-only", "--border"})));
}

std::vector<std::string> map_bag(const std::string& output) {
  return {"convert",     "map.pcd",     "-o",    output,    "--terrain",
          "terrain.pcd", "--footholds", "f.csv", "--stamp", "1600000000.5"};
}

TEST(BagCommand, AMapsBagAsPythonReadsIt) {
  REQUIRE_ROS();
  if (python().empty()) GTEST_SKIP() << "python3-rosbag is not installed";
  write_map_parts();
  ASSERT_TRUE(succeeded(graspmap(map_bag("map.bag"))));
  const ProgramResult shown = check({"show", "map.bag"});
  ASSERT_EQ(shown.exit_code, 0) << shown.standard_error;
  const nlohmann::json topics = nlohmann::json::parse(shown.standard_output);
  ASSERT_EQ(topics.size(), 6U);
  for (const auto& [name, topic] : topics.items()) {
    EXPECT_EQ(topic["latching"], 1) << name;
    EXPECT_EQ(topic["stamp"], 1600000000.5) << name;
  }
  // MD5 sums of ROS Noetic's message definitions.
  EXPECT_EQ(topics["/graspability_map"]["md5sum"], "1158d486dd51d683ce2f1be655c3c181");
  EXPECT_EQ(topics["/footholds"]["md5sum"], "d155b9ce5188fbaf89745847fd5882d7");
  EXPECT_EQ(topics["/foothold_poses"]["md5sum"], "916c28c5764443f268b296bb671b9d97");
  EXPECT_EQ(topics["/tf_static"]["md5sum"], "94810edda583a504dfda3829e70d7eec");
  const libmap::PointCloud map = libmap::read_cloud(scratch("map.pcd")).cloud;
  const nlohmann::json& written = topics["/graspability_map"];
  EXPECT_EQ(written["frame"], "terrain");
  EXPECT_EQ(written["points"], map.size());
  EXPECT_EQ(written["fields"][3], nlohmann::json({"rgb", 12, 7, 1}));
  EXPECT_FLOAT_EQ(written["first"]["x"], static_cast<float>(map.positions[0].x()));
  EXPECT_FLOAT_EQ(written["first"]["score"],
                  static_cast<float>(map.find_field("score")->values[0]));
  EXPECT_TRUE(topics["/curvature_map"]["first"].contains("k2"));
  EXPECT_EQ(topics["/merged_pcd"]["frame"], "map");
  const libmap::PointCloud footholds = libmap::read_cloud(scratch("f.csv")).cloud;
  ASSERT_GT(footholds.size(), 3U);
  const nlohmann::json& poses = topics["/foothold_poses"]["poses"];
  ASSERT_EQ(poses.size(), footholds.size());
  EXPECT_NEAR(poses[2][0].get<double>(), footholds.positions[2].x(), 1e-12);
  const Eigen::Quaterniond turn(poses[2][6], poses[2][3], poses[2][4], poses[2][5]);
  // The approach is straight down onto the terrain's plane.
  EXPECT_TRUE((turn * Eigen::Vector3d::UnitX()).isApprox(-Eigen::Vector3d::UnitZ(), 1e-12));
  EXPECT_EQ(topics["/footholds"]["markers"].size(), 2 * footholds.size() + 1);
}

TEST(BagCommand, AMapsBagOfRos2AsPythonReadsIt) {
  write_map_parts();
  ASSERT_TRUE(succeeded(graspmap(map_bag("map_bag"))));
  const ProgramResult shown = check2({"show", "map_bag"});
  ASSERT_EQ(shown.exit_code, 0) << shown.standard_error;
  const nlohmann::json topics = nlohmann::json::parse(shown.standard_output);
  ASSERT_EQ(topics.size(), 8U);
  for (const auto& [name, topic] : topics.items()) {
    EXPECT_TRUE(topic["latched"]) << name;
    EXPECT_EQ(topic["stamp"], 1600000000500000000) << name;
  }
  const libmap::PointCloud map = libmap::read_cloud(scratch("map.pcd")).cloud;
  const nlohmann::json& points = topics["/graspability_map"]["message"];
  EXPECT_EQ(points["header"]["frame_id"], "terrain");
  EXPECT_EQ(points["width"], map.size());
  EXPECT_EQ(points["data"].size(), map.size() * points["point_step"].get<std::size_t>());
  const libmap::PointCloud footholds = libmap::read_cloud(scratch("f.csv")).cloud;
  EXPECT_EQ(topics["/foothold_poses"]["message"]["poses"].size(), footholds.size());
  EXPECT_EQ(topics["/footholds"]["message"]["markers"].size(), 2 * footholds.size() + 1);
  const nlohmann::json& transform = topics["/tf_static"]["message"]["transforms"][0];
  EXPECT_EQ(transform["header"]["frame_id"], "terrain");
  EXPECT_EQ(transform["child_frame_id"], "map");
  // Each point of the map is in the cell where it is, below none of its neighbors in that column.
  const nlohmann::json& grid = topics["/graspability_grid"]["message"];
  const nlohmann::json& occupancy = topics["/graspability_occupancy"]["message"];
  const double cell = grid["info"]["resolution"];
  EXPECT_DOUBLE_EQ(cell, json_of("map.pcd.json")["parameters"]["voxel_size_m"]);
  const auto width = occupancy["info"]["width"].get<std::size_t>();
  const std::size_t cells = width * occupancy["info"]["height"].get<std::size_t>();
  ASSERT_EQ(grid["layers"][0], "elevation");
  const auto score = std::find(grid["layers"].begin(), grid["layers"].end(), "score");
  ASSERT_NE(score, grid["layers"].end());
  const nlohmann::json& scores =
      grid["data"][static_cast<std::size_t>(score - grid["layers"].begin())]["data"];
  const nlohmann::json& heights = grid["data"][0]["data"];
  ASSERT_EQ(heights.size(), cells);
  ASSERT_EQ(occupancy["data"].size(), cells);
  std::map<std::size_t, std::size_t> tops;
  for (std::size_t n = 0; n < map.size(); ++n) {
    const Eigen::Vector3d& point = map.positions[n];
    const double x =
        (point.x() - occupancy["info"]["origin"]["position"]["x"].get<double>()) / cell;
    const double y =
        (point.y() - occupancy["info"]["origin"]["position"]["y"].get<double>()) / cell;
    const std::size_t index = static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x);
    ASSERT_LT(index, cells);
    const auto [top, is_new] = tops.emplace(index, n);
    if (!is_new && point.z() > map.positions[top->second].z()) top->second = n;
  }
  for (const auto& [index, n] : tops) {
    EXPECT_FLOAT_EQ(heights[cells - 1 - index], static_cast<float>(map.positions[n].z()));
    const double value = map.find_field("score")->values[n];
    EXPECT_FLOAT_EQ(scores[cells - 1 - index], static_cast<float>(value));
    EXPECT_NEAR(occupancy["data"][index].get<double>(), 100 * (1 - value), 0.51);
  }
  EXPECT_EQ(
      static_cast<std::size_t>(std::count(occupancy["data"].begin(), occupancy["data"].end(), -1)),
      cells - tops.size());
}

TEST(BagCommand, MapsComeBackFromBagsOfRos2) {
  write_map_parts();
  for (const std::string name : {"a", "a.mcap"}) {
    ASSERT_TRUE(succeeded(graspmap(map_bag(name))));
    ASSERT_TRUE(
        succeeded(graspmap({"convert", name, "-o", "m.pcd", "--topic", "/graspability_map"})));
    EXPECT_TRUE(content("m.pcd") == content("map.pcd"));
    const ProgramResult info = graspmap({"info", name, "--json"});
    ASSERT_TRUE(succeeded(info));
    const nlohmann::json listing = nlohmann::json::parse(info.standard_output);
    EXPECT_EQ(listing["kind"], name == "a" ? "bag of ROS 2 (sqlite3)" : "bag of ROS 2 (mcap)");
    EXPECT_EQ(listing["messages"], 8);
    EXPECT_EQ(listing["topics"][1]["type"], "sensor_msgs/msg/PointCloud2");
  }
  // Written again over its own; never over a folder of others.
  EXPECT_TRUE(succeeded(graspmap(map_bag("a"))));
  write_text(scratch("a/notes.txt"), "mine");
  EXPECT_TRUE(bad_input(graspmap(map_bag("a")), {.file = "a"}));
}

TEST(BagCommand, BadBagsOfRos2AreOneLine) {
  write_text(scratch("map.csv"), "x,y,z,score\n0,0,0,0.9\n");
  const ProgramResult written = graspmap({"convert", "map.csv", "-o", "good.mcap"});
  ASSERT_TRUE(succeeded(written));
  EXPECT_TRUE(warned(written, {"map.csv", "--cell-size"}));
  ASSERT_TRUE(succeeded(graspmap({"convert", "map.csv", "-o", "good", "--cell-size", "0.01"})));
  const std::vector<std::string> before = graspmap_test::names_in_scratch();
  const auto says = [](std::vector<std::string> words, const ExpectedError& expected) {
    words.insert(words.begin(), "convert");
    EXPECT_TRUE(bad_input(graspmap(words), expected));
  };
  says({"map.csv", "-o", "out.db3"}, {.file = "out.db3", .field = "extension", .value = ".db3"});
  says({"map.csv", "-o", "out.zip"}, {.file = "out.zip",
                                      .field = "extension",
                                      .value = ".zip",
                                      .bound = ".pcd, .ply, .csv or .vtp"});
  says({"map.csv", "-o", "out", "--cell-size", "1", "--compression", "lz4"},
       {.file = "map.csv", .field = "compression"});
  says({"map.csv", "-o", "out.mcap", "--cell-size", "1", "--compression", "bz2"},
       {.file = "map.csv", .field = "compression", .value = "bz2"});
  says({"map.csv", "-o", "out.mcap", "--cell-size", "1", "--stamp", "4000000000"},
       {.field = "stamp", .bound = ">= 1e-9 and < 2^31 s"});
  says({"map.csv", "-o", "out", "--cell-size", "-1"},
       {.field = "--cell-size", .value = "-1", .bound = ">= 0"});
  says({"good.mcap", "-o", "out.mcap"}, {.file = "good.mcap"});
  says({"good.mcap", "-o", "out"},
       {.file = "good.mcap", .field = "topics of images", .value = "none"});
  fs::create_directory(scratch("open"));
  fs::copy(scratch("good/bag_0.db3"), scratch("open/bag_0.db3"));
  EXPECT_TRUE(bad_input(graspmap({"info", "open"}), {.file = "open/metadata.yaml"}));
  says({"open", "-o", "out"}, {.file = "open/metadata.yaml"});
  write_text(scratch("open/metadata.yaml"), content("good/metadata.yaml"));
  write_text(scratch("open/bag_0.db3"), content("good/bag_0.db3").substr(0, 5000));
  EXPECT_TRUE(bad_input(graspmap({"info", "open"}), {.file = "open/bag_0.db3"}));
  write_text(scratch("open/cut.mcap"), content("good.mcap").substr(0, 500));
  EXPECT_TRUE(bad_input(graspmap({"info", "open/cut.mcap"}), {.file = "open/cut.mcap"}));
  fs::remove_all(scratch("open"));
  EXPECT_EQ(graspmap_test::names_in_scratch(), before);
}

TEST(BagCommand, SameBytesOnEveryRunAndMapsComeBack) {
  REQUIRE_ROS();
  write_map_parts();
  ASSERT_TRUE(succeeded(graspmap(map_bag("a.bag"))));
  std::vector<std::string> again = map_bag("b.bag");
  again.insert(again.end(), {"--threads", "1"});
  ASSERT_TRUE(succeeded(graspmap(again)));
  EXPECT_TRUE(content("a.bag") == content("b.bag"));
  ASSERT_TRUE(
      succeeded(graspmap({"convert", "a.bag", "-o", "m.pcd", "--topic", "/graspability_map"})));
  EXPECT_TRUE(content("m.pcd") == content("map.pcd"));
  EXPECT_EQ(json_of("m.pcd.json")["results"]["stamp_s"], 1600000000.5);
}

TEST(BagCommand, InfoListsTheTopics) {
  REQUIRE_ROS();
  write_map_parts();
  ASSERT_TRUE(succeeded(graspmap(map_bag("a.bag"))));
  const ProgramResult info = graspmap({"info", "a.bag", "--json"});
  ASSERT_TRUE(succeeded(info));
  const nlohmann::json listing = nlohmann::json::parse(info.standard_output);
  EXPECT_EQ(listing["kind"], "bag of ROS 1");
  EXPECT_EQ(listing["made_by"].get<std::string>().substr(0, 17), "graspmap convert ");
  EXPECT_EQ(listing["messages"], 6);
  EXPECT_EQ(listing["start_s"], 1600000000.5);
  EXPECT_EQ(listing["end_s"], 1600000000.5);
  EXPECT_EQ(listing["duration_s"], 0);
  EXPECT_EQ(listing["topics"][1]["name"], "/merged_pcd");
  EXPECT_EQ(listing["topics"][1]["type"], "sensor_msgs/PointCloud2");
  EXPECT_EQ(listing["topics"][1]["messages"], 1);
  EXPECT_EQ(listing["topics"][1]["latching"], true);
  const ProgramResult text = graspmap({"info", "a.bag"});
  ASSERT_TRUE(succeeded(text));
  EXPECT_NE(text.standard_output.find("\n  name /merged_pcd, type sensor_msgs/PointCloud2, md5sum "
                                      "1158d486dd51d683ce2f1be655c3c181, messages 1, latching "
                                      "yes\n"),
            std::string::npos)
      << text.standard_output;
}

// Input and output determine whether a command line reads or writes a bag.
TEST(BagCommand, WhatIsABagIsDecidedByInputAndOutput) {
  write_text(scratch("map.csv"), "x,y,z,score\n0,0,0,0.9\n");
  write_text(scratch("cloud.csv"), "x,y,z\n0,0,0\n");
  write_text(scratch("poses.csv"), "0,0,0,0,1,0,0,0\n");
  write_text(scratch("scan.db"), "");
  fs::create_directory(scratch("folder"));
  fs::create_directory(scratch("rig"));
  write_text(scratch("rig/rig.yaml"), "cameras: []\n");
  ASSERT_TRUE(succeeded(graspmap({"convert", "map.csv", "-o", "viz", "--quiet"})));
  EXPECT_TRUE(fs::exists(scratch("viz/metadata.yaml")));
  ASSERT_TRUE(succeeded(graspmap({"convert", "map.csv", "--output=viz.mcap", "--quiet"})));
  ASSERT_TRUE(succeeded(graspmap({"convert", "-o", "map.ply", "map.csv"})));
  ASSERT_TRUE(succeeded(graspmap(
      {"convert", "viz.mcap", "--topic", "/graspability_map", "-o", "back.csv", "--quiet"})));
  const std::vector<std::string> before = graspmap_test::names_in_scratch();
  const auto says = [](std::vector<std::string> words, const ExpectedError& expected) {
    words.insert(words.begin(), "convert");
    EXPECT_TRUE(bad_input(graspmap(words), expected));
  };
  // A scan stays a scan, and never becomes a bag.
  says({"scan.db", "-o", "out"}, {.file = "scan.db"});
  says({"scan.db", "-o", "out.bag"}, {.file = "out.bag"});
  says({"folder", "-o", "out"}, {.file = "folder"});
  says({"folder", "-o", "out.mcap"}, {.file = "folder"});
  for (const char* other : {"rig.yaml", "recording.mcap"}) {
    fs::create_directory(scratch("both"));
    write_text(scratch("both/depth.txt"), "");
    write_text(scratch("both") / other, "");
    says({"both", "-o", "out"}, {.file = "both"});
    fs::remove_all(scratch("both"));
  }
  // The folder of a rig can only become a bag.
  says({"rig", "-o", "out"}, {.file = "rig/rig.yaml", .field = "cameras"});
  says({"rig", "-o", "out.pcd"}, {.file = "out.pcd", .field = "extension", .value = ".pcd"});
  // Without an extension: one map becomes a bag; several files and poses do not.
  says({"cloud.csv", "-o", "out"}, {.file = "cloud.csv", .field = "score"});
  says({"map.csv", "map.ply", "-o", "out"}, {.file = "map.ply"});
  says({"map.csv", "-o", "out", "--encoding", "ascii"}, {.file = "out", .field = "extension"});
  says({"poses.csv", "-o", "out", "--poses-format", "tum"},
       {.file = "out", .field = "extension", .bound = "one of .tum .kitti .g2o .toro"});
  EXPECT_TRUE(wrong_usage(graspmap({"convert", "viz.mcap", "map.csv", "-o", "out"}), {"map.csv"}));
  EXPECT_EQ(graspmap_test::names_in_scratch(), before);
}

// With a map in the terrain frame and a panorama in the robot's frame, RViz needs the transform.
TEST(BagCommand, FramesAreTiedTogether) {
  REQUIRE_ROS();
  write_run();
  ASSERT_TRUE(succeeded(graspmap({"fuse", "run", "-o", "p.pcd", "--stride", "1"})));
  for (const char* frame : {"terrain", "input"}) {
    ASSERT_TRUE(succeeded(
        graspmap({"score", "p.pcd", "-o", "map.pcd", "--up", "0,0,1", "--frame", frame})));
    ASSERT_TRUE(succeeded(graspmap({"convert", "map.pcd", "-o", "map.bag", "--terrain", "p.pcd"})));
    const auto listing = graspmap({"info", "map.bag"}).standard_output;
    EXPECT_EQ(listing.find("/tf_static") != std::string::npos, std::string(frame) == "terrain");
    // The panorama's own stamp.
    EXPECT_EQ(json_of("map.bag.json")["results"]["stamp_s"],
              json_of("p.pcd.json")["results"]["stamp_s"]);
    EXPECT_EQ(json_of("map.bag.json")["frame"],
              std::string(frame) == "terrain" ? "terrain" : "base_link");
  }
}

TEST(BagCommand, LeavesNothingInTheUsersFolder) {
  REQUIRE_ROS();
  write_text(scratch("map.csv"), "x,y,z,score\n0,0,0,0.9\n");
  fs::create_directory(scratch("home"));
  fs::create_directory(scratch("temporary"));
  const std::map<std::string, std::string> environment = {
      {"HOME", scratch("home").string()}, {"TMPDIR", scratch("temporary").string()}};
  const ProgramResult written = graspmap({"convert", "map.csv", "-o", "map.bag"}, environment);
  EXPECT_TRUE(succeeded(written));
  EXPECT_EQ(std::count(written.standard_error.begin(), written.standard_error.end(), '\n'), 1);
  EXPECT_TRUE(succeeded(graspmap({"info", "map.bag"}, environment)));
  EXPECT_TRUE(fs::is_empty(scratch("home")));
  EXPECT_TRUE(fs::is_empty(scratch("temporary")));
}

TEST(BagCommand, BadInputIsOneLineAndLeavesNothing) {
  REQUIRE_ROS();
  graspmap_test::write_terrain();
  write_text(scratch("map.csv"), "x,y,z,score\n0,0,0,0.9\n");
  write_text(scratch("f.csv"), "x,y,z,score,approach_x,approach_y,approach_z\n0,0,0,0.9,0,0,0\n");
  ASSERT_TRUE(succeeded(graspmap({"convert", "map.csv", "-o", "good.bag"})));
  const std::vector<std::string> before = graspmap_test::names_in_scratch();
  const auto says = [](std::vector<std::string> words, const ExpectedError& expected) {
    words.insert(words.begin(), "convert");
    EXPECT_TRUE(bad_input(graspmap(words), expected));
  };
  EXPECT_TRUE(bad_input(graspmap({"info", "none.bag"}), {.file = "none.bag"}));
  says({"none.bag", "-o", "out"}, {.file = "none.bag"});
  says({"none", "-o", "out.bag"}, {.file = "none"});
  EXPECT_TRUE(wrong_usage(graspmap({"convert", "good.bag"}), {"--output"}));
  says({"good.bag", "-o", "out"},
       {.file = "good.bag", .field = "topics of images", .value = "none"});
  says({"good.bag", "-o", "out.pcd"}, {.file = "good.bag",
                                       .field = "topics of sensor_msgs/PointCloud2",
                                       .value = "/graspability_map, /curvature_map"});
  says({"good.bag", "-o", "out.pcd", "--topic", "/graspabilty_map"},
       {.file = "good.bag",
        .field = "topic",
        .value = "/graspabilty_map",
        .bound = "one of /graspability_map, /curvature_map",
        .about = "'/graspability_map'"});
  says({"good.bag", "-o", "out.pcd", "--topic", "/graspability_map", "--topic", "/curvature_map"},
       {.field = "--topic"});
  says({"good.bag", "-o", "out.xyz"}, {.file = "out.xyz",
                                       .field = "extension",
                                       .value = ".xyz",
                                       .bound = ".pcd, .ply, .csv or .vtp"});
  says({"good.bag", "-o", "out.bag"}, {.file = "good.bag"});
  says({"good.bag", "-o", "out", "--stamp", "noon"}, {.field = "--stamp", .value = "noon"});
  says({"terrain.pcd", "-o", "out"}, {.file = "terrain.pcd", .field = "score"});
  says({"terrain.pcd", "-o", "out.bag"}, {.file = "terrain.pcd", .field = "score"});
  says({"map.csv", "-o", "out.bag", "--footholds", "map.csv"},
       {.file = "map.csv", .field = "approach_x"});
  says({"map.csv", "-o", "out.bag", "--footholds", "f.csv"},
       {.file = "f.csv", .field = "approach of foothold 1"});
  says({"map.csv", "-o", "out.bag", "--stamp", "-1"},
       {.field = "stamp", .value = "-1", .bound = ">= 1e-9 and < 2^32 - 1 s"});
  says({"map.csv", "-o", "out.bag", "--compression", "zip"},
       {.field = "--compression", .value = "zip", .bound = "one of none bz2 lz4 zstd"});
  says({"map.csv", "-o", "out.bag", "--topic", "/a"}, {.field = "--topic"});
  says({"map.csv", "-o", "out.bag", "--rig", "r"}, {.field = "--rig"});
  says({"good.bag", "-o", "out.pcd", "--terrain", "terrain.pcd"}, {.field = "--terrain"});
  says({"good.bag", "-o", "out.pcd", "--rig", "r"}, {.field = "--rig"});
  fs::create_directory(scratch("rig"));
  says({"rig", "-o", "out.bag", "--stamp", "5"}, {.field = "--stamp", .about = "--stamp-offset"});
  says({"rig", "-o", "out.bag", "--terrain", "t"}, {.field = "--terrain"});
  fs::remove(scratch("rig"));
  write_text(scratch("cut.bag"), content("good.bag").substr(0, 5000));
  says({"cut.bag", "-o", "out"}, {.file = "cut.bag"});
  EXPECT_TRUE(bad_input(graspmap({"info", "cut.bag"}), {.file = "cut.bag"}));
  fs::remove(scratch("cut.bag"));
  EXPECT_EQ(graspmap_test::names_in_scratch(), before);
}

}  // namespace bag_test
