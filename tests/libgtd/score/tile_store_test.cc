#include "libgtd/score/tile_store.h"

#include <gtest/gtest.h>

#include <string>

#include "libgtd/score/tile_store_io.h"
#include "libmap/core/error.h"
#include "tests/support/test_support.h"

namespace tile_store_test {

namespace fs = std::filesystem;

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::read_text;
using graspmap_test::scratch_folder;
using graspmap_test::write_text;
using libgtd::MapTileStore;
using libgtd::StoredTile;
using libgtd::TileNumber;
using libgtd::TilePlan;
using libgtd::TileStoreIndex;

TEST(TileStore, TilesOfVoxels) {
  EXPECT_EQ(libgtd::tile_of({-1, 0, 5}, 10), (TileNumber{-1, 0}));
  EXPECT_EQ(libgtd::tile_of({-10, 9, 5}, 10), (TileNumber{-1, 0}));
  EXPECT_EQ(libgtd::tile_of({-11, 10, 5}, 10), (TileNumber{-2, 1}));
  EXPECT_EQ(libgtd::tile_file_of({-2, 13}), "tiles/-2_13.pcd");
  const libgtd::TileBounds columns = libgtd::columns_of({-2, 1}, 10);
  EXPECT_EQ(columns.i_begin, -20);
  EXPECT_EQ(columns.i_end, -10);
  EXPECT_EQ(columns.j_end, 20);
}

TEST(TileStore, Names) {
  EXPECT_TRUE(libgtd::is_tile_store_name("a b.tiles"));
  EXPECT_TRUE(libgtd::is_tile_store_name("x/map.tiles/"));
  EXPECT_FALSE(libgtd::is_tile_store_name("map.pcd"));
  EXPECT_FALSE(libgtd::is_tile_store_name("tiles"));
}

StoredTile tile(int i, int j, std::uint64_t voxels) {
  StoredTile one;
  one.number = {i, j};
  one.voxels = one.occupied_voxels = voxels;
  if (voxels == 0) return one;
  one.min = {10 * i + 1, 10 * j + 2, -3};
  one.max = {10 * i + 8, 10 * j + 9, 4};
  one.graspable_voxels = 2;
  one.file = libgtd::tile_file_of(one.number);
  one.bytes = 99;
  one.sha256 = "abc";
  return one;
}

// Tiles (-1, 0), (-1, 1), (0, 0), (0, 1).
TilePlan small_plan() {
  TilePlan plan;
  plan.key = "key";
  plan.index.tile_voxels = 10;
  plan.index.min = {-9, 2, -3};
  plan.index.max = {9, 19, 4};
  plan.index.manifest.frame = "input";
  libmap::Pose pose = libmap::Pose::Identity();
  pose.translation() = Eigen::Vector3d(0.1, 1.0 / 3.0, 7);
  plan.index.manifest.transforms.emplace_back("terrain_from_input", pose);
  plan.has_plane = true;
  plan.centroid = Eigen::Vector3d(1.0 / 7.0, 2, 3);
  libgtd::TerrainFile file;
  file.input = {"a b.pcd", "0123", 12};
  file.modified_ns = 1234567890123456789;
  file.box.max = Eigen::Vector3d(1, 1.0 / 9.0, 0);
  plan.terrain.push_back(file);
  return plan;
}

TEST(MapTileStore, PlanAndIndexComeBackToTheBit) {
  const fs::path store = scratch_folder() / "m.tiles";
  const MapTileStore progress(store / "");
  progress.open();
  EXPECT_FALSE(progress.plan());
  const TilePlan plan = small_plan();
  progress.set_plan(plan);
  const TilePlan read = *progress.plan();
  EXPECT_EQ(read.key, "key");
  EXPECT_TRUE(read.has_plane);
  EXPECT_EQ(read.centroid, plan.centroid);
  EXPECT_EQ(read.index.terrain_from_input().matrix(), plan.index.terrain_from_input().matrix());
  EXPECT_EQ(read.index.max, plan.index.max);
  ASSERT_EQ(read.terrain.size(), 1u);
  EXPECT_EQ(read.terrain[0].modified_ns, 1234567890123456789);
  EXPECT_EQ(read.terrain[0].box.max, plan.terrain[0].box.max);

  libmap::TileJournal one(store, {1, 2});
  EXPECT_TRUE(is_error(error_of([&] {
                         libmap::TileJournal(store, {1, 2});
                       }),
                       {.file = store, .kind = libmap::ErrorKind::failed}));
  libmap::TileJournal other(store, {2, 2});
  libgtd::add_tiles({tile(0, 1, 5), tile(-1, 1, 0)}, "key", one);
  libgtd::add_tiles({tile(-1, 0, 3)}, "key", other);
  EXPECT_EQ(progress.complete(read).done, 3u);
  EXPECT_EQ(progress.complete(read).tiles, 4u);
  EXPECT_FALSE(progress.complete(read).index);
  // Lines of another key are ignored.
  libmap::TileJournal third(store, {1, 1});
  libgtd::add_tiles({tile(0, 0, 1)}, "other key", third);
  EXPECT_FALSE(progress.complete(read).index);
  libgtd::add_tiles({tile(0, 0, 7)}, "key", other);
  const TileStoreIndex index = libgtd::finish_tile_store(store);
  ASSERT_EQ(index.tiles.size(), 3u);
  EXPECT_EQ(index.tiles[0].number, (TileNumber{-1, 0}));
  EXPECT_EQ(index.find({0, 1})->voxels, 5u);
  EXPECT_EQ(index.find({-1, 1}), nullptr);
  EXPECT_EQ(index.voxels(), 15u);
  EXPECT_EQ(index.frame, libgtd::MapFrame::input);
  EXPECT_EQ(std::get<std::int64_t>(*index.manifest.find_result("graspable_voxels")), 6);
}

TEST(TileStore, RestoredPositionsAreTheVoxelsCenters) {
  TileStoreIndex index;
  index.lattice.voxel_size_m = 0.01;
  libmap::PointCloud cloud;
  cloud.positions.assign(2, Eigen::Vector3d(9, 9, 9));
  EXPECT_TRUE(is_error(error_of([&] { libgtd::restore_positions(index, cloud); }), {.field = "i"}));
  for (const char* name : {"i", "j", "k"})
    cloud.add_field(name, libmap::ScalarType::int32).values = {-3, 40000};
  libgtd::restore_positions(index, cloud);
  EXPECT_EQ(cloud.positions[0], index.lattice.center_of({-3, -3, -3}));
  EXPECT_EQ(cloud.positions[1], index.lattice.center_of({40000, 40000, 40000}));
  cloud.fields[2].values[1] = -1e10;
  EXPECT_EQ(error_of([&] { libgtd::restore_positions(index, cloud); }).context().field, "k");
}

TEST(TileStore, AFileIsNone) {
  const fs::path store = scratch_folder() / "m.tiles";
  write_text(store, "");
  const libmap::Error error = error_of([&] { libgtd::read_tile_store(store); });
  EXPECT_TRUE(is_error(error, {.file = "m.tiles"}));
  EXPECT_EQ(error.context().file, store.string());
}

TEST(MapTileStore, PlanOfAnotherVersion) {
  const fs::path store = scratch_folder() / "m.tiles";
  const MapTileStore progress(store);
  progress.open();
  progress.set_plan(small_plan());
  const fs::path path = store / "progress/plan.json";
  std::string text = read_text(path);
  write_text(path, text.replace(text.find("\"version\": 1"), 12, "\"version\": 2"));
  const libmap::Error error = error_of([&] { progress.plan(); });
  EXPECT_EQ(error.context().file, path.string());
  EXPECT_EQ(error.context().field, "format, version");
  EXPECT_EQ(error.context().value, "\"graspmap tile store progress\", 2");
  EXPECT_EQ(error.context().bound, "\"graspmap tile store progress\", 1");
}

TEST(MapTileStore, ABoxThatIsNone) {
  const MapTileStore progress(scratch_folder() / "m.tiles");
  progress.open();
  TilePlan plan = small_plan();
  plan.terrain[0].points = 5;
  progress.set_plan(plan);
  EXPECT_TRUE(progress.plan());
  plan.terrain[0].box.min.y() = 1.0;
  progress.set_plan(plan);
  const libmap::Error error = error_of([&] { progress.plan(); });
  EXPECT_EQ(error.context().field, "min, max of cloud a b.pcd");
  EXPECT_EQ(error.context().bound, "min <= max");
}

// Invalid lines of a journal are ignored.
TEST(MapTileStore, TilesThatCannotBe) {
  const fs::path store = scratch_folder() / "m.tiles";
  const MapTileStore progress(store);
  progress.open();
  const TilePlan plan = small_plan();
  progress.set_plan(plan);
  StoredTile elsewhere = tile(0, 0, 0);
  elsewhere.file = "../../x";
  StoredTile many = tile(0, 1, 5);
  many.occupied_voxels = ~std::uint64_t{0} / 2;
  libmap::TileJournal journal(store, {1, 1});
  libgtd::add_tiles({elsewhere, many, tile(-1, 0, 3), tile(5, 5, 1)}, "key", journal);
  EXPECT_EQ(progress.complete(plan).done, 1u);
}

// Each change of a valid index is rejected with one line that names the file and the error.
TEST(TileStore, HostileIndex) {
  const fs::path store = scratch_folder() / "m.tiles";
  const MapTileStore progress(store);
  progress.open();
  TileStoreIndex good = small_plan().index;
  good.tiles = {tile(-1, 0, 3), tile(0, 0, 7)};
  const auto write_index_again = [&] {
    fs::remove(progress.index_path());
    progress.write_index(good);
  };
  write_index_again();
  const std::string text = read_text(store / "index.json");
  EXPECT_NO_THROW(libgtd::read_tile_store(store));
  const auto expect_error = [&](const std::string& from, const std::string& to,
                                const graspmap_test::ExpectedError& expected) {
    std::string changed = text;
    const std::size_t at = changed.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    write_text(store / "index.json", changed.replace(at, from.size(), to));
    const libmap::Error error = error_of([&] { libgtd::read_tile_store(store); });
    EXPECT_EQ(error.context().file, (store / "index.json").string());
    EXPECT_TRUE(is_error(error, expected)) << to;
  };
  expect_error("\"graspmap tile store\"", "\"other\"", {.field = "format", .value = "\"other\""});
  expect_error("\"version\": 1", "\"version\": 2", {.field = "version", .value = "2"});
  expect_error("\"tile_voxels\": 10", "\"tile_voxels\": 0", {.field = "tile_voxels", .value = "0"});
  expect_error("\"voxel_size_m\": 0.01", "\"voxel_size_m\": -1",
               {.field = "voxel_size_m", .value = "-1"});
  expect_error("\"key\"", "\"kee\"", {.file = "index.json"});
  expect_error("tiles/-1_0.pcd", "../../../etc/passwd",
               {.field = "file of tile -1, 0", .value = "../../../etc/passwd"});
  expect_error("\"i\": -1", "\"i\": 3000000000", {.field = "i", .value = "3000000000"});
  expect_error("\"i\": -1", "\"i\": \"x\"", {.field = "i", .value = "string"});
  expect_error("\"i\": 0", "\"i\": -1",
               {.field = "min and max of tile -1, 0", .value = "[1,2,-3]"});
  expect_error("\"i\": 0", "\"i\": 1e300", {.field = "i", .value = "1e+300"});
  expect_error("\"j\": 0", "\"j\": 214748364", {.field = "number of a tile", .value = "214748364"});
  expect_error("\"min\": [\n  -9", "\"min\": [\n  10", {.field = "min", .value = "[10,2,-3]"});
  expect_error("\"max\": [\n  9", "\"max\": [\n  -5",
               {.field = "number of a tile", .value = "0, 0"});
  expect_error("\"voxels\": 3", "\"voxels\": 0",
               {.field = "file of tile -1, 0", .value = "tiles/-1_0.pcd"});
  for (const char* count : {"voxels", "occupied_voxels", "border_voxels", "graspable_voxels"}) {
    const std::string key = "\"" + std::string(count) + "\": ";
    expect_error(key, key + "1844674407370955161", {.field = count});
  }
  expect_error("\"map\": {",
               "\"map\": {\"a\": " + std::string(1000, '[') + std::string(1000, ']') + ",",
               {.about = "64 levels"});
  for (std::size_t size = 0; size < text.size() - 2; size += 37) {
    write_text(store / "index.json", text.substr(0, size));
    EXPECT_TRUE(is_error(error_of([&] { libgtd::read_tile_store(store); }),
                         {.file = store / "index.json"}));
  }
  good.tiles = {tile(-1, 0, 3), tile(0, 0, 0)};
  write_index_again();
  const libmap::Error empty = error_of([&] { libgtd::read_tile_store(store); });
  EXPECT_TRUE(is_error(empty, {.field = "tiles", .value = "0, 0"}));
  EXPECT_EQ(empty.context().value, "0, 0");
  for (const std::vector<StoredTile>& tiles :
       {std::vector{tile(0, 0, 7), tile(-1, 0, 3)}, std::vector{tile(0, 0, 7), tile(0, 0, 7)}}) {
    good.tiles = tiles;
    write_index_again();
    const libmap::Error error = error_of([&] { libgtd::read_tile_store(store); });
    EXPECT_TRUE(is_error(error, {.field = "tiles"}));
    EXPECT_EQ(error.context().value, tiles[1].file);
  }
}

}  // namespace tile_store_test
