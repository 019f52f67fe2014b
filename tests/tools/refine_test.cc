#include <gtest/gtest.h>

#include "libmap/poses/trajectory_error.h"
#include "libmap/poses/trajectory_io.h"
#include "libmap/scan/scan_source.h"
#include "tests/tools/tool_test_support.h"

namespace {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::data_folder;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;

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
  // Odometry claims far more than its error; the closures of features are what it is measured by.
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
      libmap::trajectory_of(refined->graph(), libmap::PoseSource::stored),
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

TEST(Refine, BadInputIsOneLine) {
  GRASPMAP_REQUIRE_DATA();
  const std::string scan = scan_file("site_tiny_q.db");
  EXPECT_TRUE(bad_input(graspmap({"refine", scan, "-o", "poses.txt"}), {"poses.txt", ".tum"}));
  EXPECT_TRUE(bad_input(graspmap({"refine", scan, "-o", "p.tum", "--links", "links.tum"}),
                        {"--links", ".g2o"}));
  EXPECT_TRUE(bad_input(graspmap({"refine", "none.db", "-o", "p.tum"}), {"none.db"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("p.tum")));
}

}  // namespace
