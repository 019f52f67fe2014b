#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <fstream>
#include <numeric>
#include <sstream>

#include "libmap/core/text.h"
#include "libmap/io/cloud_io.h"
#include "libmap/poses/trajectory_io.h"
#include "libmap/scan/scan_source.h"
#include "tests/tools/tool_test_support.h"

namespace fuse_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::data_folder;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::warned;
using Words = std::vector<std::string>;

std::string scan_file(const std::string& name) { return data_folder() / "scans" / name; }

nlohmann::json compared(const std::string& cloud) {
  const auto result =
      graspmap({"compare", cloud, scan_file("site_ground_truth_mesh.ply"),
                "--transform=0,0,0,0,0,-90", "--box=-1.5,-1.5,-1,1.5,1.5,2", "--json"});
  EXPECT_TRUE(succeeded(result));
  return nlohmann::json::parse(result.standard_output);
}

TEST(Fuse, TrueAndStoredPosesLieNearTheTrueSurface) {
  GRASPMAP_REQUIRE_DATA();
  const std::string scan = scan_file("site_full.db");
  ASSERT_TRUE(succeeded(graspmap({"fuse", scan, "--poses", "ground-truth", "-o", "true.ply"})));
  const nlohmann::json by_truth = compared("true.ply");
  EXPECT_LT(by_truth.at("rmse_m"), 0.0020);
  EXPECT_LT(by_truth.at("median_m"), 0.0005);
  EXPECT_LT(by_truth.at("p95_m"), 0.0030);
  EXPECT_GT(by_truth.at("completeness"), 0.90) << "of all of the surface, seen or not";
  ASSERT_TRUE(succeeded(graspmap(
      {"fuse", scan, "--poses", "stored", "--frame", "ground-truth", "-o", "stored.ply"})));
  EXPECT_LT(compared("stored.ply").at("rmse_m"), 0.0065);
  const nlohmann::json manifest = json_of("stored.ply.json");
  EXPECT_EQ(manifest.at("frame"), "ground truth");
  EXPECT_EQ(manifest.at("parameters").at("poses"), "optimized") << "stored is another name of it";
  EXPECT_EQ(manifest.at("results").at("frames"), 40);
  // The error of the corrected poses; that of the stored poses is 6.8 mm.
  EXPECT_LT(manifest.at("results").at("trajectory_rmse_m"), 0.001);
  EXPECT_TRUE(manifest.at("transforms").contains("ground_truth_from_poses"));
}

TEST(Fuse, NamesTheQuaternionOrderThatFits) {
  GRASPMAP_REQUIRE_DATA();
  const std::string scan = scan_file("site_tiny.db");
  std::ofstream file(scratch("wxyz.tum"));
  for (const libmap::TrajectoryPose& pose :
       libmap::trajectory_of(libmap::open_scan(scan)->graph(), libmap::PoseSource::ground_truth)) {
    const Eigen::Vector3d p = pose.world_from_base.translation();
    const Eigen::Quaterniond q(pose.world_from_base.linear());
    for (const double value : {pose.stamp_s, p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z(),
                               static_cast<double>(pose.node)})
      file << libmap::to_text(value) << ' ';
    file << '\n';
  }
  file.close();
  const auto fuse = [&](const Words& more) {
    Words words = {"fuse", scan, "--poses", "wxyz.tum", "--voxel-size", "0.05", "-o", "cloud.ply"};
    words.insert(words.end(), more.begin(), more.end());
    const auto result = graspmap(words);
    EXPECT_TRUE(succeeded(result));
    return result;
  };
  EXPECT_TRUE(warned(fuse({}), {"--poses-quaternion wxyz"}));
  EXPECT_FALSE(warned(fuse({"--poses-quaternion", "wxyz"}), {}));
}

TEST(Fuse, ManifestCountsEveryPixel) {
  GRASPMAP_REQUIRE_DATA();
  ASSERT_TRUE(succeeded(graspmap({"fuse", scan_file("site_tiny_q.db"), "-o", "cloud.ply"})));
  const nlohmann::json manifest = json_of("cloud.ply.json");
  const nlohmann::json& results = manifest.at("results");
  std::int64_t sum = results.at("measurements_used").get<std::int64_t>();
  for (const char* reason : {"unmeasured", "out_of_range", "without_ray", "flying", "grazing"})
    sum += results.at("rejected_" + std::string(reason)).get<std::int64_t>();
  EXPECT_EQ(sum, results.at("pixels"));
  EXPECT_EQ(results.at("frames"), 6);
  EXPECT_EQ(manifest.at("parameters").at("poses"), "optimized");
  EXPECT_EQ(manifest.at("parameters").at("voxel_size_m"), 0.01);
  const libmap::PointCloud cloud = libmap::read_cloud(scratch("cloud.ply")).cloud;
  EXPECT_EQ(static_cast<std::int64_t>(cloud.size()), results.at("points"));
  EXPECT_TRUE(cloud.has_normals());
  EXPECT_TRUE(cloud.has_colors());
  ASSERT_NE(cloud.find_field("views"), nullptr);
  ASSERT_NE(cloud.find_field("expected_error"), nullptr);
  for (const double views : cloud.find_field("views")->values) {
    ASSERT_GE(views, 1);
    ASSERT_LE(views, 6);
  }
}

TEST(Fuse, SameBytesForAnyNumberOfThreads) {
  GRASPMAP_REQUIRE_DATA();
  std::string first;
  for (const std::string threads : {"1", "2", "8"}) {
    ASSERT_TRUE(succeeded(graspmap(
        {"fuse", scan_file("site_tiny_q.db"), "--threads", threads, "-o", threads + ".ply"})));
    if (first.empty()) first = content(threads + ".ply");
    EXPECT_TRUE(content(threads + ".ply") == first) << threads;
  }
}

// Rocky terrain, measured with the default noise and with 12 mm of noise.
TEST(Fuse, EstimatesTheNoiseOfTheSensor) {
  ASSERT_TRUE(succeeded(graspmap({"simulate", "site", "--edge-length", "0.02", "-o", "site"})));
  for (const std::string noise_m : {"0.002", "0.012"})
    ASSERT_TRUE(succeeded(graspmap({"simulate", "scan", "site/mesh.ply", "-o", noise_m + ".db",
                                    "--frames", "40", "--noise", noise_m, "--seed", "5"})));
  struct Fused {
    std::string noise;
    double error_m = 0.0;  // mean of the stated errors
  };
  const auto fused = [](const std::string& scan, const std::string& sensor) {
    EXPECT_TRUE(succeeded(graspmap({"fuse", scan, "--poses", "ground-truth", "--sensor", sensor,
                                    "-o", "cloud.ply", "--force"})));
    const std::vector<double> errors =
        libmap::read_cloud(scratch("cloud.ply")).cloud.find_field("expected_error")->values;
    return Fused{
        json_of("cloud.ply.json").at("results").at("noise"),
        std::accumulate(errors.begin(), errors.end(), 0.0) / static_cast<double>(errors.size())};
  };
  const Fused usual = fused("0.002.db", "auto");
  const Fused noisy = fused("0.012.db", "auto");
  const Fused given = fused("0.012.db", "kinect-v2");
  EXPECT_EQ(usual.noise, given.noise) << "both are those of a Kinect v2";
  EXPECT_NE(noisy.noise, given.noise);
  EXPECT_GT(noisy.error_m, 1.3 * given.error_m);
  EXPECT_GT(noisy.error_m, 2.0 * usual.error_m);
}

TEST(Fuse, PosesOfAFile) {
  GRASPMAP_REQUIRE_DATA();
  const std::string scan = scan_file("site_tiny_q.db");
  const auto source = libmap::open_scan(scan);
  libmap::Trajectory poses = libmap::trajectory_of(source->graph(), libmap::PoseSource::odometry);
  ASSERT_TRUE(succeeded(graspmap({"fuse", scan, "--poses", "odometry", "-o", "odometry.pcd"})));
  const libmap::PointCloud wanted = libmap::read_cloud(scratch("odometry.pcd")).cloud;
  for (const std::string file : {"poses.tum", "poses.g2o", "poses.kitti"}) {
    libmap::write_trajectory(scratch(file), {poses, {}}, true);
    const auto result = graspmap({"fuse", scan, "--poses", file, "-o", "cloud.pcd"});
    ASSERT_TRUE(succeeded(result)) << file;
    EXPECT_EQ(json_of("cloud.pcd.json").at("results").at("poses_in_file"), 6);
    EXPECT_EQ(json_of("cloud.pcd.json").at("results").at("frames"), 6);
    const libmap::PointCloud cloud = libmap::read_cloud(scratch("cloud.pcd")).cloud;
    // The file's numbers are rounded.
    EXPECT_NEAR(static_cast<double>(cloud.size()), static_cast<double>(wanted.size()),
                0.002 * static_cast<double>(wanted.size()));
    EXPECT_EQ(json_of("cloud.pcd.json").at("inputs").size(), 2U);
  }
  // Stamps alone, and a pose that belongs to no node.
  poses.pop_back();
  poses.push_back({0, 1e9, libmap::Pose::Identity()});
  libmap::write_trajectory(scratch("five.tum"), {poses, {}});
  const auto result = graspmap({"fuse", scan, "--poses", "five.tum", "-o", "five.pcd"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_EQ(json_of("five.pcd.json").at("results").at("poses_in_file"), 6);
  EXPECT_EQ(json_of("five.pcd.json").at("results").at("frames"), 5);
}

TEST(Fuse, EveryScanOfTheTestData) {
  GRASPMAP_REQUIRE_DATA();
  for (const std::string name : {"site_tiny.db", "site_tiny_v0160.db", "site_tiny_v0180.db"}) {
    ASSERT_TRUE(
        succeeded(graspmap({"fuse", scan_file(name), "--poses", "odometry", "-o", "cloud.ply"})));
    EXPECT_GT(json_of("cloud.ply.json").at("results").at("points"), 50000) << name;
  }
}

TEST(Fuse, TakesTheBestPosesThatAScanHas) {
  GRASPMAP_REQUIRE_DATA();
  const auto result = graspmap({"fuse", scan_file("site_tiny_v0160.db"), "-o", "cloud.ply"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_EQ(json_of("cloud.ply.json").at("parameters").at("poses"), "odometry");
}

// The transform is that of the corrected poses, not of the given ones.
TEST(Fuse, CloudInTheTrueFrameIsAlignedByItsOwnPoses) {
  GRASPMAP_REQUIRE_DATA();
  const std::string scan = scan_file("site_drift.db");
  ASSERT_TRUE(succeeded(graspmap({"fuse", scan, "--poses", "odometry", "--frame", "ground-truth",
                                  "--corrected-poses", "fused.tum", "-o", "cloud.ply"})));
  EXPECT_LT(compared("cloud.ply").at("median_m"), 0.0007);
  ASSERT_TRUE(succeeded(graspmap({"fuse", scan, "--poses", "fused.tum", "--frame", "ground-truth",
                                  "--registration-rounds", "0", "-o", "again.ply"})));
  const auto truth = [](const char* file) {
    return json_of(file).at("transforms").at("ground_truth_from_poses");
  };
  EXPECT_EQ(truth("cloud.ply.json"), truth("again.ply.json"));
}

TEST(Fuse, OdometryOfSeveralSessionsIsAWarning) {
  GRASPMAP_REQUIRE_DATA();
  std::filesystem::copy_file(scan_file("site_tiny_q.db"), scratch("scan.db"));
  std::filesystem::permissions(scratch("scan.db"), std::filesystem::perms::owner_all);
  const Words words = {"fuse", "scan.db", "--poses", "odometry", "-o", "cloud.ply", "--force"};
  EXPECT_FALSE(warned(graspmap(words), {"sessions"}));
  SQLite::Database(scratch("scan.db"), SQLite::OPEN_READWRITE)
      .exec("UPDATE Node SET map_id = 1 WHERE id > 3");
  EXPECT_TRUE(warned(graspmap(words), {"scan.db", "2 sessions"}));
}

TEST(Fuse, NodesWithoutAPoseAreCounted) {
  GRASPMAP_REQUIRE_DATA();
  const std::string scan = scan_file("site_tiny_q.db");
  libmap::Trajectory poses =
      trajectory_of(libmap::open_scan(scan)->graph(), libmap::PoseSource::odometry);
  poses.resize(4);
  libmap::write_trajectory(scratch("four.tum"), {poses, {}}, true);
  const Words words = {"fuse", scan, "--poses", "four.tum", "-o", "cloud.ply"};
  const auto result = graspmap(words);
  ASSERT_TRUE(succeeded(result));
  EXPECT_TRUE(warned(result, {scan, "2 of 6 nodes"}));
  Words strict = words;
  strict.insert(strict.end(), {"--strict", "--quiet"});
  EXPECT_TRUE(bad_input(graspmap(strict), {.field = "--poses", .value = "four.tum"}));
}

TEST(Fuse, PosesThatAreNotThere) {
  GRASPMAP_REQUIRE_DATA();
  const std::string killed = scan_file("site_killed.db");
  EXPECT_TRUE(bad_input(graspmap({"fuse", killed, "--sensor", "kinekt-v1", "-o", "cloud.ply"}),
                        {.field = "sensor", .value = "kinekt-v1", .about = "kinect-v1"}));
  EXPECT_TRUE(bad_input(graspmap({"fuse", killed, "--poses", "optimized", "-o", "cloud.ply"}),
                        {.field = "--poses", .value = "optimized"}));
  EXPECT_TRUE(bad_input(graspmap({"fuse", killed, "--poses", "odometri", "-o", "cloud.ply"}),
                        {.field = "--poses", .value = "odometri", .about = "'odometry'"}));
  EXPECT_TRUE(bad_input(graspmap({"fuse", killed, "--poses", "none.tum", "-o", "cloud.ply"}),
                        {.file = "none.tum"}));
  graspmap_test::write_text(scratch("far.tum"), "1 0 0 0 0 0 0 1\n");
  EXPECT_TRUE(bad_input(graspmap({"fuse", killed, "--poses", "far.tum", "-o", "cloud.ply"}),
                        {.file = "far.tum", .about = "20 ms"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("cloud.ply")));
}

TEST(Fuse, BadInput) {
  EXPECT_TRUE(bad_input(graspmap({"fuse", "none.db", "-o", "cloud.ply"}), {.file = "none.db"}));
  graspmap_test::write_text(scratch("text.db"), "this is no database at all, but it is a file\n");
  EXPECT_TRUE(bad_input(graspmap({"fuse", "text.db", "-o", "cloud.ply"}), {.file = "text.db"}));
  EXPECT_TRUE(bad_input(graspmap({"fuse", "text.db", "-o", "cloud.obj"}),
                        {.file = "cloud.obj",
                         .field = "extension",
                         .value = ".obj",
                         .bound = ".pcd, .ply, .csv or .vtp"}));
  EXPECT_TRUE(bad_input(graspmap({"fuse", "text.db", "-o", "cloud.ply", "--voxel-size", "0"}),
                        {.field = "--voxel-size", .value = "0", .bound = "> 0"}));
  EXPECT_TRUE(
      bad_input(graspmap({"fuse", "text.db", "-o", "cloud.ply", "--corrected-poses", "poses.csv"}),
                {.field = "--corrected-poses",
                 .value = "poses.csv",
                 .bound = ".tum, .kitti, .g2o or .toro"}));
  EXPECT_TRUE(graspmap_test::names_in_scratch() == std::vector<std::string>{"text.db"});
}

TEST(Fuse, SaysWhichLimitLeavesNothing) {
  GRASPMAP_REQUIRE_DATA();
  const std::string scan = scan_file("site_tiny_q.db");
  EXPECT_TRUE(
      bad_input(graspmap({"fuse", scan, "-o", "cloud.ply", "--quiet", "--voxel-size", "1e-9"}),
                {.field = "voxel_size_m", .value = "1e-09", .bound = "> 4.2385527e-06"}));
  const auto result = graspmap({"fuse", scan, "-o", "cloud.ply", "--min-views", "99"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_TRUE(warned(result, {"--min-views 99", "6 frames"}));
}

TEST(Fuse, DryRunWritesNothing) {
  GRASPMAP_REQUIRE_DATA();
  ASSERT_TRUE(
      succeeded(graspmap({"fuse", scan_file("site_tiny_q.db"), "-o", "cloud.ply", "--dry-run"})));
  EXPECT_TRUE(graspmap_test::names_in_scratch().empty());
}

}  // namespace fuse_test
