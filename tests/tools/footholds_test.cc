#include <gtest/gtest.h>

#include <cmath>

#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "tests/tools/tool_test_support.h"

namespace footholds_test {

using graspmap_test::bad_input;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::warned;
using graspmap_test::write_terrain;
using libmap::PointCloud;

TEST(Footholds, OfAMapInEitherFrame) {
  write_terrain();
  for (const char* frame : {"terrain", "input"}) {
    const std::string map = std::string("map_") + frame + ".pcd";
    ASSERT_TRUE(succeeded(graspmap({"score", "terrain.pcd", "-o", map, "--frame", frame, "--method",
                                    "corrected", "--solid-voxel-threshold", "1"})));
    ASSERT_TRUE(succeeded(graspmap(
        {"footholds", map, "-o", std::string(frame) + ".ply", "--no-graspable-only", "--border"})));
  }
  const PointCloud terrain = libmap::read_cloud(scratch("terrain.ply")).cloud;
  const PointCloud input = libmap::read_cloud(scratch("input.ply")).cloud;
  ASSERT_GT(terrain.size(), 5U);
  ASSERT_EQ(terrain.size(), input.size());
  // Rotated locations: slopes are relative to the same plane, but among equally near voxels around
  // a location others may be selected.
  for (std::size_t n = 0; n < terrain.size(); ++n)
    EXPECT_NEAR(terrain.find_field("slope_deg")->values[n],
                input.find_field("slope_deg")->values[n], 5.0);
  const auto json = json_of("input.ply.json");
  EXPECT_EQ(json.at("frame"), "input");
  EXPECT_EQ(json.at("results").at("footholds"), input.size());
}

TEST(Footholds, EdgesThatAreLeftOutAreSaid) {
  graspmap_test::write_text(scratch("map.csv"),
                            "x,y,z,score,graspable,edge\n0,0,0,0.9,1,1\n0.01,0,0,0.9,1,1\n");
  const auto result = graspmap({"footholds", "map.csv", "-o", "f.csv"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_TRUE(warned(result, {"map.csv", "2", "--border"}));
  ASSERT_TRUE(succeeded(graspmap({"footholds", "map.csv", "-o", "e.csv", "--border"})));
  EXPECT_EQ(libmap::read_cloud(scratch("e.csv")).cloud.size(), 1U);
}

// Round hills of 7 cm on a plane, and a map whose best location is on the plane.
void write_hills() {
  libmap::TriangleMesh mesh;
  libmap::PointCloud map;
  constexpr int count = 161;
  const auto height = [](double x, double y) {
    return 0.05 * std::exp(-(std::pow(std::abs(x) - 0.4, 2) + y * y) / 0.005);
  };
  for (int i = 0; i < count; ++i)
    for (int j = 0; j < count; ++j) {
      const double x = 0.01 * i - 0.8, y = 0.01 * j - 0.8;
      mesh.vertices.emplace_back(x, y, height(x, y));
    }
  for (std::uint32_t i = 0; i + 1 < count; ++i)
    for (std::uint32_t j = 0; j + 1 < count; ++j) {
      const std::uint32_t n = i * count + j;
      mesh.triangles.push_back({n, n + count, n + count + 1});
      mesh.triangles.push_back({n, n + count + 1, n + 1});
    }
  libmap::write_mesh(scratch("hills.ply"), mesh);
  map.positions = {{-0.4, 0, 0.05}, {0.4, 0, 0.05}, {0, 0.2, 0}, {5, 5, 5}};
  map.add_field("score", libmap::ScalarType::float32).values = {0.7, 0.8, 0.9, 0.6};
  map.add_field("graspable", libmap::ScalarType::uint8).values = {1, 1, 1, 1};
  map.add_field("border", libmap::ScalarType::uint8);
  libmap::write_cloud(scratch("hills.pcd"), map);
}

TEST(Footholds, TestedOnAMesh) {
  write_hills();
  const auto result =
      graspmap({"footholds", "hills.pcd", "--mesh", "hills.ply", "--load", "3", "-o", "f.csv"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_TRUE(warned(result, {"hills.ply", "1 of 4"}));
  const PointCloud held = libmap::read_cloud(scratch("f.csv")).cloud;
  ASSERT_EQ(held.size(), 2U);  // the plain holds less
  const auto values = [&](const std::string& name) { return held.find_field(name)->values; };
  for (std::size_t n = 0; n < 2; ++n) {
    EXPECT_NEAR(std::abs(held.positions[n].x()), 0.4, 1e-6);
    EXPECT_GE(values("hold_probability")[n], 0.5);
    EXPECT_LE(values("hold_low")[n], values("hold_probability")[n]);
    EXPECT_GE(values("hold_high")[n], values("hold_probability")[n]);
    EXPECT_GE(values("holding_force_n")[n], 3.0);
    EXPECT_LT(values("holding_force_low_n")[n], values("holding_force_n")[n]);
    EXPECT_GT(values("holding_force_high_n")[n], values("holding_force_n")[n]);
    EXPECT_GT(values("parameter_spread")[n], 0.0);
    // The least of the 17 limits is at most the force that half of the trials hold.
    double least = values("pull_away_n")[n];
    for (const char* tilt : {"45", "90"})
      for (int azimuth = 0; azimuth < 360; azimuth += 45)
        least = std::min(
            least, values(std::string("pull_") + tilt + "_" + std::to_string(azimuth) + "_n")[n]);
    EXPECT_GT(least, 0.0);
    EXPECT_LE(least, 1.0001 * values("holding_force_n")[n]);
  }
  EXPECT_GE(values("hold_probability")[0], values("hold_probability")[1]);
  const auto json = json_of("f.csv.json");
  EXPECT_EQ(json.at("results").at("footholds_tested"), 3);
  EXPECT_EQ(json.at("results").at("footholds_holding"), 2);
  EXPECT_EQ(json.at("inputs").size(), 3U);
  ASSERT_TRUE(succeeded(graspmap({"footholds", "hills.pcd", "--mesh", "hills.ply", "--load", "3",
                                  "--max-count", "1", "-o", "one.csv"})));
  EXPECT_EQ(libmap::read_cloud(scratch("one.csv")).cloud.size(), 1U);
  EXPECT_TRUE(bad_input(graspmap({"footholds", "hills.pcd", "--load", "20", "-o", "g.csv"}),
                        {.field = "--load", .about = "--mesh"}));
}

TEST(Footholds, WhatIsNoMapIsSaid) {
  write_terrain();
  EXPECT_TRUE(bad_input(graspmap({"footholds", "terrain.pcd", "-o", "f.csv"}),
                        {.file = "terrain.pcd", .field = "score"}));
  EXPECT_TRUE(bad_input(graspmap({"footholds", "none.pcd", "-o", "f.csv"}), {.file = "none.pcd"}));
  EXPECT_TRUE(bad_input(graspmap({"footholds", "terrain.pcd", "-o", "f.csv", "--separation", "0"}),
                        {.field = "--separation", .value = "0", .bound = "> 0"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("f.csv")));
}

}  // namespace footholds_test
