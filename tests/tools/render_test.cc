#include <gtest/gtest.h>

#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/tools/tool_test_support.h"

namespace render_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::wrong_usage;

// Width and height from the header of a PNG file (RFC 2083, 4.1.1), big-endian.
std::pair<unsigned, unsigned> png_size(const std::string& bytes) {
  EXPECT_EQ(bytes.substr(1, 3), "PNG");
  const auto number = [&](std::size_t at) {
    unsigned value = 0;
    for (std::size_t n = at; n < at + 4; ++n)
      value = value * 256 + static_cast<unsigned char>(bytes[n]);
    return value;
  };
  return {number(16), number(20)};
}

TEST(Render, CloudWithMarkedPoints) {
  graspmap_test::write_terrain();
  graspmap_test::write_text(scratch("points.csv"),
                            "id,x,y,z,graspable\nA,0,0,0,1\nB,0.1,0.1,0,0\nC,-0.1,0,0,\n");
  const std::vector<std::string> words = {"render",    "terrain.pcd", "--points", "points.csv",
                                          "--verdict", "graspable",   "--width",  "320",
                                          "--height",  "240",         "-o"};
  for (const char* name : {"a.png", "b.png"}) {
    std::vector<std::string> call = words;
    call.emplace_back(name);
    ASSERT_TRUE(succeeded(graspmap(call)));
  }
  EXPECT_EQ(png_size(content("a.png")), (std::pair{320U, 240U}));
  EXPECT_EQ(content("a.png"), content("b.png"));
}

// Positions without names, in the map's own frame, as their manifest says.
TEST(Render, FootholdsOfTheMap) {
  graspmap_test::write_terrain();
  ASSERT_TRUE(succeeded(
      graspmap({"score", "terrain.pcd", "-o", "map.pcd", "--solid-voxel-threshold", "1"})));
  ASSERT_TRUE(succeeded(graspmap(
      {"footholds", "map.pcd", "-o", "footholds.csv", "--no-graspable-only", "--border"})));
  const std::vector<std::string> words = {
      "render", "map.pcd", "--points", "footholds.csv", "--width", "320", "--height", "240", "-o"};
  const std::map<std::string, std::vector<std::string>> images = {
      {"a.png", {}},
      {"b.png", {"--points-frame", "terrain", "--label", "none"}},
      {"c.png", {"--points-frame", "terrain", "--label", "score"}}};
  for (const auto& [name, more] : images) {
    std::vector<std::string> call = words;
    call.push_back(name);
    call.insert(call.end(), more.begin(), more.end());
    ASSERT_TRUE(succeeded(graspmap(call)));
  }
  EXPECT_EQ(content("a.png"), content("b.png"));
  EXPECT_NE(content("a.png"), content("c.png"));
}

TEST(Render, LegendHasTheLoadOfTheMap) {
  ASSERT_TRUE(succeeded(graspmap({"score", graspmap_test::write_terrain(), "-o", "map.pcd",
                                  "--voxel-size", "0.04", "--load", "4"})));
  const auto drawn = [](const std::vector<std::string>& more) {
    std::vector<std::string> words = {"render",  "map.pcd", "-o",       "a.png", "--force",
                                      "--width", "400",     "--height", "300"};
    words.insert(words.end(), more.begin(), more.end());
    EXPECT_TRUE(succeeded(graspmap(words)));
    return content("a.png");
  };
  EXPECT_EQ(drawn({}), drawn({"--load", "4"}));
  EXPECT_NE(drawn({}), drawn({"--load", "5"}));
}

TEST(Render, NeedsNoDisplay) {
  graspmap_test::write_terrain();
  ASSERT_TRUE(succeeded(
      graspmap({"render", "terrain.pcd", "-o", "a.png", "--width", "64", "--height", "64"},
               {{"DISPLAY", ""}})));
  EXPECT_EQ(png_size(content("a.png")), (std::pair{64U, 64U}));
}

TEST(Render, BadInputIsOneLine) {
  graspmap_test::write_terrain();
  libmap::write_cloud(scratch("empty.pcd"), {});
  graspmap_test::write_text(scratch("points.csv"), "id,x,y,z,graspable\nA,0,0,0,maybe\n");
  EXPECT_TRUE(bad_input(graspmap({"render", "none.pcd", "-o", "a.png"}), {.file = "none.pcd"}));
  EXPECT_TRUE(bad_input(graspmap({"render", "empty.pcd", "-o", "a.png"}), {.file = "empty.pcd"}));
  EXPECT_TRUE(bad_input(graspmap({"render", "terrain.pcd", "-o", "a.jpg"}), {.file = "a.jpg"}));
  EXPECT_TRUE(bad_input(graspmap({"render", "terrain.pcd", "-o", "a.png", "--width", "0"}),
                        {.field = "--width", .value = "0", .bound = ">= 1 and <= 16384"}));
  EXPECT_TRUE(bad_input(
      graspmap({"render", "terrain.pcd", "-o", "a.png", "--color", "field", "--field", "scroe"}),
      {.file = "terrain.pcd", .field = "field", .value = "scroe", .bound = "one of x y z"}));
  EXPECT_TRUE(bad_input(
      graspmap({"render", "terrain.pcd", "-o", "a.png", "--view", "tpo"}),
      {.field = "--view", .value = "tpo", .bound = "one of top oblique front side camera"}));
  EXPECT_TRUE(
      bad_input(graspmap({"render", "terrain.pcd", "-o", "a.png", "--points", "points.csv",
                          "--verdict", "graspable"}),
                {.file = "points.csv", .field = "row 1, column 'graspable'", .value = "'maybe'"}));
  EXPECT_TRUE(bad_input(graspmap({"render", "terrain.pcd", "-o", "a.png", "--zero-plane", "low"}),
                        {.file = "terrain.pcd", .field = "--zero-plane", .value = "low"}));
  libmap::write_mesh(scratch("square.ply"), graspmap_test::square_mesh(0.0));
  EXPECT_TRUE(bad_input(graspmap({"render", "square.ply", "-o", "a.png", "--box", "0,0,1,1"}),
                        {.file = "square.ply", .field = "--box"}));
  EXPECT_TRUE(wrong_usage(graspmap({"render", "terrain.pcd", "-o", "a.png", "--wdith", "3"}),
                          {"--wdith", "--width"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("a.png")));
}

}  // namespace render_test
