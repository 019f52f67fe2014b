#include "libmap/scan/sqlite_file.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>
#include <sqlite3.h>
#include <sys/wait.h>
#include <unistd.h>

#include <map>
#include <set>

#include "libmap/scan/rtabmap_reader.h"
#include "libmap/scan/scan_source.h"
#include "tests/libmap/scan/sample_database.h"
#include "tests/support/test_support.h"

namespace sqlite_file_test {

using namespace graspmap_test;
using libmap::RtabmapDatabase;
namespace fs = std::filesystem;

// Names and bytes of all files in the folder.
std::map<std::string, std::string> files_in(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    files[entry.path().filename()] = entry.is_regular_file() ? read_text(entry.path()) : "";
  return files;
}

std::set<std::string> names_in(const fs::path& folder) {
  std::set<std::string> names;
  for (const auto& [name, bytes] : files_in(folder)) names.insert(name);
  return names;
}

void expect_sample(const RtabmapDatabase& scan, std::size_t nodes = 3) {
  EXPECT_EQ(scan.graph().nodes.size(), nodes);
  EXPECT_EQ(scan.read_frame(2).color, sample_color(2));
}

TEST(SqliteFile, LeavesNothingBeside) {
  const fs::path folder = scratch_folder();
  write_sample(folder / "a.db");
  const auto before = files_in(folder);
  {
    const RtabmapDatabase scan(folder / "a.db");
    expect_sample(scan);
    EXPECT_EQ(files_in(folder), before);
  }
  EXPECT_EQ(files_in(folder), before);
}

TEST(SqliteFile, WalModeThatNobodyHasOpen) {
  const fs::path folder = scratch_folder();
  write_sample(folder / "a.db");
  execute(folder / "a.db", "PRAGMA journal_mode = WAL");
  const auto before = files_in(folder);
  ASSERT_EQ(before.size(), 1U);
  {
    const RtabmapDatabase scan(folder / "a.db");
    expect_sample(scan);
    EXPECT_EQ(files_in(folder), before);
  }
  EXPECT_EQ(files_in(folder), before);
}

TEST(SqliteFile, WalModeThatAnotherProgramWritesTo) {
  const fs::path folder = scratch_folder();
  write_sample(folder / "a.db");
  SQLite::Database writer((folder / "a.db").string(), SQLite::OPEN_READWRITE);
  writer.exec("PRAGMA journal_mode = WAL");
  writer.exec("INSERT INTO Node (id, map_id) VALUES (7, 0)");
  writer.exec("BEGIN IMMEDIATE; INSERT INTO Node (id, map_id) VALUES (8, 0)");
  const auto names = names_in(folder);
  {
    const RtabmapDatabase scan(folder / "a.db");
    expect_sample(scan, 4);  // committed data only
  }
  EXPECT_EQ(names_in(folder), names);
  writer.exec("COMMIT");
  expect_sample(RtabmapDatabase(folder / "a.db"), 5);
}

// The program crashed: its -wal contains data that the file does not.
TEST(SqliteFile, WalThatWasLeftBehind) {
  const fs::path folder = scratch_folder();
  write_sample(folder / "a.db");
  const fs::path left = folder / "left";
  fs::create_directory(left);
  {
    SQLite::Database writer((folder / "a.db").string(), SQLite::OPEN_READWRITE);
    writer.exec("PRAGMA journal_mode = WAL");
    writer.exec("INSERT INTO Node (id, map_id) VALUES (7, 0)");
    fs::copy(folder / "a.db", left / "a.db");
    fs::copy(folder / "a.db-wal", left / "a.db-wal");
  }
  const auto before = files_in(left);
  {
    const RtabmapDatabase scan(left / "a.db");
    expect_sample(scan, 4);
    EXPECT_EQ(files_in(left), before);
  }
  EXPECT_EQ(files_in(left), before);
}

// SQLite would delete a -wal without a valid frame.
TEST(SqliteFile, WalOfNoiseStays) {
  const fs::path folder = scratch_folder();
  write_sample(folder / "a.db");
  {
    SQLite::Database((folder / "a.db").string(), SQLite::OPEN_READWRITE)
        .exec("PRAGMA journal_mode = WAL");
  }
  graspmap_test::write_text(folder / "a.db-wal", std::string(9000, 'n'));
  const auto before = files_in(folder);
  expect_sample(RtabmapDatabase(folder / "a.db"));
  EXPECT_EQ(files_in(folder), before);
}

TEST(SqliteFile, RollbackModeWithAWriterInItsTransaction) {
  const fs::path folder = scratch_folder();
  write_sample(folder / "a.db");
  SQLite::Database writer((folder / "a.db").string(), SQLite::OPEN_READWRITE);
  writer.exec("BEGIN IMMEDIATE; INSERT INTO Node (id, map_id) VALUES (7, 0)");
  const RtabmapDatabase scan(folder / "a.db");
  expect_sample(scan);
  // Reading does not block the writer's commit.
  writer.exec("COMMIT");
  expect_sample(RtabmapDatabase(folder / "a.db"), 4);
}

// SQLite's default VFS, but without waiting.
class WithoutWaiting {
 public:
  WithoutWaiting() : files_(*sqlite3_vfs_find(nullptr)) {
    files_.zName = "without-waiting";
    files_.xSleep = [](sqlite3_vfs*, int microseconds) { return microseconds; };
    sqlite3_vfs_register(&files_, 1);
  }
  ~WithoutWaiting() { sqlite3_vfs_unregister(&files_); }
  WithoutWaiting(const WithoutWaiting&) = delete;
  WithoutWaiting& operator=(const WithoutWaiting&) = delete;

 private:
  sqlite3_vfs files_;
};

TEST(SqliteFile, CopyOfAFileThatStaysLocked) {
  const fs::path folder = scratch_folder();
  write_sample(folder / "a.db");
  const WithoutWaiting without_waiting;
  const libmap::SqliteFile file(folder / "a.db");
  SQLite::Database writer((folder / "a.db").string(), SQLite::OPEN_READWRITE);
  writer.exec("BEGIN EXCLUSIVE");
  const libmap::Error error = error_of([&] { file.copy_to(folder / "b.db"); });
  EXPECT_TRUE(is_error(error, {.file = folder / "a.db", .kind = libmap::ErrorKind::failed}));
  writer.exec("COMMIT");
  file.copy_to(folder / "b.db");
  expect_sample(RtabmapDatabase(folder / "b.db"));
}

TEST(SqliteFile, JournalOfAnInterruptedWrite) {
  const fs::path folder = scratch_folder();
  write_sample(folder / "a.db");
  // A process that is killed while it writes pages.
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    SQLite::Database writer((folder / "a.db").string(), SQLite::OPEN_READWRITE);
    writer.exec("PRAGMA cache_size = 1; PRAGMA cache_spill = 1; BEGIN EXCLUSIVE");
    writer.exec("UPDATE Data SET image = randomblob(200000)");
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(fs::exists(folder / "a.db-journal"));
  const auto before = files_in(folder);
  const libmap::Error error = error_of([&] { RtabmapDatabase(folder / "a.db"); });
  EXPECT_TRUE(graspmap_test::is_error(error, {.file = "a.db"})) << error.what();
  EXPECT_EQ(files_in(folder), before);
}

TEST(SqliteFile, FolderThatCannotBeWrittenTo) {
  const fs::path folder = scratch_folder();
  write_sample(folder / "a.db");
  write_sample(folder / "wal.db");
  execute(folder / "wal.db", "PRAGMA journal_mode = WAL");
  fs::permissions(folder / "a.db", fs::perms::owner_read);
  fs::permissions(folder / "wal.db", fs::perms::owner_read);
  fs::permissions(folder, fs::perms::owner_read | fs::perms::owner_exec);
  expect_sample(RtabmapDatabase(folder / "a.db"));
  expect_sample(RtabmapDatabase(folder / "wal.db"));
  fs::permissions(folder, fs::perms::owner_all);
  EXPECT_EQ(files_in(folder).size(), 2U);
}

TEST(SqliteFile, NamesThatAUriWouldReadOtherwise) {
  const fs::path file = scratch_folder() / "50% a?mode=rw#b &c ü.db";
  write_sample(file);
  expect_sample(RtabmapDatabase(file));
}

TEST(OpenScan, WhatIsNoScan) {
  const fs::path folder = scratch_folder();
  const auto expect_refused = [&](const std::string& name, const std::string& word) {
    EXPECT_TRUE(is_error(error_of([&] { libmap::open_scan(folder / name); }),
                         {.file = folder / name, .about = word}));
  };
  expect_refused("none.db", "no such file");
  write_text(folder / "empty.db", "");
  expect_refused("empty.db", "0 bytes");
  write_text(folder / "text.db", "this is no database");
  expect_refused("text.db", "not a scan");
  write_text(folder / "zeros.db", std::string(8192, '\0'));
  expect_refused("zeros.db", "not a scan");
  execute(folder / "other.db", "CREATE TABLE Customers (id INTEGER)");
  expect_refused("other.db", "no table Node");
  execute(folder / "nodes.db", "CREATE TABLE Node (name TEXT)");
  expect_refused("nodes.db", "no column id");
  execute(folder / "links.db", "CREATE TABLE Node (id INTEGER)");
  execute(folder / "links.db", "CREATE TABLE Link (a INTEGER)");
  expect_refused("links.db", "no column from_id");
  write_sample(folder / "whole.db");
  const std::string whole = read_text(folder / "whole.db");
  write_text(folder / "header.db", whole.substr(0, 50));
  expect_refused("header.db", "header");
  write_text(folder / "page.db", whole.substr(0, 4096));
  expect_refused("page.db", "SQLite");
  fs::create_directory(folder / "folder");
  EXPECT_TRUE(graspmap_test::is_error(error_of([&] { libmap::open_scan(folder / "folder"); }),
                                      {.file = folder / "folder"}));
}

TEST(OpenScan, ADatabaseWithoutNodesOrWithoutData) {
  const fs::path file = scratch_folder() / "a.db";
  execute(file, "CREATE TABLE Node (id INTEGER)");
  const auto scan = libmap::open_scan(file);
  EXPECT_TRUE(scan->graph().nodes.empty());
  EXPECT_TRUE(graspmap_test::is_error(error_of([&] { scan->read_frame(1); }),
                                      {.file = file, .field = "node", .value = "1"}));
  execute(file, "INSERT INTO Node VALUES (1)");
  EXPECT_TRUE(libmap::open_scan(file)->read_frame(1).color.empty());
}

}  // namespace sqlite_file_test
