// The mask tilted to the surface, and obstacles, as a user asks for them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "libmap/io/cloud_io.h"
#include "tests/tools/tool_test_support.h"

namespace score_orientation_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::warned;
using libmap::PointCloud;
using Words = std::vector<std::string>;

// Bumpy ground with a block of 0.24 m height in its middle; normals say its sides.
std::string write_block() {
  PointCloud cloud = graspmap_test::bumpy_terrain();
  for (Eigen::Vector3d& p : cloud.positions)
    if (std::max(std::abs(p.x()), std::abs(p.y())) < 0.15) p.z() += 0.24;
  cloud.normals.assign(cloud.size(), Eigen::Vector3f::UnitZ());
  for (double along = -0.15; along <= 0.15; along += 0.0078125)
    for (double z = 0.0; z <= 0.25; z += 0.0078125)
      for (const float side : {-1.0F, 1.0F}) {
        const auto wall = 0.1484375 * static_cast<double>(side);
        cloud.positions.emplace_back(wall, along, z);
        cloud.normals.emplace_back(side, 0.0F, 0.0F);
        cloud.positions.emplace_back(along, wall, z);
        cloud.normals.emplace_back(0.0F, side, 0.0F);
      }
  libmap::write_cloud(scratch("terrain.pcd"), cloud);
  return "terrain.pcd";
}

graspmap_test::ProgramResult score(const std::string& output, Words more) {
  Words words = {"score", "terrain.pcd", "-o", output, "--plane", "none", "--tile-size", "0.15"};
  if (std::find(more.begin(), more.end(), "--method") == more.end())
    words.insert(words.end(), {"--method", "corrected"});
  words.insert(words.end(), more.begin(), more.end());
  return graspmap(words);
}

const Words both = {"--orientation", "surface", "--obstacle-height", "0.15"};

Words joined(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

TEST(ScoreOrientation, TileStoreHoldsTheSameMap) {
  write_block();
  const Words surface = {"--orientation", "surface"};
  ASSERT_TRUE(succeeded(score("whole.pcd", surface)));
  ASSERT_TRUE(succeeded(score("m.tiles", joined(surface, {"--max-points-in-memory", "2000"}))));
  ASSERT_TRUE(succeeded(graspmap({"convert", "m.tiles", "-o", "merged.pcd"})));
  EXPECT_EQ(content("merged.pcd"), content("whole.pcd"));
}

TEST(ScoreOrientation, ThreadsChangeNothing) {
  write_block();
  ASSERT_TRUE(succeeded(score("one.pcd", joined(both, {"--threads", "1"}))));
  ASSERT_TRUE(succeeded(score("five.pcd", joined(both, {"--threads", "5"}))));
  EXPECT_EQ(content("five.pcd"), content("one.pcd"));
}

TEST(ScoreOrientation, DefaultsLeaveTheMapAsItWas) {
  write_block();
  ASSERT_TRUE(succeeded(score("default.pcd", {})));
  ASSERT_TRUE(succeeded(score("plane.pcd", {"--orientation", "plane", "--normal-radius", "0.05",
                                            "--obstacle-slope", "30"})));
  EXPECT_EQ(content("plane.pcd"), content("default.pcd"));
  const PointCloud map = libmap::read_cloud(scratch("default.pcd")).cloud;
  EXPECT_FALSE(map.has_normals());
  EXPECT_EQ(map.fields.size(), 10U);  // those of method corrected
}

TEST(ScoreOrientation, FootholdsComeAlongTheMasksAxis) {
  write_block();
  for (const char* frame : {"terrain", "input"}) {
    ASSERT_TRUE(succeeded(
        graspmap({"score", "terrain.pcd", "-o", "map.pcd", "--frame", frame, "--up", "0,0,1",
                  "--orientation", "surface", "--method", "corrected", "--force"})));
    ASSERT_TRUE(succeeded(graspmap(
        {"footholds", "map.pcd", "-o", "f.ply", "--no-graspable-only", "--border", "--force"})));
    const PointCloud map = libmap::read_cloud(scratch("map.pcd")).cloud;
    const PointCloud found = libmap::read_cloud(scratch("f.ply")).cloud;
    ASSERT_GT(found.size(), 20U);
    int sideways = 0;
    for (std::size_t n = 0; n < found.size(); ++n) {
      const Eigen::Vector3d approach(found.find_field("approach_x")->values[n],
                                     found.find_field("approach_y")->values[n],
                                     found.find_field("approach_z")->values[n]);
      EXPECT_NEAR(approach.norm(), 1.0, 1e-6);
      sideways += std::abs(approach.z()) < 0.3 ? 1 : 0;
      for (std::size_t m = 0; m < map.size(); ++m)
        if (map.positions[m] == found.positions[n]) {
          EXPECT_TRUE(approach.isApprox(-map.normals[m].cast<double>(), 1e-5));
        }
    }
    EXPECT_GT(sideways, 3);
  }
}

TEST(ScoreOrientation, WhatDoesNotGoTogetherIsRefused) {
  write_block();
  for (const char* method : {"thesis", "envelope", "calibrated"})
    EXPECT_TRUE(bad_input(score("m.pcd", {"--orientation", "surface", "--method", method}),
                          {.field = "orientation", .value = "surface", .about = method}));
  EXPECT_TRUE(bad_input(score("m.tiles", {"--obstacle-height", "0.2"}),
                        {.field = "obstacle_height_m", .value = "0.2"}));
  EXPECT_TRUE(bad_input(score("m.pcd", {"--obstacle-height", "-1"}),
                        {.field = "--obstacle-height", .value = "-1", .bound = ">= 0"}));
  EXPECT_TRUE(bad_input(score("m.pcd", {"--obstacle-slope", "181"}),
                        {.field = "--obstacle-slope", .value = "181", .bound = ">= 0 and <= 180"}));
  EXPECT_TRUE(
      bad_input(score("m.pcd", {"--orientation", "wall"}),
                {.field = "--orientation", .value = "wall", .bound = "one of plane surface"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("m.pcd")));
}

TEST(ScoreOrientation, ACloudWithoutNormalsIsSaid) {
  graspmap_test::write_terrain();
  const auto result = score("m.pcd", {"--orientation", "surface"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_TRUE(warned(result, {"normals"}));
}

}  // namespace score_orientation_test
