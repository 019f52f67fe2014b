#include <gtest/gtest.h>

#include "libmap/io/cloud_io.h"
#include "tests/tools/tool_test_support.h"

namespace simulate_terrain_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::ProgramResult;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using Words = std::vector<std::string>;

ProgramResult simulate(const std::string& output, Words more) {
  Words words = {"simulate", "terrain", "--spacing", "0.05", "--tile-size", "1.5", "-o", output};
  words.insert(words.end(), more.begin(), more.end());
  return graspmap(words);
}

TEST(SimulateTerrain, PiecesAreTheSameWhateverTheSizeAndTheThreads) {
  ASSERT_TRUE(succeeded(simulate("a", {"--size", "3x4.5", "--threads", "1"})));
  ASSERT_TRUE(succeeded(simulate("b", {"--size", "3x4.5", "--threads", "4"})));
  ASSERT_TRUE(succeeded(simulate("large", {"--size", "6"})));
  ASSERT_TRUE(succeeded(simulate("other", {"--size", "3", "--seed", "2"})));
  std::size_t points = 0;
  for (const std::string i : {"0", "1"})
    for (const std::string j : {"0", "1", "2"}) {
      const std::string piece = "/piece_" + i + "_" + j + ".pcd";
      EXPECT_EQ(content("a" + piece), content("b" + piece));
      EXPECT_EQ(content("a" + piece), content("large" + piece));
      const libmap::PointCloud cloud = libmap::read_cloud(scratch("a" + piece)).cloud;
      EXPECT_TRUE(cloud.has_normals());
      points += cloud.size();
    }
  EXPECT_NE(content("a/piece_0_0.pcd"), content("other/piece_0_0.pcd"));
  EXPECT_EQ(json_of("a.json").at("results").at("points"), points);
  EXPECT_EQ(json_of("a.json").at("results").at("tiles"), 6);
}

TEST(SimulateTerrain, TheEarlierNameOfTheTileSizeIsRead) {
  ASSERT_TRUE(succeeded(simulate("a", {"--size", "1.5"})));
  ASSERT_TRUE(succeeded(graspmap(
      {"simulate", "terrain", "--spacing", "0.05", "--piece=1.5", "--size", "1.5", "-o", "b"})));
  EXPECT_EQ(content("a/piece_0_0.pcd"), content("b/piece_0_0.pcd"));
}

TEST(SimulateTerrain, ASmallerTerrainTakesTheWholePlaceOfALargerOne) {
  ASSERT_TRUE(succeeded(simulate("a", {"--size", "3"})));
  ASSERT_TRUE(succeeded(simulate("a", {"--size", "1.5"})));
  EXPECT_TRUE(std::filesystem::exists(scratch("a/piece_0_0.pcd")));
  EXPECT_FALSE(std::filesystem::exists(scratch("a/piece_1_0.pcd")));
  graspmap_test::write_text(scratch("a/mine.txt"), "kept");
  EXPECT_TRUE(bad_input(simulate("a", {"--size", "1.5"}), {.file = "a"}));
  EXPECT_EQ(content("a/mine.txt"), "kept");
}

TEST(SimulateTerrain, BadOptionsAreNamed) {
  EXPECT_TRUE(bad_input(simulate("a", {"--size", "wide"}), {.field = "--size", .value = "wide"}));
  EXPECT_TRUE(bad_input(simulate("a", {"--size", "3x-1"}), {.field = "--size", .value = "3x-1"}));
  EXPECT_TRUE(bad_input(simulate("a", {"--size", "3", "--rocks-per-m2", "-1"}),
                        {.field = "--rocks-per-m2", .value = "-1", .bound = ">= 0 and <= 100"}));
  EXPECT_TRUE(bad_input(simulate("a", {"--size", "3", "--max-rock", "0.1"}),
                        {.field = "max_rock_m", .value = "0.1"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("a")));
  ASSERT_TRUE(succeeded(simulate("dry", {"--size", "3", "--dry-run"})));
  EXPECT_FALSE(std::filesystem::exists(scratch("dry")));
}

}  // namespace simulate_terrain_test
