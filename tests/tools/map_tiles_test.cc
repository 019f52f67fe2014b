// Commands have the same results for a tile store and the map in one file.
#include <gtest/gtest.h>

#include "libmap/core/table.h"
#include "libmap/io/cloud_io.h"
#include "tests/tools/tool_test_support.h"

namespace map_tiles_test {

namespace fs = std::filesystem;
using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::ended_with;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::uniform;
using graspmap_test::write_text;
using Words = std::vector<std::string>;

Words with(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

// map.pcd and map.tiles of one terrain, 9 tiles.
void score_both(const Words& more = {}) {
  graspmap_test::write_terrain();
  const Words score =
      with({"score", "terrain.pcd", "--zero-plane", "-0.01", "--tile-size", "0.2"}, more);
  ASSERT_TRUE(succeeded(graspmap(with(score, {"-o", "map.pcd"}))));
  ASSERT_TRUE(succeeded(graspmap(with(score, {"--force", "-o", "map.tiles"}))));
}

void write_points(int count) {
  std::string text = "name,x,y,z\n";
  for (int n = 0; n < count; ++n)
    text += "p" + std::to_string(n) + "," + std::to_string(uniform(-0.4, 0.4)) + "," +
            std::to_string(uniform(-0.4, 0.4)) + "," + std::to_string(uniform(-0.1, 0.1)) + "\n";
  write_text(scratch("points.csv"), text);
}

std::string first_tile() {
  std::string first;
  for (const auto& entry : fs::directory_iterator(scratch("map.tiles/tiles")))
    if (first.empty() || entry.path().filename().string() < first)
      first = entry.path().filename().string();
  return "map.tiles/tiles/" + first;
}

// `info --verify` lists the tile and ends as for any bad input.
bool verified_as_broken(const std::string& tile) {
  const auto result = graspmap({"info", "map.tiles", "--verify"});
  return ended_with(result, {.file = "map.tiles", .about = "1 tile"}) &&
         result.standard_output.find(tile) != std::string::npos;
}

TEST(MapTiles, MergedIsTheMap) {
  for (const char* frame : {"terrain", "input"}) {
    score_both({"--frame", frame});
    ASSERT_TRUE(succeeded(graspmap({"convert", "map.tiles", "-o", "merged.pcd"})));
    EXPECT_TRUE(content("merged.pcd") == content("map.pcd"));
    const auto merged = json_of("merged.pcd.json");
    const auto map = json_of("map.pcd.json");
    EXPECT_EQ(merged.at("transforms"), map.at("transforms"));
    EXPECT_EQ(merged.at("frame"), map.at("frame"));
    for (const char* count : {"scored_voxels", "border_voxels", "graspable_voxels"})
      EXPECT_EQ(merged.at("results").at(count), map.at("results").at(count)) << count;
    ASSERT_TRUE(succeeded(graspmap({"convert", "map.tiles/", "-o", "merged.csv"})));
    ASSERT_TRUE(succeeded(graspmap({"convert", "map.pcd", "-o", "map.csv"})));
    EXPECT_TRUE(content("merged.csv") == content("map.csv"));
  }
}

TEST(MapTiles, FarFromTheOriginToo) {
  libmap::write_cloud(
      scratch("terrain.pcd"),
      libmap::transform_cloud(graspmap_test::bumpy_terrain(),
                              libmap::make_pose_from_rpy({5000, -300, 0}, {0, 0, 0})));
  const Words score = {"score", "terrain.pcd", "--plane", "none", "--tile-size", "0.2"};
  ASSERT_TRUE(succeeded(graspmap(with(score, {"-o", "map.pcd"}))));
  ASSERT_TRUE(succeeded(graspmap(with(score, {"-o", "map.tiles"}))));
  ASSERT_TRUE(succeeded(graspmap({"convert", "map.tiles", "-o", "merged.pcd"})));
  EXPECT_TRUE(content("merged.pcd") == content("map.pcd"));
  write_text(scratch("points.csv"), "x,y,z\n5000,-300,0\n5000.11,-299.9,0.01\n0,0,0\n");
  ASSERT_TRUE(succeeded(graspmap({"lookup", "map.pcd", "points.csv", "-o", "one.csv"})));
  ASSERT_TRUE(succeeded(graspmap({"lookup", "map.tiles", "points.csv", "-o", "tiles.csv"})));
  EXPECT_TRUE(content("one.csv") == content("tiles.csv"));
}

TEST(MapTiles, LookupsAreThoseOfTheMap) {
  for (const char* frame : {"terrain", "input"}) {
    score_both({"--frame", frame});
    write_points(500);
    for (const char* mode : {"nearest", "maximum", "mean"}) {
      for (const std::string map : {"map.pcd", "map.tiles"})
        ASSERT_TRUE(succeeded(graspmap({"lookup", map, "points.csv", "--mode", mode, "--radius",
                                        "0.025", "-o", map + ".csv"})));
      EXPECT_TRUE(content("map.pcd.csv") == content("map.tiles.csv")) << mode;
    }
    const auto manifest = json_of("map.tiles.csv.json");
    EXPECT_EQ(manifest.at("inputs").at(0).at("path"), "map.tiles/index.json");
    EXPECT_EQ(manifest.at("results").at("points"), 500);
  }
}

TEST(MapTiles, InfoCountsWhatTheMapHolds) {
  score_both();
  const auto result = graspmap({"info", "map.tiles/", "--json", "--verify"});
  ASSERT_TRUE(succeeded(result));
  const auto info = nlohmann::json::parse(result.standard_output);
  const auto results = json_of("map.pcd.json").at("results");
  EXPECT_EQ(info.at("points"), results.at("scored_voxels"));
  EXPECT_EQ(info.at("border_voxels"), results.at("border_voxels"));
  EXPECT_EQ(info.at("graspable_voxels"), results.at("graspable_voxels"));
  EXPECT_GE(info.at("tiles").at("count"), 9);
  EXPECT_TRUE(info.at("broken_tiles").empty());
  const libmap::Bounds3d bounds =
      libmap::bounds_of(libmap::read_cloud(scratch("map.pcd")).cloud.positions);
  for (int axis = 0; axis < 3; ++axis) {
    const auto index = static_cast<std::size_t>(axis);
    EXPECT_NEAR(info.at("bounds_m").at("min").at(index), bounds.min[axis], 1e-6);
    EXPECT_NEAR(info.at("bounds_m").at("max").at(index), bounds.max[axis], 1e-6);
  }
}

TEST(MapTiles, ImagesAreThoseOfTheMap) {
  score_both();
  const Words small = {"--width", "300", "--height", "200", "--quiet"};
  for (const Words& box : {Words{}, Words{"--box", "-0.11,-0.2,0.13,0.15"}}) {
    for (const std::string map : {"map.pcd", "map.tiles"})
      ASSERT_TRUE(succeeded(graspmap(with(with({"render", map, "-o", map + ".png"}, small), box))));
    EXPECT_TRUE(content("map.pcd.png") == content("map.tiles.png")) << box.size();
  }
  ASSERT_TRUE(succeeded(
      graspmap(with({"render", "map.tiles", "-o", "thin.png", "--max-points", "1000"}, small))));
  EXPECT_EQ(json_of("map.tiles.png.json").at("results").at("columns_per_point"), 1);
  EXPECT_GT(json_of("thin.png.json").at("results").at("columns_per_point"), 1);
  EXPECT_TRUE(bad_input(graspmap({"render", "map.tiles", "-o", "a.png", "--box", "5,5,6,6"}),
                        {.file = "map.tiles", .field = "--box"}));
  for (const char* box : {"1,2,3", "1,2,3,4,5", "1,2,1,4", "a,b,c,d", "1,2,3,4,", ",,,"})
    EXPECT_TRUE(bad_input(graspmap({"render", "map.tiles", "-o", "a.png", "--box", box}),
                          {.field = "--box", .value = box}));
}

TEST(MapTiles, DamageIsNamed) {
  score_both();
  write_points(100);
  const std::string tile = first_tile();
  const std::string whole = content(tile);
  const auto commands = {Words{"convert", "map.tiles", "-o", "merged.pcd"},
                         Words{"lookup", "map.tiles", "points.csv", "-o", "answers.csv"},
                         Words{"render", "map.tiles", "-o", "map.png"}};
  const auto all_refuse = [&](const std::string& what,
                              const graspmap_test::ExpectedError& expected) {
    for (const Words& words : commands) EXPECT_TRUE(bad_input(graspmap(words), expected)) << what;
    EXPECT_TRUE(verified_as_broken(tile)) << what;
  };
  write_text(scratch(tile), whole.substr(0, whole.size() - 10));
  all_refuse("cut off", {.file = tile,
                         .field = "size",
                         .value = std::to_string(whole.size() - 10) + " bytes",
                         .bound = std::to_string(whole.size())});
  fs::remove(scratch(tile));
  all_refuse("missing", {.file = tile});
  // The hash reveals a changed byte of a score.
  std::string changed = whole;
  changed[changed.size() - 30] = static_cast<char>(changed[changed.size() - 30] ^ 1);
  write_text(scratch(tile), changed);
  EXPECT_TRUE(bad_input(graspmap({"convert", "map.tiles", "-o", "merged.pcd"}),
                        {.file = tile, .field = "SHA-256"}));
  EXPECT_TRUE(verified_as_broken(tile));
  write_text(scratch(tile), whole);
  EXPECT_TRUE(succeeded(graspmap({"info", "map.tiles", "--verify"})));
  write_text(scratch("map.tiles/index.json"), "{");
  EXPECT_TRUE(bad_input(graspmap({"info", "map.tiles"}), {.file = "map.tiles/index.json"}));
  EXPECT_TRUE(bad_input(graspmap({"info", "none.tiles"}), {.file = "none.tiles"}));
  EXPECT_TRUE(bad_input(graspmap({"convert", "map.tiles", "map.pcd", "-o", "merged.pcd"}),
                        {.file = "map.pcd"}));
}

// Its positions are made from its voxels.
TEST(MapTiles, ATileWithoutVoxelsFarFromTheOrigin) {
  libmap::write_cloud(
      scratch("terrain.pcd"),
      libmap::transform_cloud(graspmap_test::bumpy_terrain(0.2),
                              libmap::make_pose_from_rpy({5000, -300, 0}, {0, 0, 0})));
  ASSERT_TRUE(succeeded(graspmap({"score", "terrain.pcd", "--plane", "none", "-o", "map.tiles"})));
  for (const auto& entry : fs::directory_iterator(scratch("map.tiles/tiles"))) {
    std::string tile = graspmap_test::read_text(entry.path());
    const std::size_t fields = tile.find(" i j k");
    ASSERT_NE(fields, std::string::npos);
    write_text(entry.path(), tile.replace(fields, 6, " i j m"));
  }
  write_points(3);
  for (const Words& words : {Words{"lookup", "map.tiles", "points.csv", "-o", "answers.csv"},
                             Words{"render", "map.tiles", "-o", "map.png"}})
    EXPECT_TRUE(bad_input(graspmap(words), {.field = "k"}));
}

TEST(MapTiles, AnUnfinishedStoreIsNamed) {
  graspmap_test::write_terrain();
  ASSERT_TRUE(succeeded(graspmap(
      {"score", "terrain.pcd", "--tile-size", "0.2", "--tile", "1/2", "-o", "map.tiles"})));
  write_points(3);
  for (const Words& words :
       {Words{"convert", "map.tiles", "-o", "merged.pcd"},
        Words{"lookup", "map.tiles", "points.csv", "-o", "answers.csv"},
        Words{"render", "map.tiles", "-o", "map.png"}, Words{"info", "map.tiles"}})
    EXPECT_TRUE(bad_input(graspmap(words), {.file = "map.tiles"})) << words[0];
}

}  // namespace map_tiles_test
