#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "libmap/camera/matrix_codec.h"
#include "libmap/core/file_output.h"
#include "libmap/scan/rtabmap_blobs.h"
#include "libmap/scan/rtabmap_reader.h"
#include "libmap/scan/rtabmap_writer.h"
#include "libmap/scan/sqlite_file.h"
#include "tests/libmap/scan/database_rows.h"
#include "tests/libmap/scan/example_scan.h"
#include "tests/support/lower_limit.h"
#include "tests/support/test_support.h"

namespace rtabmap_optimized_poses_test {

namespace fs = std::filesystem;
using graspmap_test::ExampleScan;
using graspmap_test::open_database;
using graspmap_test::query;
using graspmap_test::Rows;
using graspmap_test::write_database;
using libmap::Pose;

fs::path scratch(const std::string& name) { return graspmap_test::scratch_folder() / name; }

// All rows of all tables except Admin.
std::map<std::string, Rows> tables_of(const fs::path& path) {
  SQLite::Database database = open_database(path);
  std::map<std::string, Rows> tables;
  for (const auto& row : query(database, "SELECT name FROM sqlite_master WHERE type = 'table'"))
    tables[row[0].substr(2)] =
        query(database, "SELECT rowid, * FROM " + row[0].substr(2) + " ORDER BY rowid");
  tables.erase("Admin");
  return tables;
}

std::map<int, Pose> other_poses(const libmap::PoseGraph& graph) {
  std::map<int, Pose> poses;
  for (const libmap::GraphNode& node : graph.nodes)
    poses[node.id] = graspmap_test::random_float_pose();
  return poses;
}

TEST(CopyWithOptimizedPoses, ChangesNothingElse) {
  GRASPMAP_REQUIRE_DATA();
  for (const char* name : {"site_drift.db", "site_killed.db", "site_tiny.db", "site_tiny_v0160.db",
                           "site_tiny_v0180.db"}) {
    SCOPED_TRACE(name);
    const fs::path source = graspmap_test::data_folder() / "scans" / name;
    const fs::path target = scratch(name);
    const libmap::RtabmapDatabase before(source);
    const std::map<int, Pose> poses = other_poses(before.graph());
    libmap::copy_with_optimized_poses(source, target, poses);
    const libmap::RtabmapDatabase after(target);
    libmap::PoseGraph expected = before.graph();
    expected.optimized_map_from_base = poses;
    graspmap_test::expect_same_graph(after.graph(), expected, 2e-7);
    EXPECT_TRUE(tables_of(target) == tables_of(source));
    EXPECT_EQ(query(target, "SELECT * FROM sqlite_master"),
              query(source, "SELECT * FROM sqlite_master"));
    EXPECT_EQ(query(target, "SELECT version, preview_image, time_enter FROM Admin"),
              query(source, "SELECT version, preview_image, time_enter FROM Admin"));
    EXPECT_EQ(query(target, "PRAGMA integrity_check"), (Rows{{"3:ok"}}));
  }
}

TEST(CopyWithOptimizedPoses, MovesTheLastLocalizationWithItsNode) {
  ExampleScan scan = graspmap_test::example_scan();
  write_database(scratch("a.db"), scan);
  const auto localization_after = [&](const std::map<int, Pose>& poses) {
    libmap::copy_with_optimized_poses(scratch("a.db"), scratch("b.db"), poses);
    return libmap::RtabmapDatabase(scratch("b.db")).stored_map().last_localization_map_from_base;
  };
  const std::map<int, Pose> poses = other_poses(scan.graph);
  ASSERT_TRUE(localization_after(poses));
  EXPECT_TRUE(localization_after(poses)->isApprox(poses.at(9), 1e-6));
  EXPECT_FALSE(localization_after({{1, Pose::Identity()}}));
  EXPECT_FALSE(localization_after({}));
  EXPECT_EQ(query(scratch("b.db"), "SELECT opt_ids, opt_poses, opt_last_localization FROM Admin"),
            (Rows{{"NULL", "NULL", "NULL"}}));
}

// RTAB-Map would show its map of the earlier poses with the new poses.
TEST(CopyWithOptimizedPoses, DropsTheStoredMap) {
  const ExampleScan scan = graspmap_test::example_scan();
  write_database(scratch("a.db"), scan);
  {
    SQLite::Database database(scratch("a.db").string(), SQLite::OPEN_READWRITE);
    database.exec(
        "UPDATE Admin SET preview_image = x'07', opt_cloud = x'01', opt_polygons_size = 3, "
        "opt_polygons = x'02', opt_tex_coords = x'03', opt_tex_materials = x'04', opt_map = x'05', "
        "opt_map_x_min = 1, opt_map_y_min = 2, opt_map_resolution = 0.05, "
        "dictionary_index = x'06'");
  }
  libmap::copy_with_optimized_poses(scratch("a.db"), scratch("b.db"), other_poses(scan.graph));
  EXPECT_EQ(query(scratch("b.db"),
                  "SELECT opt_cloud, opt_polygons_size, opt_polygons, opt_tex_coords, "
                  "opt_tex_materials, opt_map, opt_map_x_min, opt_map_y_min, opt_map_resolution "
                  "FROM Admin"),
            (Rows{std::vector<std::string>(9, "NULL")}));
  EXPECT_EQ(query(scratch("b.db"), "SELECT preview_image, dictionary_index FROM Admin"),
            query(scratch("a.db"), "SELECT preview_image, dictionary_index FROM Admin"));
}

TEST(CopyWithOptimizedPoses, LandmarksMoveWithTheNodeThatSeesThem) {
  ExampleScan scan = graspmap_test::example_scan();
  const Pose landmark = graspmap_test::random_float_pose();
  scan.graph.optimized_map_from_base[-3] = landmark;
  scan.graph.links.push_back({.from = 9, .to = -3, .type = libmap::LinkType::landmark});
  // No node with a pose sees this landmark.
  scan.graph.optimized_map_from_base[-4] = landmark;
  scan.graph.links.push_back({.from = 5, .to = -4, .type = libmap::LinkType::landmark});
  write_database(scratch("a.db"), scan);
  const std::map<int, Pose> poses = other_poses(scan.graph);
  libmap::copy_with_optimized_poses(scratch("a.db"), scratch("b.db"), poses);
  SQLite::Database database(scratch("b.db").string());
  const auto matrix = [&](const char* column) {
    const auto blob = database.execAndGet(std::string("SELECT ") + column + " FROM Admin");
    return libmap::decode_matrix(
        {static_cast<const char*>(blob.getBlob()), static_cast<std::size_t>(blob.getBytes())});
  };
  const std::vector<int> ids = matrix("opt_ids").values<int>();
  EXPECT_EQ(ids, (std::vector<int>{-3, 1, 2, 5, 9}));
  const std::string stored = matrix("opt_poses").bytes;
  ASSERT_EQ(stored.size(), 5 * 48U);
  const Pose moved = *libmap::decode_pose(stored.substr(0, 48));
  const Pose before = scan.graph.optimized_map_from_base.at(9);
  EXPECT_TRUE((poses.at(9).inverse() * moved).isApprox(before.inverse() * landmark, 1e-5));
}

// Links and poses as RTAB-Map itself stores them: both directions, inverse transforms, one matrix;
// sizes and trailers of the blobs as in the database that it wrote.
TEST(CopyWithOptimizedPoses, NewRowsHaveTheFormOfRealOnes) {
  GRASPMAP_REQUIRE_DATA();
  const fs::path source = graspmap_test::data_folder() / "scans" / "site_full.db";
  const libmap::PoseGraph graph = libmap::RtabmapDatabase(source).graph();
  libmap::PoseLink link{.from = 1, .to = 17, .type = libmap::LinkType::local_space_closure};
  link.from_from_to = graspmap_test::random_float_pose();
  link.information(0, 5) = link.information(5, 0) = 0.25;
  libmap::copy_with_optimized_poses(source, scratch("b.db"), graph.optimized_map_from_base, {link});
  // Equal ids and poses: equal matrices, although their compression can differ.
  const char* trailers =
      "SELECT hex(substr(opt_ids, -12)), hex(substr(opt_poses, -12)), "
      "typeof(opt_last_localization), length(opt_last_localization) FROM Admin";
  EXPECT_EQ(query(scratch("b.db"), trailers), query(source, trailers));
  const std::string form =
      "SELECT DISTINCT typeof(from_id), typeof(to_id), typeof(type), typeof(information_matrix), "
      "length(information_matrix), typeof(transform), length(transform), typeof(user_data) "
      "FROM Link";
  EXPECT_EQ(query(scratch("b.db"), form), query(source, form));
  const std::string added =
      " FROM Link WHERE (from_id = 1 AND to_id = 17) OR "
      "(from_id = 17 AND to_id = 1)";
  EXPECT_EQ(query(source, "SELECT COUNT(*)" + added), (Rows{{"1:0"}}));
  EXPECT_EQ(query(scratch("b.db"), "SELECT COUNT(*), COUNT(DISTINCT information_matrix)" + added),
            (Rows{{"1:2", "1:1"}}));
  EXPECT_EQ(query(scratch("b.db"), "PRAGMA foreign_key_check"), Rows{});
}

// g2o drops a graph whose matrices differ by one bit across the diagonal, as by sums of products.
TEST(CopyWithOptimizedPoses, WrittenInformationIsExactlySymmetric) {
  ExampleScan scan = graspmap_test::example_scan();
  libmap::PoseLink link = scan.graph.links.front();
  link.information(1, 4) = std::nextafter(1234.25, 2000.0);
  link.information(4, 1) = 1234.25;
  scan.graph.links.front() = link;
  write_database(scratch("a.db"), scan);
  link.from = 1;  // no link to it yet
  link.to = 5;
  libmap::copy_with_optimized_poses(scratch("a.db"), scratch("b.db"), {}, {link});
  std::size_t tilted = 0;
  const libmap::RtabmapDatabase copy(scratch("b.db"));
  for (const libmap::PoseLink& read : copy.graph().links) {
    EXPECT_EQ(read.information, read.information.transpose());
    tilted += read.information(1, 4) > 1234.0 ? 1 : 0;
  }
  EXPECT_EQ(tilted, 2U) << "one written with the scan, one added";
}

TEST(CopyWithOptimizedPoses, DropsALocalizationThatStandsNowhere) {
  write_database(scratch("a.db"), graspmap_test::example_scan());
  {
    SQLite::Database database(scratch("a.db").string(), SQLite::OPEN_READWRITE);
    database.exec("UPDATE Admin SET opt_last_localization = zeroblob(48)");
  }
  libmap::copy_with_optimized_poses(scratch("a.db"), scratch("b.db"), {{9, Pose::Identity()}});
  EXPECT_EQ(query(scratch("b.db"), "SELECT opt_last_localization FROM Admin"), (Rows{{"NULL"}}));
}

TEST(CopyWithOptimizedPoses, CopiesADatabaseThatIsOpenElsewhere) {
  const ExampleScan scan = graspmap_test::example_scan();
  write_database(scratch("a.db"), scan);
  for (const std::string mode : {"DELETE", "WAL"}) {
    SCOPED_TRACE(mode);
    SQLite::Database other(scratch("a.db").string(), SQLite::OPEN_READWRITE);
    other.exec("PRAGMA journal_mode = " + mode);
    libmap::SqliteFile(scratch("a.db")).copy_to(scratch("plain.db"));
    EXPECT_EQ(query(scratch("plain.db"), "PRAGMA journal_mode"), (Rows{{"3:delete"}}));
    // Not committed: the copy must not contain it.
    other.exec("BEGIN IMMEDIATE; UPDATE Node SET map_id = 77;");
    libmap::copy_with_optimized_poses(scratch("a.db"), scratch("b.db"), {{9, Pose::Identity()}});
    other.exec("ROLLBACK");
    libmap::PoseGraph expected = scan.graph;
    expected.optimized_map_from_base = {{9, Pose::Identity()}};
    graspmap_test::expect_same_graph(libmap::RtabmapDatabase(scratch("b.db")).graph(), expected,
                                     2e-7);
    EXPECT_EQ(query(scratch("b.db"), "PRAGMA journal_mode"), (Rows{{"3:delete"}}));
    EXPECT_FALSE(fs::exists(scratch("b.db-wal")));
    EXPECT_FALSE(fs::exists(scratch("b.db-journal")));
  }
}

TEST(CopyWithOptimizedPoses, RefusesWhatHasNoPlaceForThem) {
  {
    SQLite::Database other(scratch("other.db").string(),
                           SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    other.exec("CREATE TABLE Weather (day TEXT)");
    SQLite::Database old(scratch("old.db").string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    old.exec(
        "CREATE TABLE Node (id INTEGER); CREATE TABLE Admin (version TEXT);"
        "INSERT INTO Admin VALUES ('0.11.8')");
  }
  for (const auto& [name, word] :
       std::map<std::string, std::string>{{"other.db", "no table Node"}, {"old.db", "0.13"}}) {
    const libmap::Error error = graspmap_test::error_of([&, &name = name] {
      libmap::copy_with_optimized_poses(scratch(name), scratch("b.db"), {});
    });
    EXPECT_TRUE(graspmap_test::is_error(error, {.file = scratch(name), .about = word}));
  }
}

// Pages that can be read but not written: SQLite's error is reported for the source.
TEST(CopyWithOptimizedPoses, ABrokenSourceIsNamed) {
  write_database(scratch("a.db"), graspmap_test::example_scan());
  std::fstream file(scratch("a.db"), std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(20).put('\xff');  // unused bytes of each page
  file.close();
  const libmap::Error error = graspmap_test::error_of([&] {
    libmap::copy_with_optimized_poses(scratch("a.db"), scratch("b.db"), {{1, Pose::Identity()}});
  });
  EXPECT_EQ(error.kind(), libmap::ErrorKind::bad_input);
  EXPECT_EQ(error.context().file, scratch("a.db").string());
}

TEST(CopyWithOptimizedPoses, RefusesTablesOfAnotherForm) {
  const auto refusal_of = [](const std::string& changes) {
    write_database(scratch("a.db"), graspmap_test::example_scan());
    SQLite::Database(scratch("a.db").string(), SQLite::OPEN_READWRITE).exec(changes);
    const libmap::Error error = graspmap_test::error_of([] {
      libmap::copy_with_optimized_poses(scratch("a.db"), scratch("b.db"), {},
                                        {{.from = 1, .to = 9}});
    });
    EXPECT_EQ(error.context().file, scratch("a.db").string());
    return error;
  };
  EXPECT_TRUE(graspmap_test::is_error(
      refusal_of("INSERT INTO Admin (version) VALUES ('0.23.0')"),
      {.field = "number of rows of table Admin", .value = "2", .bound = "1"}));
  EXPECT_TRUE(graspmap_test::is_error(
      refusal_of("DELETE FROM Admin"),
      {.field = "number of rows of table Admin", .value = "0", .bound = "1"}));
  EXPECT_TRUE(graspmap_test::is_error(
      refusal_of("DROP TABLE Link; CREATE TABLE Link (from_id INTEGER, to_id INTEGER, "
                 "type INTEGER, variance FLOAT, transform BLOB)"),
      {.about = "0.13"}));
}

TEST(CopyWithOptimizedPoses, ReportsAFullDisk) {
  write_database(scratch("a.db"), graspmap_test::example_scan());
  std::map<int, Pose> landmarks;
  for (int id = -2000; id < 0; ++id) landmarks[id] = graspmap_test::random_float_pose();
  // Failures while the file is copied, and while the copy is changed.
  for (const std::uintmax_t bytes : {std::uintmax_t{8192}, fs::file_size(scratch("a.db"))}) {
    const libmap::Error error = graspmap_test::error_of([&] {
      const graspmap_test::FileSizeLimit limit(bytes);
      libmap::copy_with_optimized_poses(scratch("a.db"), scratch("b.db"), landmarks);
    });
    EXPECT_EQ(error.context().file, scratch("b.db").string());
    EXPECT_TRUE(graspmap_test::is_error(error, {.file = "b.db", .kind = libmap::ErrorKind::failed}))
        << error.what();
    EXPECT_EQ(error.kind(), libmap::ErrorKind::failed);
  }
  EXPECT_EQ(fs::file_size(scratch("b.db")), fs::file_size(scratch("a.db")));
}

}  // namespace rtabmap_optimized_poses_test
