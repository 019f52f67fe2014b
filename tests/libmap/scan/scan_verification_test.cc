#include "libmap/scan/scan_verification.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <cstring>

#include "libmap/camera/depth_codec.h"
#include "libmap/camera/matrix_codec.h"
#include "libmap/core/parallel.h"
#include "libmap/scan/rtabmap_reader.h"
#include "tests/libmap/scan/sample_database.h"
#include "tests/support/sanitizers.h"
#include "tests/support/test_support.h"

namespace scan_verification_test {

using namespace graspmap_test;
using libmap::RtabmapDatabase;
using libmap::ScanVerificationResult;
namespace fs = std::filesystem;

ScanVerificationResult verify(const fs::path& file) {
  return libmap::verify_scan(RtabmapDatabase(file));
}

std::vector<std::string> parts_of(const ScanVerificationResult& result) {
  std::vector<std::string> parts;
  for (const libmap::ScanFault& fault : result.faults)
    parts.push_back(std::to_string(fault.node) + " " + fault.part);
  return parts;
}

TEST(ScanVerification, ListsEveryBrokenPart) {
  const fs::path file = scratch_folder() / "a.db";
  write_sample(file);
  const ScanVerificationResult sound = verify(file);
  EXPECT_TRUE(sound.faults.empty());
  EXPECT_EQ(sound.nodes, 3U);
  for (const char* change :
       {"UPDATE Node SET gps = substr(gps, 1, 47) WHERE id = 1",
        "UPDATE Node SET velocity = substr(velocity, 1, 23) WHERE id = 2",
        "UPDATE Node SET env_sensors = substr(env_sensors, 1, 23) WHERE id = 3",
        "UPDATE Data SET image = substr(image, 1, 60) WHERE id = 1",
        "UPDATE Data SET depth = substr(depth, 1, 200) WHERE id = 1",
        "UPDATE Data SET calibration = substr(calibration, 1, 20) WHERE id = 1",
        "UPDATE Data SET depth_confidence = substr(depth_confidence, 2) WHERE id = 2",
        "UPDATE Data SET scan = substr(scan, 2), user_data = substr(user_data, 2), ground_cells = "
        "substr(ground_cells, 3) WHERE id = 2",
        "UPDATE Link SET transform = substr(transform, 5) WHERE from_id = 2 AND to_id = 3",
        "UPDATE Feature SET descriptor_size = 33 WHERE word_id = 1",
        "UPDATE Word SET descriptor_size = 9223372036854775807 WHERE id = 2",
        "UPDATE Admin SET opt_poses = substr(opt_poses, 2), preview_image = x'ffd8ff0102'",
        "INSERT INTO GlobalDescriptor VALUES (3, 0, NULL, x'0102030405060708090a0b0c0d0e')",
        "INSERT INTO Statistics (id, data) VALUES (3, x'0102030405060708090a0b0c0d0e')"})
    execute(file, change);
  // Five missing triangles.
  execute(file, "UPDATE Admin SET opt_polygons_size = 3, opt_polygons = ?",
          {libmap::encode_matrix(
              {1, 2, 1, libmap::MatrixElement::int32, bytes_of(std::vector<std::int32_t>{5, 0})})});
  EXPECT_EQ(parts_of(verify(file)),
            (std::vector<std::string>{
                "0 Admin", "0 Admin.opt_poses", "0 Admin.preview_image", "0 Word.descriptor",
                "1 Data.calibration", "1 Data.depth", "1 Data.image", "1 Feature.descriptor",
                "1 Node.gps", "2 Data.depth_confidence", "2 Data.ground_cells", "2 Data.scan",
                "2 Data.user_data", "2 Link.transform", "2 Node.velocity",
                "3 GlobalDescriptor.data", "3 Node.env_sensors", "3 Statistics.data"}));
}

TEST(ScanVerification, ImagesThatDoNotFitTheirCameras) {
  const fs::path file = scratch_folder() / "a.db";
  write_sample(file);
  const std::string one = sample_calibration({});
  execute(file, "UPDATE Data SET calibration = ? WHERE id = 2", {one + one + one});
  const ScanVerificationResult result = verify(file);
  ASSERT_EQ(parts_of(result), std::vector<std::string>{"2 Data"});
  EXPECT_NE(result.faults[0].reason.find("a multiple of 3"), std::string::npos);
}

std::string lines_of(const ScanVerificationResult& result) {
  std::string lines;
  for (const libmap::ScanFault& fault : result.faults)
    lines += (fault.node > 0 ? "node " + std::to_string(fault.node) + ": " : "") + fault.part +
             ": " + fault.reason + "\n";
  return lines;
}

// Unlike images, poses have no short blob that means NULL.
TEST(ScanVerification, PosesOfAFewBytes) {
  const fs::path file = scratch_folder() / "a.db";
  for (const char* blob : {"x'00'", "x'00000000'"}) {
    write_sample(file);
    execute(file, std::string("UPDATE Node SET pose = ") + blob + " WHERE id = 1");
    execute(file, std::string("UPDATE Link SET transform = ") + blob + " WHERE from_id = 3");
    const std::vector<std::string> parts = parts_of(verify(file));
    EXPECT_THAT(parts, testing::Contains("1 Node.pose")) << blob;
    EXPECT_THAT(parts, testing::Contains("3 Link.transform")) << blob;
    fs::remove(file);
  }
}

TEST(ScanVerification, TextWhereABlobBelongs) {
  const fs::path file = scratch_folder() / "a.db";
  write_sample(file);
  execute(file, "UPDATE Node SET velocity = 'fast' WHERE id = 2");
  execute(file, "UPDATE Link SET information_matrix = 'certain' WHERE from_id = 2 AND to_id = 3");
  const ScanVerificationResult result = verify(file);
  EXPECT_THAT(parts_of(result), testing::IsSupersetOf({std::string("2 Node.velocity"),
                                                       std::string("2 Link.information_matrix")}));
  const auto fault = std::find_if(result.faults.begin(), result.faults.end(),
                                  [](const auto& one) { return one.part == "Node.velocity"; });
  ASSERT_NE(fault, result.faults.end());
  EXPECT_NE(fault->reason.find("blob"), std::string::npos) << fault->reason;
  // An empty text is not a value.
  write_sample(scratch_folder() / "b.db");
  execute(scratch_folder() / "b.db", "UPDATE Node SET velocity = '' WHERE id = 2");
  EXPECT_EQ(lines_of(verify(scratch_folder() / "b.db")), "");
}

TEST(ScanVerification, NodesWithoutARowInData) {
  const fs::path file = scratch_folder() / "a.db";
  write_sample(file);
  execute(file, "DELETE FROM Data WHERE id = 2");
  const ScanVerificationResult result = verify(file);
  EXPECT_EQ(parts_of(result), std::vector<std::string>{"2 Data"});
  EXPECT_EQ(result.nodes, 2U);
}

TEST(ScanVerification, WhatTheGraphLeavesOut) {
  const fs::path file = scratch_folder() / "a.db";
  write_sample(file);
  // A valid blob of a missing node.
  execute(file, "UPDATE Link SET to_id = 77 WHERE from_id = 3 AND to_id = 1");
  const RtabmapDatabase scan(file);
  ASSERT_EQ(scan.warnings().size(), 1U);
  const ScanVerificationResult result = libmap::verify_scan(scan);
  EXPECT_EQ(lines_of(result), "graph: " + scan.warnings().front() + "\n");
  // A damaged pose is listed once, by its blob.
  execute(file, "UPDATE Node SET pose = x'01' WHERE id = 1");
  const std::vector<std::string> parts = parts_of(verify(file));
  EXPECT_THAT(parts, testing::Contains("1 Node.pose"));
  EXPECT_EQ(parts.size(), 2U);
}

// RTAB-Map's next version can have them, so they are not faults.
TEST(ScanVerification, UnknownTablesAndColumnsAreNoFaults) {
  const fs::path file = scratch_folder() / "a.db";
  write_sample(file);
  execute(file, "CREATE TABLE Notes (id INTEGER)");
  execute(file, "ALTER TABLE Node ADD COLUMN mood TEXT");
  const RtabmapDatabase scan(file);
  EXPECT_EQ(scan.warnings().size(), 2U);
  EXPECT_EQ(lines_of(libmap::verify_scan(scan)), "");
}

TEST(ScanVerification, IsTheSameForAnyNumberOfThreads) {
  const fs::path file = scratch_folder() / "a.db";
  write_sample(file);
  execute(file, "UPDATE Data SET depth = substr(depth, 1, 200), image = substr(image, 1, 60)");
  std::string lines[2];
  for (const unsigned threads : {1U, 2U}) {
    const libmap::ThreadLimit limit(threads);
    lines[threads - 1] = lines_of(verify(file));
  }
  EXPECT_EQ(lines[0], lines[1]);
  EXPECT_EQ(std::count(lines[0].begin(), lines[0].end(), '\n'), 6);
}

TEST(ScanVerification, RealDatabasesAreSound) {
  GRASPMAP_REQUIRE_DATA();
  std::size_t files = 0;
  for (const auto& entry : fs::directory_iterator(data_folder() / "scans")) {
    if (entry.path().extension() != ".db") continue;
    ++files;
    const ScanVerificationResult result = verify(entry.path());
    EXPECT_TRUE(result.faults.empty()) << entry.path() << lines_of(result);
    EXPECT_GT(result.blobs, 1000U);
  }
  EXPECT_GE(files, 8U);
}

// ---------------------------------------------------------------------------------- hostile files

struct BlobPlace {
  std::string table;
  std::string column;
  std::int64_t row = 0;
  std::string bytes;
};

// All stored blobs.
std::vector<BlobPlace> blobs_in(const fs::path& file) {
  const std::vector<std::pair<std::string, std::vector<std::string>>> columns{
      {"Node", {"pose", "ground_truth_pose", "velocity", "gps", "env_sensors"}},
      {"Data",
       {"image", "depth", "depth_confidence", "calibration", "scan", "scan_info", "ground_cells",
        "user_data"}},
      {"Link", {"information_matrix", "transform"}},
      {"Word", {"descriptor"}},
      {"Feature", {"descriptor"}},
      {"Admin", {"opt_ids", "opt_poses"}}};
  std::vector<BlobPlace> places;
  SQLite::Database database(file.string(), SQLite::OPEN_READONLY);
  for (const auto& [table, names] : columns)
    for (const std::string& name : names) {
      SQLite::Statement query(
          database, "SELECT rowid, " + name + " FROM " + table + " WHERE " + name + " IS NOT NULL");
      while (query.executeStep()) {
        const SQLite::Column blob = query.getColumn(1);
        places.push_back({table, name, query.getColumn(0).getInt64(),
                          std::string(static_cast<const char*>(blob.getBlob()),
                                      static_cast<std::size_t>(blob.getBytes()))});
      }
    }
  return places;
}

std::string mutated(std::string bytes) {
  auto& engine = random_engine();
  const auto place = [&] { return static_cast<std::size_t>(engine() % bytes.size()); };
  switch (engine() % 4) {
    case 0:
      bytes[place()] = static_cast<char>(engine());
      break;
    case 1:
      bytes.resize(place());
      break;
    case 2: {  // a wrong number
      const std::uint32_t number = engine() % 2 == 0 ? 0x7fffffffU : 0x80000000U;
      if (bytes.size() >= 4) std::memcpy(bytes.data() + engine() % (bytes.size() - 3), &number, 4);
      break;
    }
    default:
      for (int i = 0; i < 8; ++i) bytes[place()] = static_cast<char>(engine());
  }
  return bytes;
}

// Reads all content; each part is valid or throws one Error that names the file.
void read_all(const fs::path& file) {
  const RtabmapDatabase scan(file);
  const auto attempt = [&](const auto& step) {
    try {
      step();
    } catch (const libmap::Error& error) {
      EXPECT_EQ(error.context().file, file) << error.what();
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
    }
  };
  for (const libmap::GraphNode& node : scan.graph().nodes) {
    attempt([&] { scan.read_frame(node.id); });
    attempt([&] { scan.read_frame(node.id, {.color = false, .depth = false}); });
  }
  attempt([&] { scan.stored_map(); });
  attempt([&] { scan.each_content([](const libmap::NodeContent&) {}); });
  libmap::verify_scan(scan);
}

TEST(HostileDatabase, MutationsOfEveryBlob) {
  const fs::path file = scratch_folder() / "a.db";
  write_sample(file);
  const std::vector<BlobPlace> places = blobs_in(file);
  ASSERT_GT(places.size(), 40U);
  for (int round = 0; round < 400; ++round) {
    const BlobPlace& place = places[static_cast<std::size_t>(round) % places.size()];
    const std::string bytes = mutated(place.bytes);
    SCOPED_TRACE(place.table + "." + place.column + " round " + std::to_string(round));
    const std::string update = "UPDATE " + place.table + " SET " + place.column +
                               " = ? WHERE rowid = " + std::to_string(place.row);
    execute(file, update, {bytes});
    ASSERT_NO_FATAL_FAILURE(read_all(file));
    execute(file, update, {place.bytes});
  }
  EXPECT_TRUE(verify(file).faults.empty());
}

TEST(HostileDatabase, FlippedBytesOfTheFileItself) {
  const fs::path file = scratch_folder() / "a.db";
  const fs::path broken_file = scratch_folder() / "broken.db";
  write_sample(file);
  const std::string whole = read_text(file);
  for (int round = 0; round < 300; ++round) {
    std::string broken = whole;
    for (std::uint64_t i = 0; i <= random_engine()() % 4; ++i)
      broken[static_cast<std::size_t>(random_engine()() % broken.size())] =
          static_cast<char>(random_engine()());
    if (round % 5 == 0) broken.resize(static_cast<std::size_t>(random_engine()() % broken.size()));
    write_text(broken_file, broken);
    try {
      read_all(broken_file);
    } catch (const libmap::Error& error) {
      EXPECT_EQ(error.context().file, broken_file) << error.what();
    }
  }
}

long peak_kb() {
  struct rusage usage {};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

TEST(HostileDatabase, SizesThatLieTakeNoMemory) {
  const fs::path file = scratch_folder() / "a.db";
  write_sample(file);
  const auto int32s = [](const std::vector<std::uint32_t>& numbers) { return bytes_of(numbers); };
  const std::string scan_trailer = int32s({0x7fffffffU, 0x7fffffffU, 5U});
  execute(file, "UPDATE Data SET depth = ? WHERE id = 1",
          {"DEPTHRVL" + int32s({512U, 0x80000000U}) + std::string(64, '\x11')});
  execute(file, "UPDATE Data SET depth = ? WHERE id = 2",
          {"DEPTHRVL" + int32s({11000U, 11000U}) + std::string(64, '\x11')});
  execute(file, "UPDATE Data SET scan = ?, user_data = ? WHERE id = 2",
          {std::string(40, '\x78') + scan_trailer,
           std::string(40, '\x78') + int32s({30000U, 30000U, 0U})});
  execute(file, "UPDATE Data SET calibration = ? WHERE id = 3",
          {int32s({0, 23, 0, 0, 32, 24, 9, 0x7fffffffU, 0, 0, 12}) + std::string(200, '\0')});
  execute(file, "UPDATE Admin SET opt_poses = ?", {std::string(40, '\x78') + scan_trailer});
  const long before = peak_kb();
  EXPECT_EQ(parts_of(verify(file)),
            (std::vector<std::string>{"0 Admin.opt_poses", "1 Data.depth", "2 Data.depth",
                                      "2 Data.scan", "2 Data.user_data", "3 Data.calibration"}));
  if (graspmap_test::memory_can_be_limited) {
    EXPECT_LT(peak_kb() - before, 16 * 1024);
  }
}

}  // namespace scan_verification_test
