#include <gtest/gtest.h>

#include "libmap/core/table.h"
#include "libmap/core/text.h"
#include "libmap/io/cloud_io.h"
#include "tests/tools/tool_test_support.h"

namespace analyze_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::warned;
using graspmap_test::write_terrain;
using libmap::PointCloud;

const std::vector<std::string> score_options = {"--solid-voxel-threshold",
                                                "1",
                                                "--graspability-threshold",
                                                "0.5",
                                                "--curvature-radius",
                                                "0",
                                                "--zero-plane",
                                                "-1"};

void score(const std::string& map, std::vector<std::string> options = {}) {
  std::vector<std::string> words = {"score", "terrain.pcd", "-o", map};
  words.insert(words.end(), score_options.begin(), score_options.end());
  words.insert(words.end(), options.begin(), options.end());
  ASSERT_TRUE(succeeded(graspmap(words)));
}

TEST(Analyze, WritesAFolderAndItsManifest) {
  write_terrain();
  score("map.pcd");
  ASSERT_TRUE(succeeded(graspmap({"analyze", "map.pcd", "-o", "out", "--border"})));
  for (const char* name : {"histogram.svg", "histogram.png", "by_height.png", "by_slope.svg",
                           "regions.png", "region_links.csv"})
    EXPECT_TRUE(std::filesystem::file_size(scratch("out") / name) > 0) << name;
  EXPECT_FALSE(std::filesystem::exists(scratch("out/change.csv")));
  const PointCloud map = libmap::read_cloud(scratch("map.pcd")).cloud;
  const PointCloud regions = libmap::read_cloud(scratch("out/regions.pcd")).cloud;
  ASSERT_EQ(regions.size(), map.size());
  EXPECT_EQ(regions.positions, map.positions);
  const auto summary = json_of("out/summary.json");
  EXPECT_EQ(summary.at("voxels").at("all"), map.size());
  // Bumpy ground of 0.6 x 0.6 m.
  EXPECT_NEAR(summary.at("evaluated").at("plan_area_m2").get<double>(), 0.36, 0.02);
  const libmap::Table table = libmap::read_csv(scratch("out/regions.csv"));
  EXPECT_EQ(table.rows.size(), summary.at("regions").at("count"));
  double most = 0.0;
  for (const double region : regions.find_field("region")->values) most = std::max(most, region);
  EXPECT_EQ(most, static_cast<double>(table.rows.size()));
  EXPECT_EQ(json_of("out.json").at("results").at("voxels"), map.size());
}

TEST(Analyze, AgainstItselfInAnotherFrameNothingChanges) {
  write_terrain();
  score("map.pcd");
  score("input.pcd", {"--frame", "input"});
  ASSERT_TRUE(succeeded(graspmap(
      {"analyze", "map.pcd", "--against", "input.pcd", "-o", "out", "--border", "--no-images"})));
  const auto change = json_of("out/summary.json").at("change");
  EXPECT_EQ(change.at("matching"), "lattice");
  EXPECT_EQ(change.at("evaluated").at("kappa").at("value"), 1.0);
  EXPECT_EQ(change.at("only_in_map").at("voxels"), 0);
  EXPECT_EQ(change.at("evaluated").at("score_difference").at("max"), 0.0);
  EXPECT_FALSE(std::filesystem::exists(scratch("out/change.png")));
  EXPECT_EQ(libmap::read_csv(scratch("out/change.csv")).rows[0][0], "common");
}

TEST(Analyze, SameBytesForAnyNumberOfThreadsAndAnyOrderOfPoints) {
  write_terrain();
  score("map.pcd");
  PointCloud map = libmap::read_cloud(scratch("map.pcd")).cloud;
  std::vector<std::size_t> order;
  for (std::size_t n = 0; n < map.size(); ++n) order.push_back((n * 7919) % map.size());
  ASSERT_NE(map.size() % 7919, 0U);
  libmap::write_cloud(scratch("turned.pcd"), libmap::select_points(map, order));
  std::filesystem::copy_file(scratch("map.pcd.json"), scratch("turned.pcd.json"));
  for (const auto& [file, threads] : {std::pair("map.pcd", "1"), std::pair("turned.pcd", "2")})
    ASSERT_TRUE(succeeded(
        graspmap({"analyze", file, "--against", "map.pcd", "-o", "by_" + std::string(threads),
                  "--threads", threads, "--no-images", "--border"})));
  for (const char* name : {"summary.json", "histogram.csv", "by_height.csv", "by_slope.csv",
                           "regions.csv", "region_links.csv", "change.csv", "change.pcd"})
    EXPECT_EQ(content("by_1/" + std::string(name)), content("by_2/" + std::string(name))) << name;
}

TEST(Analyze, MapsWithoutAManifestAndStarts) {
  std::string text = "x,y,z,score,graspable,i,j,k\n";
  for (int i = 0; i < 30; ++i)
    for (int j = 0; j < 10; ++j) {
      const bool good = i < 3 || (i >= 13 && i < 16);
      text += std::to_string(0.01 * i) + "," + std::to_string(0.01 * j) + ",0," +
              (good ? "0.9,1," : "0.2,0,") + std::to_string(i) + "," + std::to_string(j) + ",0\n";
    }
  graspmap_test::write_text(scratch("map.csv"), text);
  const auto result =
      graspmap({"analyze", "map.csv", "-o", "out", "--no-images", "--stride", "0.11"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_TRUE(warned(result, {"map.csv", "manifest"}));
  EXPECT_EQ(json_of("out.json").at("results").at("regions"), 2);
  auto regions = json_of("out/summary.json").at("regions");
  EXPECT_EQ(regions.at("groups"), 1);
  EXPECT_NEAR(regions.at("joining_stride_m").get<double>(), 0.11, 1e-6);
  ASSERT_TRUE(succeeded(graspmap({"analyze", "map.csv", "-o", "out", "--no-images", "--stride",
                                  "0.05", "--start", "0.18,0.05,0"})));
  regions = json_of("out/summary.json").at("regions");
  EXPECT_EQ(regions.at("start_region"), 2);
  EXPECT_EQ(regions.at("reachable_regions"), 1);
}

// Far from the origin, as in UTM coordinates, places keep their centimeters.
TEST(Analyze, PlacesFarFromTheOriginAreExact) {
  std::string map = "x,y,z,score,graspable,i,j,k\n";
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      map += libmap::to_fixed_text(691233.305 + 0.01 * i, 3) + "," +
             libmap::to_fixed_text(5334567.205 + 0.01 * j, 3) + ",100.005,0.9,1," +
             std::to_string(i) + "," + std::to_string(j) + ",0\n";
  graspmap_test::write_text(scratch("map.csv"), map);
  // --no-pictures is the earlier name of --no-images.
  ASSERT_TRUE(succeeded(graspmap({"analyze", "map.csv", "-o", "out", "--no-pictures"})));
  const libmap::Table regions = libmap::read_csv(scratch("out/regions.csv"));
  ASSERT_EQ(regions.rows.size(), 1U);
  EXPECT_NEAR(regions.number(0, regions.column("x")), 691233.315, 1e-3);
  EXPECT_NEAR(regions.number(0, regions.column("y")), 5334567.215, 1e-3);
}

TEST(Analyze, VoxelsTooLargeForTheirDistances) {
  std::string map = "x,y,z,score,graspable,edge\n";
  for (const char* x : {"5e199", "2.5e200", "4.5e200"})
    map += std::string(x) + ",5e199,5e199,0.5,1,0\n";
  graspmap_test::write_text(scratch("map.csv"), map);
  graspmap_test::write_text(
      scratch("map.csv.json"),
      R"({"made_by": "graspmap", "version": "0.1.0", "command": "score", "inputs": [],
          "parameters": {"voxel_size_m": 1e200, "zero_plane_m": 0.0}, "frame": "terrain",
          "transforms": {}, "results": {"lattice_origin_m": [0, 0, 0]}})");
  EXPECT_TRUE(bad_input(graspmap({"analyze", "map.csv", "-o", "out", "--no-images"}),
                        {.file = "map.csv",
                         .field = "voxel_size_m",
                         .value = "1e+200",
                         .bound = "1e-100 to 1e+100"}));
}

TEST(Analyze, BadInputIsSaidInOneLine) {
  write_terrain();
  EXPECT_TRUE(bad_input(graspmap({"analyze", "terrain.pcd", "-o", "out"}),
                        {.file = "terrain.pcd", .field = "score"}));
  EXPECT_TRUE(bad_input(graspmap({"analyze", "none.pcd", "-o", "out"}), {.file = "none.pcd"}));
  score("map.pcd");
  EXPECT_TRUE(bad_input(graspmap({"analyze", "map.pcd", "--against", "terrain.pcd", "-o", "out"}),
                        {.file = "terrain.pcd", .field = "score"}));
  EXPECT_TRUE(bad_input(graspmap({"analyze", "map.pcd", "-o", "out", "--stride", "0"}),
                        {.field = "--stride", .value = "0", .bound = "> 0"}));
  EXPECT_TRUE(bad_input(
      graspmap({"analyze", "map.pcd", "-o", "out", "--height-bin", "1e-9"}),
      {.file = "map.pcd", .field = "height_bin_m", .value = "1e-09", .bound = ">= 7e-07"}));
  EXPECT_TRUE(bad_input(graspmap({"analyze", "map.pcd", "-o", "out", "--start", "1,2"}),
                        {.field = "--start", .value = "1,2", .bound = "X,Y,Z"}));
  EXPECT_TRUE(bad_input(graspmap({"analyze", "map.pcd", "--against", "map.pcd", "-o", "out",
                                  "--transform", "50,0,0,0,0,0"}),
                        {.file = "map.pcd"}));
  EXPECT_TRUE(bad_input(graspmap({"analyze", "map.pcd", "-o", "out", "--transform", "bogus"}),
                        {.field = "--transform", .value = "bogus"}));
  EXPECT_TRUE(bad_input(graspmap({"analyze", "map.tiles", "-o", "out"}), {.file = "map.tiles"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("out")));
}

}  // namespace analyze_test
