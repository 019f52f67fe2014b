// `graspmap score` with a store whose plan was edited, and with too many tiles.
#include <gtest/gtest.h>

#include <functional>

#include "libgtd/score/tile_store_io.h"
#include "tests/tools/tool_test_support.h"

namespace score_store_hostile_test {

namespace fs = std::filesystem;

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::ProgramResult;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::write_text;
using Words = std::vector<std::string>;

class ScoreStoreHostile : public testing::Test {
 protected:
  void SetUp() override {
    graspmap_test::write_terrain();
    ASSERT_TRUE(succeeded(score()));
  }

  static ProgramResult score(const Words& more = {}) {
    Words words = {"score",        "terrain.pcd", "-o",          "m.tiles",
                   "--zero-plane", "-0.1",        "--tile-size", "0.2"};
    words.insert(words.end(), more.begin(), more.end());
    return graspmap(words);
  }

  // Loses a tile, and changes the plan.
  static void change_plan(const std::function<void(nlohmann::json& plan)>& change) {
    const libgtd::TileStoreIndex index = libgtd::read_tile_store(scratch("m.tiles"));
    fs::remove(scratch("m.tiles") / index.tiles[4].file);
    nlohmann::json plan = nlohmann::json::parse(content("m.tiles/progress/plan.json"));
    change(plan);
    write_text(scratch("m.tiles/progress/plan.json"), plan.dump());
  }
};

TEST_F(ScoreStoreHostile, ABoxThatReachesAnywhere) {
  const std::string file = libgtd::read_tile_store(scratch("m.tiles")).tiles[4].file;
  const std::string tile = content("m.tiles/" + file);
  change_plan([](nlohmann::json& plan) {
    plan.at("pieces").at(0).at("min") = {-1e300, -1e300, -1e300};
    plan.at("pieces").at(0).at("max") = {1e300, 1e300, 1e300};
  });
  ASSERT_TRUE(succeeded(score()));
  EXPECT_TRUE(content("m.tiles/" + file) == tile);
}

TEST_F(ScoreStoreHostile, APlanOfOtherTiles) {
  const auto expect_refused = [](const std::function<void(nlohmann::json & index)>& change) {
    const std::string plan = content("m.tiles/progress/plan.json");
    change_plan([&](nlohmann::json& json) { change(json.at("index")); });
    EXPECT_TRUE(bad_input(score(), {.file = "m.tiles/progress/plan.json",
                                    .field = "tile_voxels and lattice",
                                    .about = "--force"}));
    write_text(scratch("m.tiles/progress/plan.json"), plan);
  };
  expect_refused([](nlohmann::json& index) { index.at("tile_voxels") = 21; });
  expect_refused([](nlohmann::json& index) { index.at("lattice").at("voxel_size_m") = 1e-300; });
  expect_refused([](nlohmann::json& index) { index.at("lattice").at("origin_m").at(0) = 1e300; });
}

TEST_F(ScoreStoreHostile, APlanOfAnotherPlace) {
  change_plan([](nlohmann::json& plan) {
    nlohmann::json& x_m = plan.at("plane_centroid_m").at(0);
    x_m = x_m.get<double>() + 0.1;
  });
  EXPECT_TRUE(bad_input(score(), {.file = "m.tiles/progress/plan.json", .field = "min and max"}));
}

TEST(ScoreStoreTiles, TooManyLeaveNothingBehind) {
  write_text(scratch("far.csv"), "x,y,z\n0,0,0\n4000,0,0\n0,4000,0.5\n");
  const Words before = graspmap_test::names_in_scratch();
  EXPECT_TRUE(bad_input(graspmap({"score", "far.csv", "--plane", "none", "-o", "m.tiles"}),
                        {.file = "far.csv", .field = "tile_size_m", .value = "1"}));
  EXPECT_EQ(graspmap_test::names_in_scratch(), before);
}

}  // namespace score_store_hostile_test
