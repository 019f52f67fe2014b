#include <gtest/gtest.h>

#include "libmap/cloud/cloud_io.h"
#include "tests/tools/tool_test_support.h"

namespace footholds_test {

using graspmap_test::bad_input;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
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
  // The same places, turned: slopes are against the same plane.
  for (std::size_t n = 0; n < terrain.size(); ++n)
    EXPECT_NEAR(terrain.find_field("slope_deg")->values[n],
                input.find_field("slope_deg")->values[n], 2.0);
  const auto json = json_of("input.ply.json");
  EXPECT_EQ(json.at("frame"), "input");
  EXPECT_EQ(json.at("results").at("footholds"), input.size());
}

TEST(Footholds, EdgesThatAreLeftOutAreSaid) {
  graspmap_test::write_text(scratch("map.csv"),
                            "x,y,z,score,graspable,edge\n0,0,0,0.9,1,1\n0.01,0,0,0.9,1,1\n");
  const auto result = graspmap({"footholds", "map.csv", "-o", "f.csv"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_NE(result.standard_error.find("2 at the scan's edges are left out"), std::string::npos);
  ASSERT_TRUE(succeeded(graspmap({"footholds", "map.csv", "-o", "e.csv", "--border"})));
  EXPECT_EQ(libmap::read_cloud(scratch("e.csv")).cloud.size(), 1U);
}

TEST(Footholds, WhatIsNoMapIsSaid) {
  write_terrain();
  EXPECT_TRUE(bad_input(graspmap({"footholds", "terrain.pcd", "-o", "f.csv"}),
                        {"terrain.pcd", "score", "no such field"}));
  EXPECT_TRUE(bad_input(graspmap({"footholds", "none.pcd", "-o", "f.csv"}), {"none.pcd"}));
  EXPECT_TRUE(bad_input(graspmap({"footholds", "terrain.pcd", "-o", "f.csv", "--separation", "0"}),
                        {"--separation is 0", "> 0"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("f.csv")));
}

}  // namespace footholds_test
