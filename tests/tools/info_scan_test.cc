#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "tests/libmap/scan/sample_database.h"
#include "tests/tools/tool_test_support.h"

namespace info_scan_test {

using namespace graspmap_test;
using Json = nlohmann::json;

Json info(const std::string& file) {
  const ProgramResult result = graspmap({"info", file, "--json"});
  EXPECT_TRUE(succeeded(result));
  return Json::parse(result.standard_output);
}

TEST(InfoScan, SaysWhatADatabaseHolds) {
  write_sample(scratch("a.db"));
  execute(scratch("a.db"), "UPDATE Node SET weight = -1 WHERE id = 2");
  const Json json = info("a.db");
  EXPECT_EQ(json.at("kind"), "scan");
  EXPECT_EQ(json.at("file").at("version"), "0.23.0");
  EXPECT_EQ(json.at("file").at("schema"), "0.23.0");
  EXPECT_EQ(json.at("nodes"), 3);
  EXPECT_EQ(json.at("sessions").at(0).at("duration_s"), 2);
  EXPECT_EQ(json.at("weights"), (Json{{"normal", 2}, {"intermediate", 1}, {"invalid", 0}}));
  EXPECT_EQ(
      json.at("links"),
      (Json{{"all", 5}, {"neighbor", 2}, {"global closure", 1}, {"landmark", 1}, {"gravity", 1}}));
  EXPECT_EQ(json.at("labels"), 1);
  EXPECT_EQ(json.at("gps"), 3);
  const Json& odometry = json.at("poses").at("odometry");
  EXPECT_EQ(odometry.at("poses"), 3);
  // Two steps of (0.5, 0.125).
  EXPECT_NEAR(odometry.at("path_length_m"), 2 * std::hypot(0.5, 0.125), 1e-6);
  EXPECT_EQ(odometry.at("bounds_m").at("max"), (std::vector<double>{1.5, 0.375, 0.25}));
  // The truth is odometry in another frame; stored poses climb away from it.
  EXPECT_LT(json.at("trajectory_error").at("odometry").at("rmse_m"), 1e-6);
  EXPECT_GT(json.at("trajectory_error").at("optimized").at("rmse_m"), 1e-3);
  EXPECT_EQ(json.at("cameras").size(), 1U);
  EXPECT_EQ(json.at("cameras").at(0).at("fx"), 30);
  EXPECT_EQ(json.at("images"), (Json{{"PNG 32 x 24, color", 3}}));
  EXPECT_EQ(json.at("depth"), (Json{{"RVL 32 x 24", 3}}));
  EXPECT_EQ(json.at("calibrations"), (Json{{"1 camera, records", 3}}));
  EXPECT_EQ(json.at("laser_scans"), 1);
  EXPECT_GT(json.at("user_data_bytes"), 0);
  EXPECT_EQ(json.at("words"), 2);
  EXPECT_EQ(json.at("features"), 2);
  EXPECT_EQ(json.at("parameters"), 3);
  EXPECT_EQ(json.at("warnings"), Json::array());
  EXPECT_FALSE(json.contains("verification"));
}

TEST(InfoScan, Plainly) {
  write_sample(scratch("a.db"));
  const ProgramResult result = graspmap({"info", "a.db"});
  EXPECT_TRUE(succeeded(result));
  EXPECT_EQ(result.standard_error, "");
  for (const char* line :
       {"kind: scan\n", "  neighbor: 2\n", "  PNG 32 x 24, color: 3\n",
        "  session 0, nodes 3, begin_s 101.25, duration_s 2\n",
        "  width 32, height 24, fx 30, fy 31, cx 15.5, cy 11.5, distortion none\n"})
    EXPECT_NE(result.standard_output.find(line), std::string::npos) << line;
}

// Exit code 3 and one line on stderr; stdout has the list of faults.
void expect_broken(const ProgramResult& result, const std::string& count,
                   const std::string& scan = "a.db") {
  EXPECT_TRUE(ended_with(result, {.file = scan, .about = count}));
  EXPECT_EQ(std::count(result.standard_error.begin(), result.standard_error.end(), '\n'), 1);
}

TEST(InfoScan, VerifyListsWhatIsBrokenNodeByNode) {
  write_sample(scratch("a.db"));
  EXPECT_TRUE(succeeded(graspmap({"info", "a.db", "--verify"})));
  execute(scratch("a.db"), "UPDATE Data SET depth = substr(depth, 1, 100) WHERE id > 1");
  EXPECT_TRUE(succeeded(graspmap({"info", "a.db"})));
  const ProgramResult result = graspmap({"info", "a.db", "--verify"});
  expect_broken(result, "2 parts");
  EXPECT_NE(result.standard_output.find("node 2, part Data.depth, reason RVL ends after 100 bytes"),
            std::string::npos);
  const ProgramResult as_json = graspmap({"info", "a.db", "--verify", "--json"});
  expect_broken(as_json, "2 parts");
  const Json faults = Json::parse(as_json.standard_output).at("verification").at("faults");
  ASSERT_EQ(faults.size(), 2U);
  EXPECT_EQ(faults.at(1).at("node"), 3);
  EXPECT_EQ(faults.at(1).at("part"), "Data.depth");
}

TEST(InfoScan, VerifyListsWhatTheGraphLeavesOut) {
  write_sample(scratch("a.db"));
  execute(scratch("a.db"), "UPDATE Node SET pose = x'01' WHERE id = 1");
  execute(scratch("a.db"), "UPDATE Node SET env_sensors = 'warm' WHERE id = 2");
  execute(scratch("a.db"), "DELETE FROM Data WHERE id = 3");
  const ProgramResult result = graspmap({"info", "a.db", "--verify"});
  expect_broken(result, "3 parts");
  for (const char* line :
       {"node 1, part Node.pose", "node 2, part Node.env_sensors, reason is text",
        "node 3, part Data, reason the node has no row"})
    EXPECT_NE(result.standard_output.find(line), std::string::npos) << line;
  // Without --verify such a scan can still be looked at.
  EXPECT_EQ(graspmap({"info", "a.db"}).exit_code, 0);
}

TEST(InfoScan, FolderWhoseFirstFrameIsBroken) {
  write_sample(scratch("a.db"));
  ASSERT_TRUE(succeeded(graspmap({"convert", "a.db", "-o", "scan"})));
  std::filesystem::path first;
  for (const auto& entry : std::filesystem::directory_iterator(scratch("scan") / "color"))
    if (first.empty() || entry.path() < first) first = entry.path();
  std::filesystem::remove(first);
  EXPECT_EQ(graspmap({"info", "scan"}).exit_code, 0);
  expect_broken(graspmap({"info", "scan", "--verify"}), "1 part ", "scan");
}

TEST(InfoScan, SessionsAndErrorsOfTheirOdometry) {
  write_sample(scratch("a.db"));
  execute(scratch("a.db"),
          "INSERT INTO Node SELECT id + 10, 1, weight, stamp + 50, pose, ground_truth_pose, "
          "velocity, NULL, gps, env_sensors, NULL FROM Node");
  const Json json = info("a.db");
  EXPECT_EQ(json.at("sessions").size(), 2U);
  // The distance between sessions does not count.
  EXPECT_NEAR(json.at("poses").at("odometry").at("path_length_m"), 4 * std::hypot(0.5, 0.125),
              1e-6);
  EXPECT_TRUE(json.at("trajectory_error").contains("odometry 0"));
  EXPECT_TRUE(json.at("trajectory_error").contains("odometry 1"));
}

TEST(InfoScan, WhatIsNoScan) {
  write_text(scratch("empty.db"), "");
  EXPECT_TRUE(bad_input(graspmap({"info", "empty.db"}), {.file = "empty.db", .about = "empty: 0"}));
  write_text(scratch("text.db"), "hello");
  EXPECT_TRUE(bad_input(graspmap({"info", "text.db"}), {.file = "text.db"}));
  execute(scratch("other.db"), "CREATE TABLE T (id INTEGER)");
  EXPECT_TRUE(bad_input(graspmap({"info", "other.db"}), {.file = "other.db"}));
  EXPECT_TRUE(bad_input(graspmap({"info", "none.db"}), {.file = "none.db"}));
  std::filesystem::create_directory(scratch("folder"));
  EXPECT_TRUE(bad_input(graspmap({"info", "folder"}), {.file = "folder"}));
  write_terrain();
  EXPECT_TRUE(bad_input(graspmap({"info", "terrain.pcd", "--verify"}),
                        {.file = "terrain.pcd", .field = "--verify"}));
  EXPECT_EQ(names_in_scratch(),
            (std::vector<std::string>{"empty.db", "folder", "other.db", "terrain.pcd", "text.db"}));
}

// The table of data/README.md, and what RTAB-Map's own optimizer reached.
TEST(InfoScan, RealScan) {
  GRASPMAP_REQUIRE_DATA();
  const Json json = info((data_folder() / "scans/site_full.db").string());
  EXPECT_EQ(json.at("nodes"), 40);
  const Json& errors = json.at("trajectory_error");
  EXPECT_NEAR(errors.at("odometry").at("rmse_m"), 0.0050, 5e-5);
  EXPECT_NEAR(errors.at("odometry").at("max_m"), 0.0110, 5e-5);
  EXPECT_NEAR(errors.at("optimized").at("rmse_m"), 0.0068, 5e-5);
  EXPECT_NEAR(errors.at("optimized").at("mean_rotation_deg"), 0.40, 5e-3);
  EXPECT_EQ(json.at("images"), (Json{{"JPEG 512 x 424, color", 40}}));
}

}  // namespace info_scan_test
