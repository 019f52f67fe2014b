#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <utility>

#include "libmap/camera/camera_io.h"
#include "libmap/camera/image_codec.h"
#include "libmap/core/file_output.h"
#include "libmap/poses/trajectory_error.h"
#include "libmap/poses/trajectory_io.h"
#include "libmap/scan/scan_source.h"
#include "tests/tools/tool_test_support.h"

namespace refine_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::data_folder;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::ProgramResult;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::warned;

std::string scan_file(const std::string& name) { return data_folder() / "scans" / name; }

libmap::AbsoluteTrajectoryError error_of_file(const std::string& poses, const std::string& scan) {
  const auto source = libmap::open_scan(scan);
  const libmap::NodeTrajectory read =
      libmap::assign_nodes(libmap::read_trajectory(scratch(poses)).poses, source->graph());
  return libmap::absolute_trajectory_error(
      read.poses, libmap::trajectory_of(source->graph(), libmap::PoseSource::ground_truth));
}

TEST(Refine, DriftIsGone) {
  GRASPMAP_REQUIRE_DATA();
  const std::string scan = scan_file("site_drift.db");
  ASSERT_TRUE(succeeded(graspmap(
      {"refine", scan, "-o", "poses.tum", "--links", "links.g2o", "--report", "report.json"})));
  const auto error = error_of_file("poses.tum", scan);
  EXPECT_EQ(error.poses, 40U);
  EXPECT_LT(error.rmse_m, 0.001);
  EXPECT_LT(error.mean_rotation_deg, 0.03);
  const nlohmann::json report = json_of("report.json");
  EXPECT_NEAR(report.at("stages").front().at("absolute_error").at("rmse_m"), 0.0423, 0.0002);
  EXPECT_NEAR(report.at("stages").back().at("absolute_error").at("rmse_m"), error.rmse_m, 1e-6);
  EXPECT_EQ(report.at("nodes").size(), 40U);
  // Stated deviations of odometry exceed its errors, which feature links determine.
  EXPECT_LT(report.at("stages").at(2).at("links").at("neighbor").at("rotation_deviation_scale"),
            0.5);
  const libmap::TrajectoryFile graph = libmap::read_trajectory(scratch("links.g2o"));
  EXPECT_EQ(graph.poses.size(), 40U);
  EXPECT_EQ(graph.links.size(), report.at("links"));
  EXPECT_GT(graph.links.size(), 150U);
}

TEST(Refine, KilledScanGetsEveryNode) {
  GRASPMAP_REQUIRE_DATA();
  const std::string scan = scan_file("site_killed.db");
  ASSERT_TRUE(
      succeeded(graspmap({"refine", scan, "-o", "poses.tum", "--write-database", "refined.db"})));
  const auto error = error_of_file("poses.tum", scan);
  EXPECT_EQ(error.poses, 29U);
  EXPECT_LT(error.max_m, 0.006);
  const auto refined = libmap::open_scan(scratch("refined.db"));
  EXPECT_EQ(refined->graph().optimized_map_from_base.size(), 29U);
  EXPECT_GT(refined->graph().links.size(), 90U);
  const auto stored = libmap::absolute_trajectory_error(
      libmap::trajectory_of(refined->graph(), libmap::PoseSource::optimized),
      libmap::trajectory_of(refined->graph(), libmap::PoseSource::ground_truth));
  EXPECT_NEAR(stored.rmse_m, error.rmse_m, 1e-6);
  // A fused cloud takes the poses from the file.
  EXPECT_TRUE(succeeded(graspmap({"fuse", scan, "--poses", "poses.tum", "-o", "cloud.ply"})));
  EXPECT_NE(graspmap({"info", "refined.db"}).standard_output.find("local space closure"),
            std::string::npos);
}

TEST(Refine, SameBytesForThreadsAndSeed) {
  GRASPMAP_REQUIRE_DATA();
  const std::string scan = scan_file("site_tiny_q.db");
  for (const std::string threads : {"1", "2"})
    ASSERT_TRUE(
        succeeded(graspmap({"refine", scan, "-o", threads + ".tum", "--links", threads + ".g2o",
                            "--report", threads + ".json", "--threads", threads})));
  EXPECT_EQ(content("1.tum"), content("2.tum"));
  EXPECT_EQ(content("1.g2o"), content("2.g2o"));
  EXPECT_EQ(content("1.json"), content("2.json"));
}

// A scan as a TUM RGB-D folder of color and depth images, with true poses for the report only.
void extract_plain_folder(const std::string& scan, const std::string& folder) {
  namespace fs = std::filesystem;
  ASSERT_TRUE(succeeded(graspmap({"convert", scan, "-o", "whole"})));
  fs::create_directory(scratch(folder));
  for (const auto& [from, to] : {std::pair("color", "color"),
                                 {"depth", "depth"},
                                 {"poses_ground_truth.tum", "groundtruth.txt"},
                                 {"calibration/camera_1.yaml", "calibration.yaml"}})
    fs::rename(scratch("whole") / from, scratch(folder) / to);
  std::istringstream lines(content("whole/associations.txt"));
  std::ofstream color(scratch(folder) / "rgb.txt");
  std::ofstream depth(scratch(folder) / "depth.txt");
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with('#')) continue;
    std::istringstream words(line);
    std::string word[4];
    for (std::string& text : word) words >> text;
    color << word[0] << ' ' << word[1] << '\n';
    depth << word[2] << ' ' << word[3] << '\n';
  }
  std::ofstream(scratch(folder) / "scan.yaml") << "depth_unit_m: 0.001\npose_frame: base\n";
}

TEST(RefineWithoutPoses, APlainFolderOfImagesBecomesAMap) {
  GRASPMAP_REQUIRE_DATA();
  extract_plain_folder(scan_file("site_tiny_q.db"), "images");
  ASSERT_TRUE(
      succeeded(graspmap({"refine", "images", "-o", "poses.tum", "--report", "report.json"})));
  const nlohmann::json report = json_of("report.json");
  EXPECT_EQ(report.at("stages").at(0).at("stage"), "start: visual");
  const nlohmann::json& odometry = report.at("stages").at(2);
  EXPECT_EQ(odometry.at("stage"), "odometry");
  EXPECT_EQ(odometry.at("links"), 5);
  EXPECT_LT(odometry.at("absolute_error").at("rmse_m"), 0.01);
  EXPECT_TRUE(report.at("nodes_lost_by_odometry").empty());
  EXPECT_EQ(report.at("parts").size(), 1U);
  const auto error = error_of_file("poses.tum", scan_file("site_tiny_q.db"));
  EXPECT_EQ(error.poses, 6U);
  EXPECT_LT(error.rmse_m, 0.006);
  const auto fused = graspmap({"fuse", "images", "--poses", "poses.tum", "-o", "cloud.ply"});
  ASSERT_TRUE(succeeded(fused));
  EXPECT_EQ(json_of("cloud.ply.json").at("results").at("poses_in_file"), 6);
  EXPECT_EQ(json_of("cloud.ply.json").at("results").at("frames"), 6);
}

TEST(RefineWithoutPoses, NullPosesInADatabase) {
  GRASPMAP_REQUIRE_DATA();
  std::filesystem::copy_file(scan_file("site_tiny_q.db"), scratch("null.db"));
  std::filesystem::permissions(scratch("null.db"), std::filesystem::perms::owner_write,
                               std::filesystem::perm_options::add);
  {
    SQLite::Database database(scratch("null.db").string(), SQLite::OPEN_READWRITE);
    database.exec("UPDATE Node SET pose = NULL");
    database.exec("UPDATE Admin SET opt_ids = NULL, opt_poses = NULL");
    database.exec("DELETE FROM Link");
  }
  ASSERT_TRUE(succeeded(
      graspmap({"refine", "null.db", "-o", "poses.tum", "--write-database", "posed.db"})));
  EXPECT_LT(error_of_file("poses.tum", scan_file("site_tiny_q.db")).rmse_m, 0.006);
  const auto posed = libmap::open_scan(scratch("posed.db"));
  EXPECT_EQ(posed->graph().optimized_map_from_base.size(), 6U);
  EXPECT_GE(posed->graph().links.size(), 5U);
  EXPECT_TRUE(bad_input(graspmap({"refine", "null.db", "-o", "p.tum", "--start", "stored"}),
                        {.file = "null.db", .field = "poses", .value = "stored"}));
}

// Odometry with a drift of 42 mm is not used.
TEST(RefineWithoutPoses, ImagesAloneDriftLittle) {
  GRASPMAP_REQUIRE_DATA();
  ASSERT_TRUE(succeeded(
      graspmap({"refine", scan_file("site_drift.db"), "-o", "poses.tum", "--start", "visual",
                "--rounds", "0", "--no-bundle", "--icp", "off", "--report", "report.json"})));
  const nlohmann::json report = json_of("report.json");
  const nlohmann::json& odometry = report.at("stages").at(2);
  EXPECT_LT(odometry.at("absolute_error").at("rmse_m"), 0.0015);
  EXPECT_LT(odometry.at("absolute_error").at("mean_rotation_deg"), 0.05);
  EXPECT_EQ(odometry.at("lost_nodes"), 0);
  // 39 links: a mean of 234 squares of unit variance, correlated by the links' common frames.
  EXPECT_GT(odometry.at("squared_error_per_freedom"), 0.6);
  EXPECT_LT(odometry.at("squared_error_per_freedom"), 1.6);
}

TEST(RefineWithoutPoses, BareImagesAreBadInput) {
  GRASPMAP_REQUIRE_DATA();
  extract_plain_folder(scan_file("site_tiny_q.db"), "images");
  const auto bare = libmap::encode_png(libmap::ColorImage(512, 424, {90, 90, 90}));
  std::string list;
  std::istringstream lines(content("images/rgb.txt"));
  for (std::string stamp, name; lines >> stamp >> name;) list += stamp + " color/bare.png\n";
  libmap::write_text(scratch("images/rgb.txt"), list);
  libmap::write_text(scratch("images/color/bare.png"), bare);
  EXPECT_TRUE(bad_input(graspmap({"refine", "images", "-o", "poses.tum"}),
                        {.file = "images", .field = "frames", .value = "6"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("poses.tum")));
}

TEST(Refine, FeaturesAreKeptBesideTheOutput) {
  GRASPMAP_REQUIRE_DATA();
  const std::string scan = scan_file("site_tiny_q.db");
  ASSERT_TRUE(succeeded(graspmap({"refine", scan, "-o", "p.tum", "--feature-cache", "off"})));
  const std::string without = content("p.tum");
  EXPECT_FALSE(std::filesystem::exists(scratch("p.tum.features")));
  for (int run = 0; run < 2; ++run) {
    ASSERT_TRUE(succeeded(graspmap({"refine", scan, "-o", "p.tum"})));
    EXPECT_EQ(content("p.tum"), without);
    std::size_t files = 0;
    for (const auto& file : std::filesystem::directory_iterator(scratch("p.tum.features")))
      files += file.path().extension() == ".features" ? 1 : 0;
    EXPECT_EQ(files, 6U);
  }
  ASSERT_TRUE(succeeded(graspmap({"refine", scan, "-o", "q.tum", "--dry-run"})));
  EXPECT_FALSE(std::filesystem::exists(scratch("q.tum.features")));
}

// A stage that raises the held-out cost is rejected; both reports have the same content.
TEST(Refine, ReportsInJsonAndInText) {
  GRASPMAP_REQUIRE_DATA();
  ASSERT_TRUE(succeeded(graspmap({"refine", scan_file("site_tiny_q.db"), "-o", "p.tum", "--report",
                                  "r.json", "--report", "r.txt"})));
  const std::string text = content("r.txt");
  const nlohmann::json report = json_of("r.json");
  std::size_t evaluated = 0;
  for (const nlohmann::json& stage : report.at("stages")) {
    const bool rejected = stage.at("rejected");
    const std::string name = stage.at("stage");
    EXPECT_NE(text.find("\n" + name + (rejected ? ": rejected\n" : "\n")), std::string::npos)
        << name;
    if (!stage.contains("held_out")) continue;
    ++evaluated;
    EXPECT_TRUE(rejected || stage.at("held_out").at("change").get<double>() <= 1e-6) << name;
  }
  EXPECT_GE(evaluated, 3U);
  for (const std::string words :
       {"absolute error: rmse", "relative error: rmse", "held-out matches", "held-out surfaces",
        "links of neighbor", "standard deviations"})
    EXPECT_NE(text.find(words), std::string::npos) << words;
}

// A wrong stored camera is corrected, written, and applied by commands that read the scan.
// Nine frames along 10 cm determine no calibration: one that does not exist gains 2 %, and edges of
// few views seem to be displaced.
TEST(RefineCalibration, NoneIsFoundAlongAShortPath) {
  std::string path;
  for (int n = 0; n < 9; ++n)
    path += libmap::to_text(100.0 + 0.5 * n) + " " + libmap::to_text(-0.05 + 0.0125 * n) +
            " 0 1.3 0 0.3826834 0 0.9238795\n";
  libmap::write_text(scratch("path.tum"), path);
  ASSERT_TRUE(succeeded(graspmap({"simulate", "site", "-o", "site"})));
  for (const std::string seed : {"4", "5"}) {
    ASSERT_TRUE(succeeded(graspmap({"simulate", "scan", "site/mesh.ply", "--trajectory", "path.tum",
                                    "-o", seed + ".db", "--seed", seed})));
    const ProgramResult result = graspmap({"refine", seed + ".db", "-o", seed + ".tum"});
    ASSERT_TRUE(succeeded(result));
    EXPECT_FALSE(warned(result, {}));
    EXPECT_FALSE(json_of(seed + ".tum.json").at("results").contains("sensor"));
    EXPECT_LT(error_of_file(seed + ".tum", scratch(seed + ".db")).mean_rotation_deg, 0.02);
  }
}

TEST(RefineCalibration, IsWrittenAndApplied) {
  libmap::Camera camera{
      .width = 320, .height = 264, .fx = 228, .fy = 228, .cx = 159.5, .cy = 131.5};
  libmap::write_text(scratch("camera.yaml"), libmap::to_yaml({.camera = camera}));
  ASSERT_TRUE(succeeded(graspmap({"simulate", "site", "--edge-length", "0.03", "-o", "site"})));
  ASSERT_TRUE(
      succeeded(graspmap({"simulate", "scan", "site/mesh.ply", "-o", "scan.db", "--camera",
                          "camera.yaml", "--frames", "20", "--loops", "1", "--stored-focal-percent",
                          "1.5", "--stored-cx", "3", "--depth-corner", "0.012"})));
  ASSERT_TRUE(
      succeeded(graspmap({"refine", "scan.db", "-o", "poses.tum", "--write-calibration",
                          "found.yaml", "--write-database", "found.db", "--report", "r.json"})));
  const libmap::CameraFile found = libmap::read_camera(scratch("found.yaml"));
  EXPECT_NEAR(found.camera.fx, 228.0, 1.0) << "of 3.4 px";
  EXPECT_NEAR(found.camera.cx, 159.5, 0.5);
  ASSERT_FALSE(found.depth.empty());
  EXPECT_NEAR(found.depth.at(1.8, 1.0) - found.depth.at(1.8, 0.0), -0.012, 0.004);
  EXPECT_EQ(json_of("r.json").at("sensor").size(), 2U);
  EXPECT_LT(error_of_file("poses.tum", scratch("scan.db")).mean_rotation_deg, 0.1);
  // The copy is the scan as the calibration has it.
  const auto copy = libmap::open_scan(scratch("found.db"));
  const auto known = libmap::with_calibration(libmap::open_scan(scratch("scan.db")), found);
  const libmap::RgbdFrame a = copy->read_frame(7);
  const libmap::RgbdFrame b = known->read_frame(7);
  EXPECT_EQ(a.cameras.at(0).fx, found.camera.fx);
  EXPECT_EQ(b.cameras.at(0).fx, found.camera.fx);
  for (std::size_t n = 0; n < a.depth.pixels.size(); ++n)
    ASSERT_NEAR(a.depth.pixels[n], b.depth.pixels[n], 5.1e-4) << "whole millimeters";
  const ProgramResult fused = graspmap({"fuse", "scan.db", "--poses", "poses.tum", "--calibration",
                                        "found.yaml", "--voxel-size", "0.05", "-o", "cloud.ply"});
  ASSERT_TRUE(succeeded(fused));
  // Findings about the sensor (focal length, bend of depth, scale) are stored with the calibration.
  EXPECT_EQ(found.findings.size(), 3U);
  for (const std::string& output :
       {fused.standard_error, graspmap({"info", "found.yaml"}).standard_output,
        graspmap({"info", "found.db"}).standard_output})
    for (const std::string& finding : found.findings)
      EXPECT_NE(output.find(finding), std::string::npos) << finding << output;
  // The poses name their camera, and so do those that fuse corrects.
  const auto fuse = [&](const std::string& scan, const std::string& calibration,
                        const std::string& output) {
    return graspmap({"fuse", scan, "--poses", "poses.tum", "--calibration", calibration,
                     "--voxel-size", "0.05", "--corrected-poses", output + ".tum", "-o", output});
  };
  ASSERT_TRUE(succeeded(fuse("scan.db", "auto", "auto.ply")));
  EXPECT_EQ(graspmap_test::read_text(scratch("auto.ply")),
            graspmap_test::read_text(scratch("cloud.ply")));
  const auto camera_of = [&](const std::string& poses) {
    return json_of(poses + ".json").at("results").value("camera", "");
  };
  EXPECT_EQ(camera_of("poses.tum"), libmap::to_yaml(found));
  EXPECT_EQ(camera_of("auto.ply.tum"), libmap::to_yaml(found));
  EXPECT_FALSE(json_of("auto.ply.json").at("results").contains("camera"));
  ASSERT_TRUE(succeeded(fuse("scan.db", "stored", "stored.ply")));
  EXPECT_NE(graspmap_test::read_text(scratch("stored.ply")),
            graspmap_test::read_text(scratch("cloud.ply")));
  EXPECT_EQ(camera_of("stored.ply.tum"), "");
  // The copy has it already.
  ASSERT_TRUE(succeeded(fuse("found.db", "auto", "copy.ply")));
  ASSERT_TRUE(succeeded(fuse("found.db", "stored", "same.ply")));
  EXPECT_EQ(graspmap_test::read_text(scratch("copy.ply")),
            graspmap_test::read_text(scratch("same.ply")));
  EXPECT_TRUE(
      bad_input(graspmap({"fuse", "scan.db", "--calibration", "camera.yaml2", "-o", "c.ply"}),
                {.file = "camera.yaml2"}));
  camera.width = 321;
  libmap::write_text(scratch("other.yaml"), libmap::to_yaml({.camera = camera}));
  EXPECT_TRUE(bad_input(
      graspmap({"fuse", "scan.db", "--calibration", "other.yaml", "-o", "c.ply", "--quiet"}),
      {.file = "scan.db", .about = "image is 320 x 264"}));
}

// Invalid links and nodes without a calibration do not end refinement.
TEST(Refine, UnusableLinksAndFramesAreLeftOutAndNamed) {
  GRASPMAP_REQUIRE_DATA();
  std::filesystem::copy_file(scan_file("site_tiny_q.db"), scratch("scan.db"));
  std::filesystem::permissions(scratch("scan.db"), std::filesystem::perms::owner_all);
  {
    SQLite::Database file(scratch("scan.db"), SQLite::OPEN_READWRITE);
    file.exec("UPDATE Link SET information_matrix = zeroblob(288) WHERE from_id = 1 AND to_id = 2");
    file.exec("UPDATE Data SET calibration = NULL WHERE id = 4");
  }
  const auto result = graspmap({"refine", "scan.db", "-o", "p.tum"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_TRUE(warned(result, {"scan.db", "link 1 -> 2"}));
  EXPECT_TRUE(warned(result, {"node 4", "features"}));
}

// A length twice as long makes a scale twice as large.
TEST(Refine, KnownLengthsDetermineTheScale) {
  GRASPMAP_REQUIRE_DATA();
  const std::string scan = scan_file("site_tiny_q.db");
  const auto factor = [&](const std::string& known_length) {
    EXPECT_TRUE(succeeded(graspmap({"refine", scan, "--no-correct-depth", "--intrinsics", "fixed",
                                    "--known-length", known_length, "--known-length", known_length,
                                    "--force", "-o", "known.tum", "--report", "known.json"})));
    const nlohmann::json report = json_of("known.json");
    for (const nlohmann::json& stage : report.at("stages"))
      if (stage.at("stage") == "scale") return stage.at("factor").get<double>();
    return 0.0;
  };
  const double one = factor("1:20:60-1:100:60.5=1");
  EXPECT_GT(one, 0.0);
  EXPECT_NEAR(factor("1:20:60-1:100:60.5=2"), 2.0 * one, 1e-9);
  EXPECT_TRUE(bad_input(graspmap({"refine", scan, "-o", "p.tum", "--known-length", "1:2:3=1"}),
                        {.field = "known length", .value = "1:2:3=1"}));
}

// Scans of the same ground, or of another, with small images.
void write_scan(const std::string& name, const std::string& seed, const std::string& start_deg,
                const std::string& rock) {
  libmap::CameraFile file;
  file.camera = {.width = 192, .height = 160, .fx = 137, .fy = 137, .cx = 95.5, .cy = 79.5};
  graspmap_test::write_text(scratch("camera.yaml"), libmap::to_yaml(file));
  if (!std::filesystem::exists(scratch("scene.ply"))) {
    ASSERT_TRUE(succeeded(graspmap({"simulate", "scene", "--mesh", "-o", "scene.ply"})));
  }
  ASSERT_TRUE(
      succeeded(graspmap({"simulate", "scan", "scene.ply", "-o", name, "--camera", "camera.yaml",
                          "--frames", "16", "--loops", "1", "--texture", "rock", "--seed", seed,
                          "--rock-seed", rock, "--start", start_deg})));
}

TEST(RefineScans, OverlappingOnesAreJoinedAndOthersAreReported) {
  write_scan("a.db", "1", "0", "1");
  write_scan("b.db", "2", "7", "1");
  ASSERT_TRUE(succeeded(graspmap({"refine", "a.db", "b.db", "-o", "poses.tum"})));
  const auto joined = libmap::open_scans({scratch("a.db"), scratch("b.db")});
  const libmap::NodeTrajectory read =
      libmap::assign_nodes(libmap::read_trajectory(scratch("poses.tum")).poses, joined->graph());
  const auto error = libmap::absolute_trajectory_error(
      read.poses, libmap::trajectory_of(joined->graph(), libmap::PoseSource::ground_truth));
  EXPECT_EQ(error.poses, 32U);
  EXPECT_LT(error.rmse_m, 0.004);
  EXPECT_EQ(json_of("poses.tum.json").at("inputs").size(), 2U);
  // Other rock.
  write_scan("c.db", "3", "0", "9");
  const auto result = graspmap({"refine", "a.db", "c.db", "-o", "apart.tum"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_TRUE(warned(result, {"c.db"}));
  EXPECT_EQ(libmap::read_trajectory(scratch("apart.tum")).poses.size(), 16U);
  EXPECT_TRUE(
      bad_input(graspmap({"refine", "a.db", "b.db", "-o", "p.tum", "--write-database", "o.db"}),
                {.field = "--write-database", .value = "o.db"}));
  EXPECT_TRUE(bad_input(graspmap({"refine", "a.db", "a.db", "-o", "p.tum"}), {.file = "a.db"}));
}

TEST(RefineScans, BoardsThatAreNotThereAreBadInput) {
  write_scan("a.db", "1", "0", "1");
  const auto refined = [&](const std::vector<std::string>& options) {
    std::vector<std::string> words = {"refine", "a.db", "-o", "p.tum"};
    words.insert(words.end(), options.begin(), options.end());
    return graspmap(words);
  };
  EXPECT_TRUE(bad_input(refined({"--board", "8x6"}), {.field = "board", .value = "8x6"}));
  EXPECT_TRUE(bad_input(refined({"--board", "8x6:0.03"}),
                        {.file = "a.db", .field = "board", .value = "8x6:0.03"}));
  EXPECT_TRUE(bad_input(refined({"--board", "8x6:0.03", "--known-length", "1:20:60-1:100:60.5=1"}),
                        {.file = "a.db", .field = "board"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("p.tum")));
}

TEST(RefineScans, GivenScaleIsAppliedAndReported) {
  write_scan("a.db", "1", "0", "1");
  const auto refined = [&](const std::vector<std::string>& options) {
    std::vector<std::string> words = {"refine", "a.db", "-o", "p.tum"};
    words.insert(words.end(), options.begin(), options.end());
    return graspmap(words);
  };
  EXPECT_TRUE(bad_input(refined({"--scale", "3"}),
                        {.field = "--scale", .value = "3", .bound = ">= 0.5 and <= 2"}));
  EXPECT_TRUE(bad_input(refined({"--scale", "0.99", "--scale-from", "odometry"}),
                        {.file = "a.db", .field = "scale", .value = "0.99"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("p.tum")));
  const auto result = refined({"--scale", "0.99"});
  ASSERT_TRUE(succeeded(result));
  const std::string scale = json_of("p.tum.json").at("results").at("scale");
  EXPECT_NE(scale.find("0.99"), std::string::npos) << scale;
  EXPECT_NE(result.standard_error.find(scale), std::string::npos) << result.standard_error;
}

TEST(Refine, BadInputIsOneLine) {
  GRASPMAP_REQUIRE_DATA();
  const std::string scan = scan_file("site_tiny_q.db");
  EXPECT_TRUE(bad_input(graspmap({"refine", scan, "-o", "p.tum", "--report", "report.html"}),
                        {.field = "--report", .value = "report.html"}));
  EXPECT_TRUE(bad_input(graspmap({"refine", scan, "-o", "poses.txt"}),
                        {.file = "poses.txt",
                         .field = "extension",
                         .value = ".txt",
                         .bound = "one of .tum .kitti .g2o .toro .colmap"}));
  EXPECT_TRUE(bad_input(graspmap({"refine", scan, "-o", "p.tum", "--links", "links.tum"}),
                        {.field = "--links", .value = "links.tum"}));
  EXPECT_TRUE(bad_input(graspmap({"refine", "none.db", "-o", "p.tum"}), {.file = "none.db"}));
  EXPECT_TRUE(bad_input(graspmap({"refine", scan, "-o", "p.tum", "--gauge-node", "999"}),
                        {.field = "gauge_node", .value = "999"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("p.tum")));
}

}  // namespace refine_test
