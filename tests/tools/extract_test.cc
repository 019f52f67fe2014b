#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "libmap/camera/image_codec.h"
#include "libmap/scan/rtabmap_reader.h"
#include "libmap/scan/rtabmap_writer.h"
#include "libmap/scan/scan_source.h"
#include "tests/libmap/scan/example_scan.h"
#include "tests/tools/tool_test_support.h"

namespace extract_test {

namespace fs = std::filesystem;
using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::ended_with;
using graspmap_test::ExampleScan;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::warned;

ExampleScan write_example(const libmap::RtabmapWriterOptions& options = {}) {
  const ExampleScan scan = graspmap_test::example_scan();
  graspmap_test::write_database(scratch("scan.db"), scan, options);
  return scan;
}

// All files under a folder of the scratch folder, by name.
std::map<std::string, std::string> files_in(const std::string& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(scratch(folder)))
    if (entry.is_regular_file())
      files[entry.path().lexically_relative(scratch(folder)).string()] =
          graspmap_test::read_text(entry.path());
  return files;
}

void expect_same_scan(const libmap::ScanSource& actual, const libmap::ScanSource& expected) {
  graspmap_test::expect_same_graph(actual.graph(), expected.graph(), 1e-14);
  for (const libmap::GraphNode& node : expected.graph().nodes) {
    SCOPED_TRACE("node " + std::to_string(node.id));
    graspmap_test::expect_same_frame(actual.read_frame(node.id), expected.read_frame(node.id));
  }
}

TEST(Extract, GivesAFolderThatIsTheSameScan) {
  write_example();
  ASSERT_TRUE(succeeded(graspmap({"convert", "scan.db", "-o", "out"})));
  const libmap::RtabmapDatabase database(scratch("scan.db"));
  expect_same_scan(*libmap::open_scan(scratch("out")), database);
  EXPECT_EQ(content("out/color/000009.jpg"), database.read_blobs(9).image);
  EXPECT_EQ(fs::exists(scratch("out/right")), false);
  const auto manifest = json_of("out.json");
  EXPECT_EQ(manifest["results"]["depth_images"], 4);
  EXPECT_EQ(manifest["results"]["ground_truth_poses"], 3);
  EXPECT_EQ(manifest["results"]["broken_frames"], 0);
  EXPECT_EQ(manifest["inputs"].size(), 1U);
}

TEST(Extract, OfAFolderGivesTheSameFolder) {
  write_example({.color = libmap::ImageFormat::png});
  ASSERT_TRUE(succeeded(graspmap({"convert", "scan.db", "-o", "one"})));
  ASSERT_TRUE(succeeded(graspmap({"convert", "one", "-o", "two"})));
  const auto one = files_in("one");
  const auto two = files_in("two");
  ASSERT_EQ(one.size(), two.size());
  for (const auto& [name, bytes] : one) {
    SCOPED_TRACE(name);
    ASSERT_EQ(two.count(name), 1U);
    // Quaternions go through rotation matrices: their last digit may differ.
    const bool has_rotations = name.find("poses_") == 0 || name == "links.g2o";
    EXPECT_TRUE(has_rotations || two.at(name) == bytes);
  }
  expect_same_scan(*libmap::open_scan(scratch("two")), *libmap::open_scan(scratch("one")));
}

TEST(Extract, DoesNotDependOnTheNumberOfThreads) {
  write_example();
  ASSERT_TRUE(succeeded(graspmap({"convert", "scan.db", "-o", "one", "--threads", "1"})));
  ASSERT_TRUE(succeeded(graspmap({"convert", "scan.db", "-o", "two", "--threads", "2"})));
  EXPECT_TRUE(files_in("one") == files_in("two"));
}

TEST(Extract, SaysThatFloatsWereRounded) {
  ExampleScan scan = graspmap_test::example_scan();
  const libmap::DepthImage exact = scan.frames.at(5).depth;
  for (float& depth : scan.frames.at(5).depth.pixels)
    if (depth > 0.0F) depth += 0.0003F;
  scan.frames.at(9).depth.pixels[7] = 70.0F;
  graspmap_test::write_database(scratch("scan.db"), scan,
                                {.depth = libmap::DepthFormat::float_png});
  const auto result = graspmap({"convert", "scan.db", "-o", "out"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_TRUE(warned(result, {"1 depth pixels", "65.5 m"}));
  EXPECT_EQ(json_of("out.json")["results"]["depth_images_rounded"], 2);
  EXPECT_TRUE(libmap::open_scan(scratch("out"))->read_frame(5).depth == exact);
}

TEST(Extract, OptionsOfImagesNeedImages) {
  write_example();
  for (const auto& [name, value] :
       {std::pair{"--poses", "odometry"}, std::pair{"--transform", "1,0,0,0,0,0"},
        std::pair{"--keep", "first"}})
    EXPECT_TRUE(bad_input(graspmap({"convert", "scan.db", "-o", "out", name, value}),
                          {.field = name, .about = "--bundler"}));
  EXPECT_FALSE(fs::exists(scratch("out")));
}

TEST(Extract, KeepsMillimeterPngsByteForByte) {
  write_example({.depth = libmap::DepthFormat::png16});
  ASSERT_TRUE(succeeded(graspmap({"convert", "scan.db", "-o", "out"})));
  EXPECT_EQ(content("out/depth/000002.png"),
            libmap::RtabmapDatabase(scratch("scan.db")).read_blobs(2).depth);
}

TEST(Extract, KeepsBothImagesOfAStereoPair) {
  libmap::RgbdFrame frame;
  frame.node = 3;
  frame.color = graspmap_test::random_color(40, 30);
  frame.right = libmap::GrayImage(40, 30, 77);
  libmap::StereoCamera pair;
  pair.left = graspmap_test::example_camera(40, 30);
  pair.right = pair.left;
  pair.baseline_m = 0.125;
  pair.right_from_left.translation().x() = -0.125;
  frame.stereo = {pair};
  libmap::RtabmapWriter writer(scratch("scan.db"));
  writer.add_node({.id = 3}, frame);
  writer.finish();
  const auto result = graspmap({"convert", "scan.db", "-o", "out"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_EQ(json_of("out.json").at("results").at("right_images"), 1);
  const libmap::RtabmapDatabase database(scratch("scan.db"));
  EXPECT_EQ(content("out/color/000003.jpg"), database.read_blobs(3).image);
  EXPECT_EQ(content("out/right/000003.jpg"), database.read_blobs(3).depth);
  const libmap::RgbdFrame read = libmap::open_scan(scratch("out"))->read_frame(3);
  ASSERT_EQ(read.stereo.size(), 1U);
  EXPECT_NEAR(read.stereo[0].baseline_m, 0.125, 1e-9);
  EXPECT_TRUE(read.right == database.read_frame(3).right);
}

// A depth blob that ends too early and a color blob that is no image.
void break_frames() {
  SQLite::Database database(scratch("scan.db").string(), SQLite::OPEN_READWRITE);
  database.exec("UPDATE Data SET depth = substr(depth, 1, 40) WHERE id = 2");
  database.exec("UPDATE Data SET image = X'0102030405060708' WHERE id = 5");
}

TEST(Extract, LeavesBrokenFramesOutAndNamesThem) {
  const ExampleScan scan = write_example();
  break_frames();
  const auto result = graspmap({"convert", "scan.db", "-o", "out"});
  ASSERT_TRUE(succeeded(result));
  for (const char* part : {"node 2: depth", "node 5: image"})
    EXPECT_TRUE(warned(result, {"scan.db", part}));
  EXPECT_EQ(json_of("out.json")["results"]["broken_frames"], 2);
  std::vector<std::string> images;
  for (const auto& [name, bytes] : files_in("out"))
    if (name.find("color/") == 0 || name.find("depth/") == 0) images.push_back(name);
  EXPECT_EQ(images, (std::vector<std::string>{"color/000001.jpg", "color/000009.jpg",
                                              "depth/000001.png", "depth/000009.png"}));
  // Their poses and links are sound.
  graspmap_test::expect_same_graph(libmap::open_scan(scratch("out"))->graph(), scan.graph, 2e-7);
}

TEST(Extract, EndsAtABrokenFrameIfAskedAndLeavesNothing) {
  write_example();
  break_frames();
  EXPECT_TRUE(bad_input(graspmap({"convert", "scan.db", "-o", "out", "--strict"}),
                        {.file = "scan.db", .field = "node 2: depth"}));
  EXPECT_EQ(graspmap_test::names_in_scratch(), std::vector<std::string>{"scan.db"});
}

TEST(Extract, ReplacesItsFolderAsAWhole) {
  write_example();
  ASSERT_TRUE(succeeded(graspmap({"convert", "scan.db", "-o", "out"})));
  const auto before = files_in("out");
  break_frames();
  EXPECT_TRUE(bad_input(graspmap({"convert", "scan.db", "-o", "out", "--strict"}),
                        {.file = "scan.db", .field = "node 2: depth"}));
  EXPECT_TRUE(files_in("out") == before);
  ASSERT_TRUE(succeeded(graspmap({"convert", "scan.db", "-o", "out/"})));
  EXPECT_EQ(files_in("out").count("color/000002.jpg"), 0U);
  // The folder contains a file of the user.
  graspmap_test::write_text(scratch("out/notes.txt"), "mine");
  for (const std::string force : {"--quiet", "--force"})
    EXPECT_TRUE(bad_input(graspmap({"convert", "scan.db", "-o", "out", force}), {.file = "out"}));
  EXPECT_EQ(content("out/notes.txt"), "mine");
}

TEST(Extract, WritesNothingInADryRun) {
  write_example();
  ASSERT_TRUE(succeeded(graspmap({"convert", "scan.db", "-o", "out", "--dry-run"})));
  EXPECT_EQ(graspmap_test::names_in_scratch(), std::vector<std::string>{"scan.db"});
}

TEST(Extract, RefusesWhatIsNoScanAndOutputsOfNoUse) {
  write_example();
  graspmap_test::write_text(scratch("empty.db"), "");
  graspmap_test::write_text(scratch("text.db"), "this is no database\n");
  fs::create_directory(scratch("folder"));
  for (const auto& [name, fault] : {std::pair{"missing.db", "no such"},
                                    {"empty.db", "0 bytes"},
                                    {"text.db", "a scan"},
                                    {"folder", "associations.txt"}})
    EXPECT_TRUE(
        bad_input(graspmap({"convert", name, "-o", "out"}), {.file = name, .about = fault}));
  EXPECT_FALSE(fs::exists(scratch("out")));
  EXPECT_TRUE(bad_input(graspmap({"convert", "scan.db", "-o", "text.db"}), {.file = "text.db"}));
  ASSERT_TRUE(succeeded(graspmap({"convert", "scan.db", "-o", "out"})));
  EXPECT_TRUE(bad_input(graspmap({"convert", "out", "-o", "out/"}), {.file = "out/"}));
}

TEST(Extract, FoldersOfOtherCommandsAreKept) {
  write_example();
  ASSERT_TRUE(succeeded(graspmap({"convert", "scan.db", "-o", "out"})));
  ASSERT_TRUE(succeeded(graspmap({"simulate", "site", "-o", "site", "--edge-length", "0.1"})));
  const auto site = files_in("site");
  EXPECT_TRUE(bad_input(graspmap({"convert", "scan.db", "-o", "site"}), {.file = "site"}));
  EXPECT_TRUE(files_in("site") == site);
  const auto before = files_in("out");
  EXPECT_TRUE(bad_input(graspmap({"simulate", "site", "-o", "out", "--edge-length", "0.1"}),
                        {.file = "out", .about = "--force"}));
  EXPECT_TRUE(files_in("out") == before);
  EXPECT_TRUE(
      succeeded(graspmap({"simulate", "site", "-o", "out", "--edge-length", "0.1", "--force"})));
}

// Cameras in Bundler's text: f, then R and t.
std::vector<std::vector<double>> bundle_cameras(const std::string& name) {
  std::istringstream lines(content(name));
  std::string header;
  std::getline(lines, header);
  std::size_t count = 0;
  std::size_t points = 0;
  lines >> count >> points;
  std::vector<std::vector<double>> cameras(count, std::vector<double>(15));
  for (std::vector<double>& camera : cameras)
    for (double& number : camera) lines >> number;
  EXPECT_FALSE(lines.fail());
  return cameras;
}

TEST(ExtractBundler, CamerasAndImagesOfEveryPose) {
  const ExampleScan scan = write_example({.color = libmap::ImageFormat::png});
  ASSERT_TRUE(succeeded(graspmap({"convert", "scan.db", "--bundler", "out", "--radius", "0",
                                  "--poses", "odometry", "--transform", "1,2,3,0,0,90"})));
  const libmap::Trajectory poses = libmap::trajectory_of(scan.graph, libmap::PoseSource::odometry);
  const auto cameras = bundle_cameras("out/bundle.out");
  ASSERT_EQ(cameras.size(), poses.size());
  std::istringstream list(content("out/list.txt"));
  const libmap::Pose site_from_map = libmap::make_pose_from_rpy({1, 2, 3}, {0, 0, 90});
  for (std::size_t n = 0; n < poses.size(); ++n) {
    std::string image;
    ASSERT_TRUE(std::getline(list, image));
    EXPECT_EQ(image, "images/00000" + std::to_string(poses[n].node) + ".jpg");
    const libmap::Camera& lens = scan.frames.at(poses[n].node).cameras.at(0);
    const libmap::ColorImage photo = libmap::decode_color(content("out/" + image));
    const std::vector<double>& c = cameras[n];
    EXPECT_EQ(c[0], std::max(lens.fx, lens.fy));
    // A point on the optical axis falls on the middle of the image, one to the right and below
    // it right and below.
    const libmap::Pose world_from_camera =
        site_from_map * poses[n].world_from_base * lens.base_from_camera;
    for (const Eigen::Vector3d& in_camera :
         {Eigen::Vector3d(0, 0, 2), Eigen::Vector3d(0.1, 0.05, 1)}) {
      const Eigen::Vector3d world = world_from_camera * in_camera;
      Eigen::Vector3d p(c[12], c[13], c[14]);
      for (std::size_t row = 0; row < 3; ++row)
        for (std::size_t column = 0; column < 3; ++column)
          p[static_cast<Eigen::Index>(row)] +=
              c[3 + 3 * row + column] * world[static_cast<Eigen::Index>(column)];
      EXPECT_NEAR(-c[0] * p.x() / p.z(), c[0] * in_camera.x() / in_camera.z(), 1e-3);
      EXPECT_NEAR(-c[0] * p.y() / p.z(), -c[0] * in_camera.y() / in_camera.z(), 1e-3);
    }
    EXPECT_LE(photo.width, lens.width);
    EXPECT_GT(photo.width, lens.width / 2);
  }
  const auto manifest = json_of("out.json");
  EXPECT_EQ(manifest["results"]["kept_images"], poses.size());
  EXPECT_EQ(manifest["parameters"]["poses"], "odometry");
}

TEST(ExtractBundler, KeepsOneOfImagesThatLookTheSameWay) {
  ExampleScan scan = graspmap_test::example_scan();
  // Three places 10 cm apart with one view, and one that looks the other way.
  const libmap::Pose there = libmap::make_pose_from_rpy({0, 0, 1}, {0, 0, 0});
  double x = 0;
  for (libmap::GraphNode& node : scan.graph.nodes) {
    node.odometry_from_base =
        libmap::make_pose_from_rpy({x, 0, 0}, {0, 0, node.id == 9 ? 180.0 : 0.0});
    x += 0.1;
    for (libmap::Camera& camera : scan.frames.at(node.id).cameras)
      camera.base_from_camera = there * libmap::optical_to_body_rotation();
  }
  libmap::RtabmapWriter writer(scratch("scan.db"), {});
  for (const libmap::GraphNode& node : scan.graph.nodes)
    writer.add_node(node, scan.frames.at(node.id));
  writer.finish();
  const auto kept = [&](const std::vector<std::string>& more) {
    std::vector<std::string> words = {"convert", "scan.db", "--bundler",
                                      "out",     "--poses", "odometry"};
    words.insert(words.end(), more.begin(), more.end());
    EXPECT_TRUE(succeeded(graspmap(words)));
    return content("out/list.txt");
  };
  EXPECT_EQ(kept({"--keep", "first"}), "images/000001.jpg\nimages/000009.jpg\n");
  EXPECT_EQ(files_in("out").size(), 4U) << "no picture of an earlier run is left";
  EXPECT_EQ(kept({"--keep", "first", "--radius", "0.15"}),
            "images/000001.jpg\nimages/000005.jpg\nimages/000009.jpg\n");
  EXPECT_EQ(kept({"--keep", "first", "--angle", "180"}), "images/000001.jpg\n");
  const std::string sharpest = kept({});
  EXPECT_EQ(std::count(sharpest.begin(), sharpest.end(), '\n'), 2);
  EXPECT_EQ(kept({"--threads", "1"}), sharpest);
}

TEST(ExtractBundler, BesideTheWholeScan) {
  write_example();
  ASSERT_TRUE(succeeded(graspmap({"convert", "scan.db", "-o", "all", "--bundler", "pictures"})));
  EXPECT_EQ(files_in("all").count("nodes.csv"), 1U);
  EXPECT_EQ(files_in("pictures").count("bundle.out"), 1U);
  EXPECT_FALSE(json_of("all.json")["results"].contains("kept_images"));
  EXPECT_FALSE(json_of("pictures.json")["results"].contains("depth_images"));
}

TEST(ExtractBundler, BadInput) {
  write_example();
  EXPECT_TRUE(bad_input(graspmap({"convert", "scan.db", "--bundler", "out", "--angle", "181"}),
                        {.field = "--angle", .value = "181", .bound = ">= 0 and <= 180"}));
  EXPECT_TRUE(
      bad_input(graspmap({"convert", "scan.db", "--bundler", "out", "--poses", "optimised"}),
                {.field = "--poses", .value = "optimised", .about = "'optimized'"}));
  EXPECT_TRUE(bad_input(graspmap({"convert", "scan.db", "--bundler", "out", "--transform", "1,2"}),
                        {.field = "--transform", .value = "1,2"}));
  EXPECT_TRUE(succeeded(graspmap({"convert", "scan.db", "--bundler", "out", "--dry-run"})));
  EXPECT_EQ(graspmap_test::names_in_scratch(), std::vector<std::string>{"scan.db"});
  break_frames();
  const auto result =
      graspmap({"convert", "scan.db", "--bundler", "out", "--radius", "0", "--poses", "odometry"});
  EXPECT_TRUE(succeeded(result));
  EXPECT_TRUE(warned(result, {"scan.db", "node 5: image"}));
  EXPECT_EQ(files_in("out").count("images/000005.jpg"), 0U);
  const auto strict =
      graspmap({"convert", "scan.db", "--bundler", "two", "--poses", "odometry", "--strict"});
  EXPECT_TRUE(ended_with(strict, {.file = "scan.db", .field = "node 5: image"}));
}

TEST(ExtractBundler, AScanWithoutColor) {
  ExampleScan scan = graspmap_test::example_scan();
  for (auto& [node, frame] : scan.frames) frame.color = {};
  graspmap_test::write_database(scratch("scan.db"), scan);
  for (const char* kind : {"--bundler", "--colmap"}) {
    const auto result = graspmap({"convert", "scan.db", kind, "out", "--poses", "odometry"});
    EXPECT_TRUE(ended_with(result, {.file = "scan.db"}));
  }
  EXPECT_EQ(graspmap_test::names_in_scratch(), std::vector<std::string>{"scan.db"});
}

TEST(Extract, TakesEveryRealScan) {
  GRASPMAP_REQUIRE_DATA();
  for (const char* name : {"site_killed", "site_tiny", "site_tiny_q", "site_tiny_v0160",
                           "site_tiny_v0180", "site_v0160", "site_drift", "site_full"}) {
    SCOPED_TRACE(name);
    const fs::path path = graspmap_test::data_folder() / "scans" / (std::string(name) + ".db");
    const auto result = graspmap({"convert", path.string(), "-o", name});
    ASSERT_TRUE(succeeded(result));
    EXPECT_FALSE(warned(result, {}));
    const auto scan = libmap::open_scan(path);
    const auto read = libmap::open_scan(scratch(name));
    graspmap_test::expect_same_graph(read->graph(), scan->graph(), 1e-14);
    const int last = scan->graph().nodes.back().id;
    graspmap_test::expect_same_frame(read->read_frame(last), scan->read_frame(last), 1e-9);
  }
}

}  // namespace extract_test
