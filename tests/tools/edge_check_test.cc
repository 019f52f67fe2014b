#include <gtest/gtest.h>

#include <cmath>

#include "libmap/core/pose.h"
#include "libmap/core/table.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "tests/tools/tool_test_support.h"

namespace edge_check_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using Words = std::vector<std::string>;

// A site of 3 x 2 m whose ground rises by 1 mm for each meter along x from z = 0 in its middle.
double height_at(double x) { return 0.001 * x; }

libmap::PointCloud site_cloud(const libmap::Pose& map_from_site = libmap::Pose::Identity()) {
  libmap::PointCloud cloud;
  for (int x = -150; x <= 150; ++x)
    for (int y = -100; y <= 100; ++y)
      cloud.positions.push_back(map_from_site *
                                Eigen::Vector3d(0.01 * x, 0.01 * y, height_at(0.01 * x)));
  return cloud;
}

libmap::TriangleMesh site_mesh(double lift) {
  libmap::TriangleMesh mesh;
  mesh.vertices = {{-1.5, -1, height_at(-1.5) + lift},
                   {1.5, -1, height_at(1.5) + lift},
                   {1.5, 1, height_at(1.5) + lift},
                   {-1.5, 1, height_at(-1.5) + lift}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

nlohmann::json checked(Words words) {
  words.insert(words.begin(), {"compare", "--edges"});
  words.emplace_back("--json");
  const auto result = graspmap(words);
  EXPECT_TRUE(succeeded(result));
  return nlohmann::json::parse(result.standard_output);
}

TEST(SpotCheckCommand, TableOfTheThesis) {
  libmap::write_cloud(scratch("site.ply"), site_cloud());
  const auto result =
      graspmap({"compare", "--edges", "site.ply", "--ground", "zero", "-o", "check.csv"});
  ASSERT_TRUE(succeeded(result));
  const libmap::Table table = libmap::read_csv(scratch("check.csv"));
  EXPECT_EQ(table.columns,
            (Words{"edge", "e1_m", "e2_m", "e3_m", "e4_m", "e5_m", "e6_m", "e7_m", "mean_m"}));
  ASSERT_EQ(table.rows.size(), 4U);
  for (std::size_t e = 0; e < 4; ++e) EXPECT_EQ(table.rows[e][0], std::string(1, "abcd"[e]));
  // Edge a: at -9/7, -6/7, ... of the middle, c the same backwards; b and d 5 cm inside.
  for (std::size_t n = 0; n < 7; ++n) {
    const double x = 3.0 * ((static_cast<double>(n) + 0.5) / 7 - 0.5);
    EXPECT_NEAR(table.number(0, n + 1), std::abs(height_at(x)), 6e-5);
    EXPECT_NEAR(table.number(2, n + 1), std::abs(height_at(x)), 6e-5);
    EXPECT_NEAR(table.number(1, n + 1), height_at(1.45), 6e-5);
    EXPECT_NEAR(table.number(3, n + 1), height_at(1.45), 6e-5);
  }
  for (const char* line : {"height error in m along the edges (ground: z = 0)", "edge        e1",
                           "mean of 28 locations: 0.0011 m", "0.040 m"})
    EXPECT_NE(result.standard_output.find(line), std::string::npos) << result.standard_output;
  const nlohmann::json results = json_of("check.csv.json").at("results");
  EXPECT_EQ(results.at("measured"), 28);
  EXPECT_NEAR(results.at("mean_m"), (1.45e-3 + 1.5e-3 * 24.0 / 49) / 2, 2e-5);
  EXPECT_NEAR(results.at("mean_signed_m"), 0.0, 1e-6);
}

TEST(SpotCheckCommand, GroundIsZeroOfALevelledSiteElseFitted) {
  const libmap::Pose map_from_site = libmap::make_pose_from_rpy({0.2, 0.1, 1.7}, {5, -4, 0});
  libmap::write_cloud(scratch("map.ply"), site_cloud(map_from_site));
  const nlohmann::json fitted = checked({"map.ply"});
  EXPECT_EQ(fitted.at("ground"), "fitted plane");
  EXPECT_LT(fitted.at("mean_m"), 1e-5) << "the slope is the plane's";
  // Manifest that crop writes for a levelled site.
  libmap::write_cloud(scratch("site.ply"), site_cloud());
  graspmap_test::write_text(
      scratch("site.ply.json"),
      R"({"made_by": "graspmap", "version": "0", "command": "crop", "parameters": {}, "inputs": [],
          "units": {"length": "m", "angle": "deg"}, "frame": "site",
          "transforms": {"site_from_map": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]}, "results": {},
          "run": {"threads": 1, "timings_s": {}}})");
  const nlohmann::json levelled = checked({"site.ply"});
  EXPECT_EQ(levelled.at("ground"), "z = 0");
  EXPECT_GT(levelled.at("mean_m"), 1e-3);
  EXPECT_LT(checked({"site.ply", "--ground", "fit"}).at("mean_m"), 1e-5);
}

TEST(SpotCheckCommand, MeshAgainstTheTruth) {
  libmap::write_mesh(scratch("truth.ply"), site_mesh(0.0));
  libmap::write_mesh(scratch("mesh.ply"), site_mesh(-0.003));
  const nlohmann::json json = checked({"mesh.ply", "--truth", "truth.ply"});
  EXPECT_NEAR(json.at("mean_m"), 0.003, 1e-6);
  EXPECT_NEAR(json.at("mean_signed_m"), -0.003, 1e-6);
  EXPECT_NEAR(json.at("max_m"), 0.003, 1e-6);
  EXPECT_NEAR(json.at("edges").at(1).at("positions").at(0).at("ground_m"), height_at(1.45), 1e-6);
  libmap::write_cloud(scratch("cloud.ply"), site_cloud());
  EXPECT_LT(checked({"cloud.ply", "--truth", "truth.ply"}).at("mean_m"), 2e-5);
}

TEST(SpotCheckCommand, PlacesWithoutDataAreCounted) {
  libmap::PointCloud cloud = site_cloud();
  std::erase_if(cloud.positions, [](const auto& p) { return p.x() > 0 && p.y() < 0; });
  libmap::write_cloud(scratch("site.ply"), cloud);
  const auto result = graspmap({"compare", "--edges", "site.ply", "--ground", "zero",
                                "--positions-per-edge", "4", "-o", "check.csv"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_NE(result.standard_output.find("locations without data: 4"), std::string::npos);
  const libmap::Table table = libmap::read_csv(scratch("check.csv"));
  EXPECT_EQ(table.rows[0][3], "");
  EXPECT_EQ(table.rows[1][1], "");
  EXPECT_NE(table.rows[1][3], "");
  EXPECT_EQ(json_of("check.csv.json").at("results").at("missing"), 4);
}

TEST(SpotCheckCommand, SiteInABoxAndTurned) {
  // Points far outside, and far above, are no part of the box.
  libmap::PointCloud cloud = site_cloud();
  cloud.positions.emplace_back(9, 9, 9);
  for (int n = 0; n < 4000; ++n) cloud.positions.emplace_back(-1.5 + 0.00075 * n, -0.95, 2.5);
  libmap::write_cloud(scratch("site.ply"), cloud);
  const nlohmann::json box =
      checked({"site.ply", "--ground", "zero", "--box=-1.5,-1,-0.5,1.5,1,2"});
  EXPECT_EQ(box.at("missing"), 0);
  EXPECT_LT(box.at("max_m"), 0.0016);
  EXPECT_GT(checked({"site.ply", "--ground", "zero", "--outline", "axes"}).at("missing"), 10);
  const libmap::Pose turn = libmap::make_pose_from_rpy({4, 5, 0}, {0, 0, 30});
  libmap::write_cloud(scratch("turned.ply"), site_cloud(turn));
  const nlohmann::json turned = checked({"turned.ply", "--ground", "zero", "--outline", "turned"});
  const Eigen::Vector3d corner = turn * Eigen::Vector3d(-1.5, -1, 0);
  EXPECT_NEAR(turned.at("corners_m").at(0).at(0), corner.x(), 1e-5);
  EXPECT_NEAR(turned.at("corners_m").at(0).at(1), corner.y(), 1e-5);
  EXPECT_EQ(turned.at("missing"), 0);
  EXPECT_NEAR(turned.at("mean_m"), (1.45e-3 + 1.5e-3 * 24.0 / 49) / 2, 2e-5);
}

// A floor below the box is no part of it, of a mesh as of a cloud.
TEST(SpotCheckCommand, MeshBelowTheBoxHasNoHeight) {
  libmap::write_mesh(scratch("mesh.ply"), site_mesh(-1.0));
  const Words words = {"mesh.ply", "--ground", "zero"};
  Words above = words;
  above.emplace_back("--box=-1.5,-1,-0.3,1.5,1,0.5");
  above.insert(above.begin(), {"compare", "--edges"});
  EXPECT_TRUE(bad_input(graspmap(above), {.file = "mesh.ply"}));
  Words around = words;
  around.emplace_back("--box=-1.5,-1,-1.3,1.5,1,0.5");
  EXPECT_EQ(checked(around).at("missing"), 0);
}

TEST(SpotCheckCommand, BadInput) {
  libmap::write_cloud(scratch("site.ply"), site_cloud());
  libmap::write_mesh(scratch("mesh.ply"), site_mesh(0.0));
  const auto run = [](Words more) {
    more.insert(more.begin(), {"compare", "--edges", "site.ply", "--quiet"});
    return graspmap(more);
  };
  EXPECT_TRUE(bad_input(graspmap({"compare", "--edges", "none.ply"}), {.file = "none.ply"}));
  EXPECT_TRUE(bad_input(run({"-o", "check.txt"}), {.file = "check.txt"}));
  EXPECT_TRUE(
      bad_input(run({"--positions-per-edge", "0"}),
                {.field = "--positions-per-edge", .value = "0", .bound = ">= 1 and <= 10000"}));
  EXPECT_TRUE(
      bad_input(run({"--inset", "1"}), {.file = "site.ply", .field = "inset_m", .value = "1"}));
  EXPECT_TRUE(
      bad_input(run({"--radius", "0"}), {.field = "--radius", .value = "0", .bound = "> 0"}));
  EXPECT_TRUE(bad_input(run({"--ground", "plane"}),
                        {.field = "--ground", .value = "plane", .bound = "one of auto zero fit"}));
  EXPECT_TRUE(bad_input(
      run({"--box", "0,0,0,0,0,0"}),
      {.file = "site.ply", .field = "width and depth", .value = "0 m, 0 m", .bound = "> 0"}));
  EXPECT_TRUE(bad_input(run({"--box", "10,10,0,12,12,1"}), {.file = "site.ply"}));
  EXPECT_TRUE(bad_input(run({"--truth", "mesh.ply", "--ground", "fit"}),
                        {.field = "--ground", .about = "--truth"}));
  EXPECT_TRUE(bad_input(run({"--truth", "site.ply"}), {.file = "site.ply", .field = "triangles"}));
  libmap::write_cloud(scratch("empty.ply"), {});
  EXPECT_TRUE(bad_input(graspmap({"compare", "--edges", "empty.ply", "--ground", "zero"}),
                        {.file = "empty.ply", .field = "points"}));
  ASSERT_TRUE(succeeded(run({"--ground", "zero", "-o", "check.csv", "--dry-run"})));
  EXPECT_EQ(graspmap_test::names_in_scratch(), (Words{"empty.ply", "mesh.ply", "site.ply"}));
}

// The target of the error on the demo site is relative to its real ground (libmap/mesh/README.md).
TEST(SpotCheckCommand, TrueMeshOfTheTestSite) {
  GRASPMAP_REQUIRE_DATA();
  const std::string mesh = graspmap_test::data_folder() / "scans/site_ground_truth_mesh.ply";
  const nlohmann::json json = checked({mesh, "--ground", "zero", "--box=-1.5,-1.5,-1,1.5,1.5,2"});
  EXPECT_EQ(json.at("measured"), 28);
  EXPECT_EQ(json.at("published_mean_m"), 0.04);
}

}  // namespace edge_check_test
