#include "libmap/tiles/tile_store_io.h"

#include <gtest/gtest.h>

#include "libmap/core/error.h"
#include "tests/support/test_support.h"

namespace tile_store_io_test {

namespace fs = std::filesystem;

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::scratch_folder;
using graspmap_test::write_text;
using libmap::TileJournal;
using libmap::TileStore;

const auto nothing = [] {};

std::vector<std::string> lines_of(const TileStore& store) {
  std::vector<std::string> lines;
  store.each_line([&](const std::string& text, const TileStore::Line& line) {
    EXPECT_EQ(TileStore::read_line(line), text);
    lines.push_back(text);
  });
  return lines;
}

TEST(TileStore, SharesKeepTheirJournals) {
  const TileStore store(scratch_folder() / "a" / "");
  EXPECT_EQ(store.folder(), scratch_folder() / "a");
  {
    TileJournal one = store.begin({1, 2}, nothing);
    TileJournal moved = std::move(one);
    TileJournal two = store.begin({2, 2}, nothing);
    two.add({"{\"tile\": 3}"});
    moved.add({"1", "22"});
    EXPECT_TRUE(is_error(
        error_of([&] {
          store.begin({1, 2}, nothing);
        }),
        {.file = graspmap_test::scratch_folder() / "a", .kind = libmap::ErrorKind::failed}));
    EXPECT_TRUE(is_error(
        error_of([&] { store.require_idle(); }),
        {.file = graspmap_test::scratch_folder() / "a", .kind = libmap::ErrorKind::failed}));
  }
  store.require_idle();
  EXPECT_EQ(lines_of(store), (std::vector<std::string>{"1", "22", "{\"tile\": 3}"}));
  // After a truncated line of a killed run.
  write_text(scratch_folder() / "a/progress/1_of_2.jsonl", "1\n2");
  store.begin({1, 2}, nothing).add({"3"});
  EXPECT_EQ(lines_of(store), (std::vector<std::string>{"1", "2", "3", "{\"tile\": 3}"}));
}

TEST(TileStore, APlanIsAgreedOnUnderTheLock) {
  const TileStore store(scratch_folder() / "a");
  EXPECT_FALSE(store.plan_text());
  store.begin({}, [&] {
    EXPECT_FALSE(libmap::FileLock::try_lock(scratch_folder() / "a/progress/lock"));
    store.write_plan("plan");
  });
  EXPECT_EQ(store.plan_text(), "plan");
  write_text(store.tiles() / "x", "");
  write_text(store.index_path(), "");
  store.clear();
  EXPECT_FALSE(store.plan_text());
  EXPECT_TRUE(lines_of(store).empty());
  EXPECT_TRUE(fs::is_empty(store.tiles()));
  store.remove_if_bare();
  EXPECT_FALSE(fs::exists(store.folder()));
}

TEST(TileStore, NothingIsLeftOfAPlanThatFails) {
  const TileStore store(scratch_folder() / "a");
  const auto fail = [] { throw libmap::Error("no"); };
  EXPECT_EQ(error_of([&] { store.begin({}, fail); }).reason(), "no");
  EXPECT_FALSE(fs::exists(store.folder()));
  store.begin({}, [&] { store.write_plan("plan"); }).add({"1"});
  EXPECT_EQ(error_of([&] { store.begin({}, fail); }).reason(), "no");
  EXPECT_EQ(lines_of(store), std::vector<std::string>{"1"});
}

TEST(TileStore, OtherFoldersAreNotTouched) {
  fs::create_directory(scratch_folder() / "a");
  write_text(scratch_folder() / "a/diary.txt", "dear");
  EXPECT_TRUE(is_error(error_of([&] { TileStore(scratch_folder() / "a").begin({}, nothing); }),
                       {.file = graspmap_test::scratch_folder() / "a"}));
  EXPECT_TRUE(
      is_error(error_of([&] { TileStore(scratch_folder() / "a/diary.txt").begin({}, nothing); }),
               {.file = "diary.txt"}));
  EXPECT_EQ(graspmap_test::read_text(scratch_folder() / "a/diary.txt"), "dear");
}

TEST(TileStore, AKeyIsOfParametersInputsAndVersion) {
  libmap::Manifest manifest;
  manifest.version = "1";
  manifest.parameters.emplace_back("a", true);
  manifest.inputs.push_back({"x", "01", 5});
  const std::string key = libmap::key_of(manifest);
  manifest.inputs.back().path = "y";
  manifest.command = "mesh";
  EXPECT_EQ(libmap::key_of(manifest), key);
  for (const auto change : {+[](libmap::Manifest& m) { m.version = "2"; },
                            +[](libmap::Manifest& m) { m.parameters.clear(); },
                            +[](libmap::Manifest& m) { m.inputs.back().sha256 = "02"; }}) {
    libmap::Manifest other = manifest;
    change(other);
    EXPECT_NE(libmap::key_of(other), key);
  }
}

}  // namespace tile_store_io_test
