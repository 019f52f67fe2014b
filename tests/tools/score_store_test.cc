// A map in tiles equals the map in one file, byte for byte, for any division of the terrain into
// files and tiles and any number of killed runs.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <ostream>
#include <thread>

#include "libgtd/score/tile_store_io.h"
#include "libmap/core/output_lock.h"
#include "libmap/io/cloud_io.h"
#include "tests/tools/tool_test_support.h"

namespace score_store_test {

namespace fs = std::filesystem;

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::ended_with;
using graspmap_test::graspmap;
using graspmap_test::ProgramResult;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using libmap::PointCloud;
using Words = std::vector<std::string>;

// Rough ground with bumps to hold on to, 1.2 x 1.2 m without one corner, slightly tilted; half of
// the points are missing, so that there are gaps of all sizes.
PointCloud rocks(const Eigen::Vector3d& shift = Eigen::Vector3d::Zero()) {
  PointCloud cloud;
  for (int i = -80; i < 80; ++i)
    for (int j = -80; j < 80; ++j) {
      const unsigned noise = (static_cast<unsigned>(i * 7919 + j * 104729) * 2654435761U) >> 16U;
      const double x = 0.0075 * i, y = 0.0075 * j;
      if (noise % 2 == 0 || (x > 0.15 && y > 0.1)) continue;
      const double z = 0.04 * std::sin(17 * x) * std::cos(13 * y) + 0.02 * x + 1e-7 * noise;
      cloud.positions.push_back(Eigen::Vector3d(x, y, z) + shift);
      cloud.normals.emplace_back(0.0F, 0.1F, 0.9F);
    }
  return cloud;
}

// `count` files in a folder: strips along x, or every count-th point.
void write_tiles(const std::string& folder, const PointCloud& cloud, std::size_t count, bool strips,
                 const std::string& extension = ".pcd") {
  fs::create_directories(scratch(folder));
  for (std::size_t piece = 0; piece < count; ++piece) {
    std::vector<std::size_t> indices;
    for (std::size_t n = 0; n < cloud.size(); ++n)
      if ((strips ? n * count / cloud.size() : n % count) == piece) indices.push_back(n);
    libmap::write_cloud(scratch(folder + "/piece_" + std::to_string(piece) + extension),
                        libmap::select_points(cloud, indices));
  }
}

ProgramResult score(const std::string& terrain, const std::string& output, Words more = {}) {
  Words words = {"score", terrain, "-o", output, "--zero-plane", "-0.1"};
  if (std::find(more.begin(), more.end(), "--tile-size") == more.end())
    words.insert(words.end(), {"--tile-size", "0.2"});
  words.insert(words.end(), more.begin(), more.end());
  return graspmap(words);
}

libgtd::TileStoreIndex index_of(const std::string& store) {
  return libgtd::read_tile_store(scratch(store));
}

// The tiles' points as one map file, by the library alone.
std::string merged(const std::string& store) {
  const libgtd::TileStoreIndex index = index_of(store);
  std::vector<PointCloud> parts;
  for (const libgtd::StoredTile& tile : index.tiles) {
    parts.push_back(libmap::read_cloud(libgtd::checked_tile_path(scratch(store), tile)).cloud);
    EXPECT_EQ(parts.back().size(), tile.voxels);
    libgtd::restore_positions(index, parts.back());
  }
  libmap::write_cloud(scratch("merged.pcd"), libgtd::merge_map_clouds(parts));
  return content("merged.pcd");
}

// All files below a folder, by their names in it.
std::map<std::string, std::string> files_in(const std::string& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(scratch(folder)))
    if (entry.is_regular_file())
      files[fs::relative(entry.path(), scratch(folder)).string()] =
          graspmap_test::read_text(entry.path());
  return files;
}

// Files of a finished store, without those of its progress.
std::map<std::string, std::string> map_files(const std::string& store) {
  std::map<std::string, std::string> files = files_in(store);
  std::erase_if(files, [](const auto& file) { return file.first.starts_with("progress/"); });
  return files;
}

std::size_t journal_lines(const std::string& store) {
  std::size_t lines = 0;
  if (!fs::exists(scratch(store + "/progress"))) return 0;
  for (const auto& entry : fs::directory_iterator(scratch(store + "/progress"))) {
    if (entry.path().extension() != ".jsonl") continue;
    const std::string text = graspmap_test::read_text(entry.path());
    lines += static_cast<std::size_t>(std::count(text.begin(), text.end(), '{'));
  }
  return lines;
}

struct Case {
  const char* name;
  Words flags;        // of both
  Words store_flags;  // of the store alone
  std::size_t pieces = 1;
  bool strips = true;
  int shares = 1;
};

void PrintTo(const Case& given, std::ostream* out) { *out << given.name; }

class ScoreStore : public testing::TestWithParam<Case> {};

TEST_P(ScoreStore, IsTheMapInOneFile) {
  const Case& given = GetParam();
  write_tiles("in", rocks(), given.pieces, given.strips);
  ASSERT_TRUE(succeeded(score("in", "whole.pcd", given.flags)));
  for (int share = given.shares; share >= 1; --share) {
    Words words = given.flags;
    words.insert(words.end(), given.store_flags.begin(), given.store_flags.end());
    if (given.shares > 1)
      words.insert(words.end(),
                   {"--tile", std::to_string(share) + "/" + std::to_string(given.shares)});
    ASSERT_TRUE(succeeded(score("in", "m.tiles", words)));
  }
  EXPECT_EQ(merged("m.tiles"), content("whole.pcd"));
  const nlohmann::json map = graspmap_test::json_of("m.tiles/index.json").at("map");
  nlohmann::json whole = graspmap_test::json_of("whole.pcd.json");
  whole.at("parameters").erase("tile");
  for (const char* key : {"parameters", "inputs", "transforms", "frame", "units"})
    EXPECT_EQ(map.at(key), whole.at(key)) << key;
  for (const auto& [key, value] : map.at("results").items())
    EXPECT_EQ(value, whole.at("results").at(key)) << key;
  EXPECT_GT(map.at("results").at("scored_voxels"), 0);
  EXPECT_TRUE(fs::exists(scratch("m.tiles.json")));
}

INSTANTIATE_TEST_SUITE_P(
    All, ScoreStore,
    testing::Values(
        Case{"one_piece", {}, {}}, Case{"strips", {}, {"--threads", "1"}, 4},
        Case{"mixed_pieces", {}, {"--threads", "2"}, 3, false}, Case{"shares", {}, {}, 2, true, 3},
        Case{"more_shares_than_tiles", {"--tile-size", "0.7"}, {}, 1, true, 6},
        Case{"one_tile", {"--tile-size", "50"}, {}},
        Case{"small_tiles", {"--tile-size", "0.05"}, {}, 2, false},
        Case{"few_points_at_once", {}, {"--max-points-in-memory", "2000"}, 2, false},
        Case{"parts_of_a_tile", {"--tile-size", "5"}, {"--max-points-in-memory", "1000"}},
        Case{"no_plane", {"--plane", "none"}, {"--points-at-once=5000"}, 3},
        Case{"climblab", {"--method", "climblab"}, {"--max-points-in-memory", "1000"}, 2},
        Case{"no_convexity", {"--curvature-radius", "0"}, {}, 1, true, 2},
        Case{"wide_curvature",
             {"--curvature-radius", "0.28"},
             {"--max-points-in-memory", "1000"},
             2,
             false},
        Case{"input_frame", {"--frame", "input"}, {}, 2}),
    [](const auto& one) { return std::string(one.param.name); });

TEST(ScoreStoreTerrain, FarFromTheOrigin) {
  write_tiles("in", rocks({1e5, -2e5, 300}), 3, false);
  for (const char* plane : {"fit", "none"}) {
    ASSERT_TRUE(succeeded(score("in", "whole.pcd", {"--plane", plane})));
    ASSERT_TRUE(succeeded(
        score("in", "m.tiles", {"--plane", plane, "--max-points-in-memory", "3000", "--force"})));
    EXPECT_EQ(merged("m.tiles"), content("whole.pcd")) << plane;
  }
}

// Tiles near the origin need no double precision, the map as a whole does.
TEST(ScoreStoreTerrain, TilesOfDifferentPrecision) {
  PointCloud cloud = rocks();
  const PointCloud far = rocks({700, 0, 0});
  cloud.positions.insert(cloud.positions.end(), far.positions.begin(), far.positions.end());
  cloud.normals.insert(cloud.normals.end(), far.normals.begin(), far.normals.end());
  write_tiles("in", cloud, 1, true);
  const Words flags = {"--plane", "none", "--tile-size", "1"};
  ASSERT_TRUE(succeeded(score("in", "whole.pcd", flags)));
  ASSERT_TRUE(succeeded(score("in", "m.tiles", flags)));
  EXPECT_EQ(merged("m.tiles"), content("whole.pcd"));
}

TEST(ScoreStoreTerrain, InAnyFormat) {
  const PointCloud cloud = rocks();
  const libmap::FileEncoding compressed = libmap::FileEncoding::binary_compressed;
  fs::create_directories(scratch("in"));
  const auto part = [&](std::size_t n) {
    std::vector<std::size_t> indices;
    for (std::size_t i = n; i < cloud.size(); i += 6) indices.push_back(i);
    return libmap::select_points(cloud, indices);
  };
  libmap::write_cloud(scratch("in/0.pcd"), part(0));
  libmap::write_cloud(scratch("in/1.pcd"), part(1), {.encoding = compressed});
  libmap::write_cloud(scratch("in/2.ply"), part(2), {.big_endian = true});
  libmap::write_cloud(scratch("in/3.csv"), part(3));
  libmap::write_cloud(scratch("in/4.csv"), part(4));
  libmap::write_cloud(scratch("in/5.ply"), part(5), {.encoding = libmap::FileEncoding::ascii});
  graspmap_test::write_text(scratch("in/notes.txt"), "no cloud");
  ASSERT_TRUE(succeeded(score("in", "whole.pcd")));
  ASSERT_TRUE(succeeded(score("in", "m.tiles")));
  EXPECT_EQ(merged("m.tiles"), content("whole.pcd"));
}

TEST(ScoreStoreTerrain, NamesWithSpacesAndASlash) {
  write_tiles("the terrain", rocks(), 2, true);
  ASSERT_TRUE(succeeded(score("the terrain", "my map.tiles/")));
  EXPECT_EQ(index_of("my map.tiles").manifest.inputs.front().path, "the terrain/piece_0.pcd");
  EXPECT_TRUE(fs::exists(scratch("my map.tiles.json")));
}

TEST(ScoreStoreTerrain, WithoutPointsOrWithPointsWithoutAPosition) {
  PointCloud cloud;
  write_tiles("in", cloud, 2, true);
  EXPECT_TRUE(bad_input(score("in", "m.tiles"), {.file = "in"}));
  EXPECT_FALSE(fs::exists(scratch("m.tiles/index.json")));
  cloud = rocks();
  cloud.positions[77].y() = std::nan("");
  cloud.positions[78].x() = INFINITY;
  write_tiles("in", cloud, 2, true);
  ASSERT_TRUE(succeeded(score("in", "whole.pcd")));
  ASSERT_TRUE(succeeded(score("in", "m.tiles")));
  EXPECT_EQ(merged("m.tiles"), content("whole.pcd"));
}

TEST(ScoreStoreTerrain, PiecesThatDoNotFit) {
  PointCloud cloud = rocks();
  write_tiles("in", cloud, 1, true);
  cloud.normals.clear();
  libmap::write_cloud(scratch("in/second.pcd"), cloud);
  EXPECT_TRUE(bad_input(score("in", "m.tiles"), {.file = "in/second.pcd"}));
  EXPECT_TRUE(bad_input(score("in", "m.pcd"), {.file = "in/second.pcd"}));
  graspmap_test::write_text(scratch("in/second.pcd"), "VERSION 0.7\nDATA binary\n");
  EXPECT_TRUE(
      bad_input(score("in", "m.tiles"), {.file = "in/second.pcd", .field = "header line FIELDS"}));
  fs::create_directories(scratch("none"));
  EXPECT_TRUE(bad_input(score("none", "m.tiles"), {.file = "none"}));
}

TEST(ScoreStoreOptions, WhatNeedsTheCloudInMemory) {
  write_tiles("in", rocks(), 1, true);
  for (const char* method : {"thesis", "envelope"})
    EXPECT_TRUE(bad_input(score("in", "m.tiles", {"--method", method}),
                          {.field = "method", .value = method}));
  EXPECT_TRUE(bad_input(score("in", "m.tiles", {"--interpolation"}),
                        {.field = "interpolation", .value = "true"}));
  EXPECT_TRUE(bad_input(score("in", "m.pcd", {"--append"}), {.field = "--append"}));
  EXPECT_TRUE(
      bad_input(score("in", "m.tiles", {"--force", "--tile", "1/2"}), {.field = "--force"}));
  EXPECT_TRUE(bad_input(score("in", "m.tiles", {"--max-points-in-memory", "0"}),
                        {.field = "--max-points-in-memory", .value = "0", .bound = ">= 1"}));
  EXPECT_FALSE(fs::exists(scratch("m.tiles")));
}

TEST(ScoreStoreOptions, DryRunWritesNothing) {
  write_tiles("in", rocks(), 1, true);
  ASSERT_TRUE(succeeded(score("in", "m.tiles", {"--dry-run"})));
  EXPECT_FALSE(fs::exists(scratch("m.tiles")));
}

class ScoreStoreAgain : public testing::Test {
 protected:
  ScoreStoreAgain() { write_tiles("in", rocks(), 2, true); }
};

TEST_F(ScoreStoreAgain, SecondRunScoresNothing) {
  ASSERT_TRUE(succeeded(score("in", "m.tiles")));
  const auto files = map_files("m.tiles");
  const std::size_t lines = journal_lines("m.tiles");
  EXPECT_EQ(lines, 49u);
  const ProgramResult again = score("in", "m.tiles");
  ASSERT_TRUE(succeeded(again));
  EXPECT_EQ(map_files("m.tiles"), files);
  EXPECT_EQ(journal_lines("m.tiles"), lines);
  // Nothing else is left in it.
  for (const auto& [name, text] : files_in("m.tiles"))
    EXPECT_TRUE(name == "index.json" || name.starts_with("tiles/") || name.starts_with("progress/"))
        << name;
}

TEST_F(ScoreStoreAgain, SharesAndThreadsGiveTheSameBytes) {
  ASSERT_TRUE(succeeded(score("in", "m.tiles", {"--threads", "1"})));
  ASSERT_TRUE(succeeded(score("in", "n.tiles", {"--tile", "2/2", "--threads", "3"})));
  ASSERT_TRUE(succeeded(score("in", "n.tiles", {"--max-points-in-memory", "3000"})));
  EXPECT_EQ(map_files("n.tiles"), map_files("m.tiles"));
  EXPECT_EQ(journal_lines("n.tiles"), 49u);
}

TEST_F(ScoreStoreAgain, DamagedAndLostTilesAreMadeAgain) {
  ASSERT_TRUE(succeeded(score("in", "m.tiles")));
  const auto files = map_files("m.tiles");
  const libgtd::TileStoreIndex index = index_of("m.tiles");
  const fs::path first = scratch("m.tiles") / index.tiles[3].file;
  fs::resize_file(first, fs::file_size(first) - 1);
  std::fstream(scratch("m.tiles") / index.tiles[4].file, std::ios::in | std::ios::out)
      .seekp(600)
      .put('x');
  fs::remove(scratch("m.tiles") / index.tiles[5].file);
  EXPECT_TRUE(graspmap_test::is_error(
      graspmap_test::error_of([&] { libgtd::tile_path(scratch("m.tiles"), index.tiles[3]); }),
      {.file = first, .field = "size"}));
  EXPECT_NO_THROW(libgtd::tile_path(scratch("m.tiles"), index.tiles[4]));
  EXPECT_TRUE(graspmap_test::is_error(
      graspmap_test::error_of(
          [&] { libgtd::checked_tile_path(scratch("m.tiles"), index.tiles[4]); }),
      {.file = scratch("m.tiles") / index.tiles[4].file, .field = "SHA-256"}));
  EXPECT_TRUE(graspmap_test::is_error(
      graspmap_test::error_of([&] { libgtd::tile_path(scratch("m.tiles"), index.tiles[5]); }),
      {.file = scratch("m.tiles") / index.tiles[5].file}));
  ASSERT_TRUE(succeeded(score("in", "m.tiles")));
  EXPECT_EQ(map_files("m.tiles"), files);
  EXPECT_EQ(journal_lines("m.tiles"), 52u);
}

TEST_F(ScoreStoreAgain, DamagedIndexAndJournalAreMended) {
  ASSERT_TRUE(succeeded(score("in", "m.tiles")));
  const auto files = map_files("m.tiles");
  graspmap_test::write_text(scratch("m.tiles/index.json"), "{\"format\"");
  std::string journal = content("m.tiles/progress/1_of_1.jsonl");
  // The last line is truncated, and one in the middle is not JSON.
  journal.resize(journal.size() - 20);
  journal.replace(journal.find("\"sha256\""), 3, "???");
  graspmap_test::write_text(scratch("m.tiles/progress/1_of_1.jsonl"), journal);
  ASSERT_TRUE(succeeded(score("in", "m.tiles")));
  EXPECT_EQ(map_files("m.tiles"), files);
  EXPECT_EQ(journal_lines("m.tiles"), 51u);
  // Without the plan the inputs of the tiles are unknown.
  graspmap_test::write_text(scratch("m.tiles/progress/plan.json"), "{}");
  EXPECT_TRUE(bad_input(score("in", "m.tiles"), {.file = "m.tiles/progress/plan.json"}));
  fs::remove_all(scratch("m.tiles/progress"));
  EXPECT_TRUE(bad_input(score("in", "m.tiles"), {.file = "m.tiles", .about = "--force"}));
  ASSERT_TRUE(succeeded(score("in", "m.tiles", {"--force"})));
  EXPECT_EQ(map_files("m.tiles"), files);
}

TEST_F(ScoreStoreAgain, OtherParametersOrInputsAreNotMixed) {
  ASSERT_TRUE(succeeded(score("in", "m.tiles", {"--tile", "1/2"})));
  const auto files = files_in("m.tiles");
  EXPECT_TRUE(bad_input(score("in", "m.tiles", {"--extra-void-layers", "2"}),
                        {.file = "m.tiles", .about = "--force"}));
  EXPECT_TRUE(bad_input(score("in", "m.tiles", {"--tile-size", "0.3"}), {.file = "m.tiles"}));
  EXPECT_TRUE(bad_input(score("in/piece_0.pcd", "m.tiles"), {.file = "m.tiles"}));
  EXPECT_EQ(files_in("m.tiles"), files);
  ASSERT_TRUE(succeeded(score("in", "m.tiles", {"--extra-void-layers", "2", "--force"})));
  ASSERT_TRUE(succeeded(score("in", "n.tiles", {"--extra-void-layers", "2"})));
  EXPECT_EQ(map_files("m.tiles"), map_files("n.tiles"));
}

TEST_F(ScoreStoreAgain, ForeignFoldersAreNotTouched) {
  fs::create_directories(scratch("m.tiles"));
  graspmap_test::write_text(scratch("m.tiles/diary.txt"), "dear");
  for (const Words& flags : {Words{}, Words{"--force"}})
    EXPECT_TRUE(bad_input(score("in", "m.tiles", flags), {.file = "m.tiles"}));
  EXPECT_EQ(files_in("m.tiles").size(), 1u);
  graspmap_test::write_text(scratch("n.tiles"), "a file");
  EXPECT_TRUE(bad_input(score("in", "n.tiles"), {.file = "n.tiles"}));
  fs::rename(scratch("in"), scratch("in.tiles"));
  EXPECT_TRUE(bad_input(score("in.tiles", "in.tiles"), {.file = "in.tiles"}));
}

TEST_F(ScoreStoreAgain, OneProcessAShare) {
  ASSERT_TRUE(succeeded(score("in", "m.tiles", {"--tile", "1/2"})));
  const libmap::FileLock lock(scratch("m.tiles/progress/1_of_2.jsonl"));
  const ProgramResult second = score("in", "m.tiles", {"--tile", "1/2"});
  EXPECT_TRUE(ended_with(
      second, {.file = "m.tiles", .about = "share 1/2", .kind = libmap::ErrorKind::failed}));
  ASSERT_TRUE(succeeded(score("in", "m.tiles", {"--tile", "2/2"})));
  EXPECT_EQ(index_of("m.tiles").tiles.size(), 43u);
}

TEST_F(ScoreStoreAgain, ManySharesAtOnce) {
  ASSERT_TRUE(succeeded(score("in", "m.tiles")));
  std::vector<std::thread> runs;
  std::vector<ProgramResult> results(4);
  for (std::size_t n = 0; n < results.size(); ++n)
    runs.emplace_back([&results, n] {
      results[n] = score("in", "n.tiles", {"--tile", std::to_string(n + 1) + "/4"});
    });
  for (std::thread& run : runs) run.join();
  for (const ProgramResult& result : results) EXPECT_TRUE(succeeded(result));
  EXPECT_EQ(map_files("n.tiles"), map_files("m.tiles"));
}

TEST_F(ScoreStoreAgain, ReadersSayWhatIsMissing) {
  ASSERT_TRUE(succeeded(score("in", "m.tiles", {"--tile", "1/3"})));
  const auto expect_error = [](const char* store, const char* fault) {
    EXPECT_TRUE(graspmap_test::is_error(graspmap_test::error_of([&] { index_of(store); }),
                                        {.file = scratch(store), .about = fault}));
  };
  expect_error("m.tiles", "16 of 49");
  expect_error("in", "index.json");
  expect_error("none.tiles", "no such");
  EXPECT_TRUE(graspmap_test::is_error(
      graspmap_test::error_of([&] { libgtd::finish_tile_store(scratch("m.tiles")); }),
      {.file = scratch("m.tiles"), .about = "16 of 49"}));
  ASSERT_TRUE(succeeded(score("in", "m.tiles")));
  const auto files = map_files("m.tiles");
  fs::remove(scratch("m.tiles/index.json"));
  expect_error("m.tiles", "index.json");
  libgtd::finish_tile_store(scratch("m.tiles"));
  EXPECT_EQ(map_files("m.tiles"), files);
}

// Starts `graspmap score in -o m.tiles` and kills it when `is_time` returns true. Returns false if
// it ended before.
template <typename IsTime>
bool score_killed(const IsTime& is_time) {
  const std::string program = (graspmap_test::build_folder() / "graspmap").string();
  const std::string folder = graspmap_test::scratch_folder().string();
  const pid_t child = fork();
  if (child == 0) {
    setpgid(0, 0);
    if (chdir(folder.c_str()) != 0) _exit(1);
    execl(program.c_str(), "graspmap", "score", "in", "-o", "m.tiles", "--zero-plane", "-0.1",
          "--tile-size", "0.2", "--max-points-in-memory", "2500", "--quiet", nullptr);
    _exit(1);
  }
  setpgid(child, child);
  int status = 0;
  while (!is_time()) {
    if (waitpid(child, &status, WNOHANG) == child) return false;
    std::this_thread::sleep_for(std::chrono::microseconds(200));
  }
  kill(-child, SIGKILL);
  waitpid(child, &status, 0);
  return true;
}

TEST_F(ScoreStoreAgain, KilledAtAnyMoment) {
  ASSERT_TRUE(succeeded(score("in", "n.tiles", {"--max-points-in-memory", "2500"})));
  const auto files = map_files("n.tiles");
  fs::remove_all(scratch("m.tiles"));
  // Killed while it plans, then after more and more tiles; each run resumes the last one.
  int killed = 0;
  killed += score_killed([] { return fs::exists(scratch("m.tiles")); }) ? 1 : 0;
  killed += score_killed([] { return fs::exists(scratch("m.tiles/progress/plan.json")); }) ? 1 : 0;
  for (const std::size_t lines : {1u, 5u, 12u, 20u, 30u})
    killed += score_killed([&] { return journal_lines("m.tiles") >= lines; }) ? 1 : 0;
  EXPECT_GE(killed, 5);
  EXPECT_FALSE(fs::exists(scratch("m.tiles/index.json")));
  ASSERT_TRUE(succeeded(score("in", "m.tiles", {"--max-points-in-memory", "2500"})));
  EXPECT_EQ(map_files("m.tiles"), files);
  // No completed tile was made again.
  EXPECT_EQ(journal_lines("m.tiles"), 49u);
}

TEST(ScoreStoreAppend, NewPiecesRedoWhatTheyTouch) {
  const Words none = {"--plane", "none"};
  const Words append = {"--plane", "none", "--append"};
  write_tiles("in", rocks(), 3, true);
  ASSERT_TRUE(succeeded(score("in", "all.tiles", none)));
  fs::rename(scratch("in/piece_1.pcd"), scratch("piece_1.pcd"));
  ASSERT_TRUE(succeeded(score("in", "m.tiles", none)));
  const std::size_t before = journal_lines("m.tiles");
  // Nothing new: nothing to do.
  ASSERT_TRUE(succeeded(score("in", "m.tiles", append)));
  EXPECT_EQ(journal_lines("m.tiles"), before);
  fs::rename(scratch("piece_1.pcd"), scratch("in/piece_1.pcd"));
  EXPECT_TRUE(bad_input(score("in", "m.tiles", none), {.file = "m.tiles", .about = "--append"}));
  ASSERT_TRUE(succeeded(score("in", "m.tiles", append)));
  EXPECT_EQ(map_files("m.tiles"), map_files("all.tiles"));
  // The strip is 0.4 m wide and its halo 0.24 m: not all of the columns of tiles.
  EXPECT_LT(journal_lines("m.tiles") - before, 49u);
  EXPECT_GE(journal_lines("m.tiles") - before, 12u);
  // A store of more pieces than there are now is another one.
  fs::remove(scratch("in/piece_0.pcd"));
  EXPECT_TRUE(bad_input(score("in", "m.tiles", append), {.file = "m.tiles"}));
}

TEST(ScoreStoreAppend, OnlyWhereOldTilesStayAsTheyAre) {
  write_tiles("in", rocks(), 3, true);
  fs::rename(scratch("in/piece_2.pcd"), scratch("piece_2.pcd"));
  ASSERT_TRUE(succeeded(score("in", "m.tiles")));
  ASSERT_TRUE(succeeded(score("in", "n.tiles", {"--plane", "none", "--method", "climblab"})));
  fs::rename(scratch("piece_2.pcd"), scratch("in/piece_2.pcd"));
  EXPECT_TRUE(
      bad_input(score("in", "m.tiles", {"--append"}), {.file = "m.tiles", .about = "--plane"}));
  EXPECT_TRUE(
      bad_input(score("in", "n.tiles", {"--append", "--plane", "none", "--method", "climblab"}),
                {.file = "n.tiles", .about = "--method"}));
}

TEST(ScoreStoreBadInput, LeavesNoFolderBehind) {
  graspmap_test::write_text(scratch("empty.csv"), "x,y,z\n");
  graspmap_test::write_text(scratch("bad.pcd"), "no cloud");
  graspmap_test::write_text(scratch("line.csv"), "x,y,z\n0,0,0\n1,0,0\n2,0,0\n");
  const Words before = graspmap_test::names_in_scratch();
  EXPECT_TRUE(graspmap_test::bad_input(score("empty.csv", "m.tiles"), {.file = "empty.csv"}));
  EXPECT_TRUE(graspmap_test::bad_input(score("bad.pcd", "m.tiles"), {.file = "bad.pcd"}));
  EXPECT_TRUE(bad_input(score("line.csv", "m.tiles"), {.file = "line.csv"}));
  EXPECT_EQ(graspmap_test::names_in_scratch(), before);
}

}  // namespace score_store_test
