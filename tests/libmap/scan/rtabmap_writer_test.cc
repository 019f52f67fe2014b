#include "libmap/scan/rtabmap_writer.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "libmap/core/file_output.h"
#include "libmap/scan/matrix_codec.h"
#include "libmap/scan/rtabmap_graph.h"
#include "libmap/scan/rtabmap_reader.h"
#include "libmap/scan/sqlite_file.h"
#include "tests/libmap/scan/example_scan.h"
#include "tests/support/test_support.h"

namespace {

namespace fs = std::filesystem;
using graspmap_test::ExampleScan;
using libmap::DepthFormat;
using libmap::ImageFormat;
using libmap::LinkType;
using libmap::Pose;
using libmap::RtabmapWriter;
using libmap::RtabmapWriterOptions;

fs::path scratch(const std::string& name) { return graspmap_test::scratch_folder() / name; }

void write_scan(const fs::path& path, const ExampleScan& scan,
                const RtabmapWriterOptions& options = {}) {
  RtabmapWriter writer(path, options);
  for (const libmap::PoseLink& link : scan.graph.links) writer.add_link(link);
  for (const libmap::GraphNode& node : scan.graph.nodes)
    writer.add_node(node, scan.frames.at(node.id));
  writer.set_optimized_poses(scan.graph.optimized_map_from_base);
  writer.finish();
}

libmap::RgbdFrame empty_frame(int node) {
  libmap::RgbdFrame frame;
  frame.node = node;
  return frame;
}

SQLite::Database open_database(const fs::path& path) {
  return SQLite::Database(path.string(), SQLite::OPEN_READONLY);
}

using Rows = std::vector<std::vector<std::string>>;

std::string cell_of(const SQLite::Column& column) {
  if (column.isNull()) return "NULL";
  const auto* bytes = static_cast<const char*>(column.getBlob());
  const auto size = static_cast<std::size_t>(column.getBytes());
  return std::to_string(column.getType()) + ":" +
         (bytes == nullptr ? std::string() : std::string(bytes, size));
}

Rows query(SQLite::Database& database, const std::string& text) {
  SQLite::Statement statement(database, text);
  Rows rows;
  while (statement.executeStep()) {
    rows.emplace_back();
    for (int i = 0; i < statement.getColumnCount(); ++i)
      rows.back().push_back(cell_of(statement.getColumn(i)));
  }
  return rows;
}

Rows query(const fs::path& path, const std::string& text) {
  SQLite::Database database = open_database(path);
  return query(database, text);
}

// Every row of every table but Admin.
std::map<std::string, Rows> tables_of(const fs::path& path) {
  SQLite::Database database = open_database(path);
  std::map<std::string, Rows> tables;
  for (const auto& row : query(database, "SELECT name FROM sqlite_master WHERE type = 'table'"))
    tables[row[0].substr(2)] =
        query(database, "SELECT rowid, * FROM " + row[0].substr(2) + " ORDER BY rowid");
  tables.erase("Admin");
  return tables;
}

std::vector<std::string> names_beside(const fs::path& path) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(path.parent_path()))
    names.push_back(entry.path().filename().string());
  return names;
}

TEST(RtabmapWriter, KeepsNodesPosesLinksAndFrames) {
  const ExampleScan scan = graspmap_test::example_scan();
  for (const DepthFormat depth : {DepthFormat::rvl, DepthFormat::png16, DepthFormat::float_png}) {
    SCOPED_TRACE(to_text(depth));
    const fs::path path = scratch("scan.db");
    write_scan(path, scan, {.depth = depth, .color = ImageFormat::png});
    const libmap::RtabmapDatabase read(path);
    EXPECT_EQ(read.warnings(), std::vector<std::string>());
    graspmap_test::expect_same_graph(read.graph(), scan.graph, 2e-7);
    for (const auto& [id, frame] : scan.frames) {
      SCOPED_TRACE("node " + std::to_string(id));
      graspmap_test::expect_same_frame(read.read_frame(id), frame);
    }
    EXPECT_EQ(names_beside(path), std::vector<std::string>{"scan.db"});
  }
}

TEST(RtabmapWriter, StoresTheFloatsOfPosesAndTheDoublesOfInformation) {
  const ExampleScan scan = graspmap_test::example_scan();
  const fs::path path = scratch("scan.db");
  write_scan(path, scan);
  const Rows poses = query(path, "SELECT pose FROM Node ORDER BY id");
  for (std::size_t i = 0; i < poses.size(); ++i) {
    float stored[12];
    ASSERT_EQ(poses[i][0].size(), 2 + sizeof(stored));
    std::memcpy(stored, poses[i][0].data() + 2, sizeof(stored));
    const Pose& pose = *scan.graph.nodes[i].odometry_from_base;
    for (int k = 0; k < 12; ++k) EXPECT_EQ(stored[k], pose.matrix()(k / 4, k % 4));
  }
  const libmap::RtabmapDatabase read(path);
  for (std::size_t i = 0; i < scan.graph.links.size(); ++i)
    EXPECT_EQ(read.graph().links[i].information, scan.graph.links[i].information);
}

TEST(RtabmapWriter, KeepsFloatDepthBitForBit) {
  ExampleScan scan = graspmap_test::example_scan();
  for (float& pixel : scan.frames.at(5).depth.pixels)
    pixel = static_cast<float>(graspmap_test::uniform(0.1, 90.0));
  const fs::path path = scratch("scan.db");
  write_scan(path, scan, {.depth = DepthFormat::float_png});
  EXPECT_TRUE(libmap::RtabmapDatabase(path).read_frame(5).depth == scan.frames.at(5).depth);
}

TEST(RtabmapWriter, StoresJpegByDefault) {
  ExampleScan scan = graspmap_test::example_scan();
  libmap::ColorImage& image = scan.frames.at(1).color;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x)
      image.at(x, y) = {static_cast<std::uint8_t>(4 * x), static_cast<std::uint8_t>(5 * y), 90};
  const fs::path path = scratch("scan.db");
  write_scan(path, scan);
  const libmap::RtabmapDatabase read(path);
  EXPECT_EQ(libmap::image_format(read.read_blobs(1).image), ImageFormat::jpeg);
  const libmap::ColorImage color = read.read_frame(1).color;
  ASSERT_EQ(color.width, image.width);
  ASSERT_EQ(color.height, image.height);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    EXPECT_NEAR(color.pixels[i][0], image.pixels[i][0], 8);
    EXPECT_NEAR(color.pixels[i][2], image.pixels[i][2], 8);
  }
}

TEST(RtabmapWriter, KeepsCamerasSideBySideAndTheirDistortion) {
  ExampleScan scan = graspmap_test::example_scan();
  libmap::RgbdFrame& frame = scan.frames.at(2);
  frame.cameras = {graspmap_test::example_camera(20, 30), graspmap_test::example_camera(20, 30)};
  frame.cameras[0].distortion_model = libmap::DistortionModel::radial_tangential;
  frame.cameras[0].distortion = {0.1, -0.05, 0.001, -0.002, 0.01};
  frame.cameras[1].distortion_model = libmap::DistortionModel::equidistant;
  frame.cameras[1].distortion = {0.1, -0.05, 0.001, -0.002};
  const fs::path path = scratch("scan.db");
  write_scan(path, scan, {.color = ImageFormat::png});
  graspmap_test::expect_same_frame(libmap::RtabmapDatabase(path).read_frame(2), frame);
}

TEST(RtabmapWriter, KeepsStereoPairs) {
  ExampleScan scan = graspmap_test::example_scan();
  libmap::RgbdFrame& frame = scan.frames.at(5);
  frame.depth = {};
  frame.cameras.clear();
  frame.right = libmap::GrayImage(40, 30, 7);
  frame.right.at(3, 4) = 200;
  libmap::StereoCamera stereo;
  stereo.left = graspmap_test::example_camera(40, 30);
  stereo.right = stereo.left;
  stereo.baseline_m = 0.12;
  stereo.right_from_left.translation().x() = -0.12;
  frame.stereo = {stereo};
  const fs::path path = scratch("scan.db");
  write_scan(path, scan, {.color = ImageFormat::png});
  const libmap::RgbdFrame read = libmap::RtabmapDatabase(path).read_frame(5);
  EXPECT_TRUE(read.color == frame.color);
  EXPECT_TRUE(read.right == frame.right);
  EXPECT_TRUE(read.depth.empty());
  ASSERT_EQ(read.stereo.size(), 1U);
  EXPECT_NEAR(read.stereo[0].baseline_m, 0.12, 1e-9);
  EXPECT_NEAR(read.stereo[0].right_from_left.translation().x(), -0.12, 1e-9);
  graspmap_test::expect_same_camera(read.stereo[0].left, stereo.left);
  // What was read can be written again.
  scan.frames.at(5) = read;
  write_scan(scratch("again.db"), scan, {.color = ImageFormat::png});
  EXPECT_EQ(query(scratch("again.db"), "SELECT calibration FROM Data WHERE id = 5"),
            query(path, "SELECT calibration FROM Data WHERE id = 5"));
}

TEST(RtabmapWriter, StoresLinksInBothDirectionsWithOneInformation) {
  const ExampleScan scan = graspmap_test::example_scan();
  const fs::path path = scratch("scan.db");
  write_scan(path, scan);
  const Rows rows = query(path,
                          "SELECT a.information_matrix = b.information_matrix, a.transform, "
                          "b.transform FROM Link a JOIN Link b ON a.from_id = b.to_id AND "
                          "a.to_id = b.from_id AND a.type = b.type WHERE a.from_id < a.to_id");
  ASSERT_EQ(rows.size(), 4U);
  EXPECT_EQ(query(path, "SELECT COUNT(*) FROM Link")[0][0], "1:9");
  EXPECT_EQ(query(path, "SELECT COUNT(*) FROM Link WHERE from_id = to_id")[0][0], "1:1");
  for (const auto& row : rows) {
    EXPECT_EQ(row[0], "1:1");
    const auto pose_of = [](const std::string& cell) {
      Eigen::Matrix<float, 3, 4, Eigen::RowMajor> floats;
      std::memcpy(floats.data(), cell.data() + 2, 48);
      Pose pose = Pose::Identity();
      pose.affine() = floats.cast<double>();
      return pose;
    };
    EXPECT_TRUE((pose_of(row[1]).matrix() * pose_of(row[2]).matrix()).isIdentity(1e-6));
  }
}

TEST(RtabmapWriter, WritesLandmarksAndPriorsInOneDirection) {
  ExampleScan scan = graspmap_test::example_scan();
  scan.graph.links = {{.from = 2, .to = -7, .type = LinkType::landmark},
                      {.from = 5, .to = 5, .type = LinkType::pose_prior}};
  const fs::path path = scratch("scan.db");
  write_scan(path, scan);
  EXPECT_EQ(query(path, "SELECT from_id, to_id, type FROM Link ORDER BY from_id"),
            (Rows{{"1:2", "1:-7", "1:8"}, {"1:5", "1:5", "1:7"}}));
}

TEST(RtabmapWriter, WritesNullsWhereNothingIsKnown) {
  RtabmapWriter writer(scratch("scan.db"));
  writer.add_node({.id = 3, .stamp_s = 1.5}, empty_frame(3));
  writer.finish();
  EXPECT_EQ(query(scratch("scan.db"),
                  "SELECT hex(pose) = printf('%.96c', '0'), ground_truth_pose, velocity, label, "
                  "gps, env_sensors FROM Node"),
            (Rows{{"1:1", "NULL", "NULL", "NULL", "NULL", "NULL"}}));
  EXPECT_EQ(query(scratch("scan.db"), "SELECT image, depth, calibration, scan FROM Data"),
            (Rows{{"NULL", "NULL", "NULL", "NULL"}}));
  EXPECT_EQ(
      query(scratch("scan.db"), "SELECT opt_ids, opt_poses, opt_last_localization FROM Admin"),
      (Rows{{"NULL", "NULL", "NULL"}}));
  const libmap::RtabmapDatabase read(scratch("scan.db"));
  ASSERT_EQ(read.graph().nodes.size(), 1U);
  EXPECT_FALSE(read.graph().nodes[0].odometry_from_base);
  EXPECT_TRUE(read.read_frame(3).depth.empty());
}

TEST(RtabmapWriter, KeepsParametersAndTheLastLocalization) {
  const ExampleScan scan = graspmap_test::example_scan();
  const std::map<std::string, std::string> parameters = {
      {"Kp/MaxFeatures", "500"}, {"Mem/Folder", "a:b c"}, {"Vis/Empty", ""}};
  write_scan(scratch("scan.db"), scan, {.parameters = parameters});
  const libmap::RtabmapDatabase read(scratch("scan.db"));
  EXPECT_EQ(read.parameters(), parameters);
  EXPECT_EQ(read.version(), "0.23.0");
  EXPECT_EQ(read.recognised_version(), "0.23.0");
  ASSERT_TRUE(read.stored_map().last_localization_map_from_base);
  EXPECT_TRUE(read.stored_map().last_localization_map_from_base->isApprox(
      scan.graph.optimized_map_from_base.at(9), 1e-6));
}

// Equal input gives equal bytes, whatever the time and whatever stood in the file and in memory.
TEST(RtabmapWriter, WritesTheSameBytesEachTime) {
  const ExampleScan scan = graspmap_test::example_scan();
  write_scan(scratch("a.db"), scan);
  libmap::write_text(scratch("b.db"), std::string(200000, 'x'));
  { const std::vector<std::string> dirt(5000, std::string(777, '\xA5')); }
  write_scan(scratch("b.db"), scan);
  EXPECT_EQ(graspmap_test::read_text(scratch("a.db")), graspmap_test::read_text(scratch("b.db")));
  EXPECT_EQ(query(scratch("a.db"), "SELECT id, time_enter FROM Node WHERE id IN (1, 9)"),
            (Rows{{"1:1", "3:2020-09-13 12:26:40"}, {"1:9", "3:2020-09-13 12:26:40"}}));
  for (const char* table : {"Info", "Admin"})
    EXPECT_EQ(query(scratch("a.db"), std::string("SELECT time_enter FROM ") + table),
              (Rows{{"3:2020-09-13 12:26:40"}}));
}

TEST(RtabmapWriter, MakesASoundDatabase) {
  write_scan(scratch("scan.db"), graspmap_test::example_scan());
  EXPECT_EQ(query(scratch("scan.db"), "PRAGMA integrity_check"), (Rows{{"3:ok"}}));
  EXPECT_EQ(query(scratch("scan.db"), "PRAGMA foreign_key_check"), Rows());
  EXPECT_EQ(query(scratch("scan.db"), "PRAGMA journal_mode"), (Rows{{"3:delete"}}));
}

// Tables, columns with their types and defaults, indices; and triggers by what they are on.
Rows schema_of(const fs::path& path) {
  SQLite::Database database = open_database(path);
  Rows schema =
      query(database, "SELECT type, name, tbl_name FROM sqlite_master ORDER BY type, name");
  for (const auto& item : Rows(schema)) {
    const std::string name = item[1].substr(2);
    const auto append = [&](const std::string& pragma) {
      for (auto& row : query(database, "PRAGMA " + pragma + "(" + name + ")")) {
        row.insert(row.begin(), pragma + " " + name);
        schema.push_back(row);
      }
    };
    if (item[0] == "3:table") {
      append("table_info");
      append("foreign_key_list");
      SQLite::Statement statement(database, "PRAGMA index_list(" + name + ")");
      std::set<std::vector<std::string>> indices;
      while (statement.executeStep())
        indices.insert({name, statement.getColumn(1).getString(),
                        statement.getColumn(2).getString(), statement.getColumn(3).getString(),
                        statement.getColumn(4).getString()});
      schema.insert(schema.end(), indices.begin(), indices.end());
    } else if (item[0] == "3:index") {
      append("index_info");
    }
  }
  return schema;
}

// Words of the triggers' statements, without what stands between them.
Rows triggers_of(const fs::path& path) {
  Rows triggers = query(
      path, "SELECT name, lower(sql) FROM sqlite_master WHERE type = 'trigger' ORDER BY name");
  for (auto& row : triggers) {
    std::string words;
    for (const char c : row[1])
      if (c != ' ' && c != '\n' && c != '\t') words += c;
    row[1] = words;
  }
  return triggers;
}

TEST(RtabmapWriter, HasTheSchemaOfARealDatabase) {
  GRASPMAP_REQUIRE_DATA();
  const fs::path real = graspmap_test::data_folder() / "scans/site_full.db";
  write_scan(scratch("scan.db"), graspmap_test::example_scan());
  EXPECT_EQ(schema_of(scratch("scan.db")), schema_of(real));
  EXPECT_EQ(triggers_of(scratch("scan.db")), triggers_of(real));
  for (const char* pragma : {"page_size", "encoding", "auto_vacuum", "user_version"})
    EXPECT_EQ(query(scratch("scan.db"), std::string("PRAGMA ") + pragma),
              query(real, std::string("PRAGMA ") + pragma));
}

TEST(RtabmapWriter, LeavesNoWholeScanWithoutFinish) {
  const ExampleScan scan = graspmap_test::example_scan();
  {
    RtabmapWriter writer(scratch("scan.db"));
    writer.add_node(scan.graph.nodes[0], scan.frames.at(1));
  }
  EXPECT_THROW(libmap::RtabmapDatabase read(scratch("scan.db")), libmap::Error);
  EXPECT_EQ(names_beside(scratch("scan.db")), std::vector<std::string>{"scan.db"});
}

TEST(RtabmapWriter, ReportsWhereItCannotWrite) {
  const libmap::Error error =
      graspmap_test::error_of([] { RtabmapWriter writer(scratch("missing/scan.db")); });
  EXPECT_EQ(error.context().file, scratch("missing/scan.db").string());
  EXPECT_EQ(error.kind(), libmap::ErrorKind::failed);
}

class RtabmapWriterRefusal : public testing::Test {
 protected:
  ExampleScan scan_ = graspmap_test::example_scan();
  RtabmapWriter writer_{scratch("scan.db")};

  void SetUp() override { writer_.add_node(scan_.graph.nodes[0], scan_.frames.at(1)); }

  std::string reason_of(const std::function<void()>& action) {
    const libmap::Error error = graspmap_test::error_of(action);
    return error.what();
  }
  std::string refusal_of_node(const libmap::GraphNode& node, const libmap::RgbdFrame& frame) {
    return reason_of([&] { writer_.add_node(node, frame); });
  }
};

TEST_F(RtabmapWriterRefusal, OfNodesThatCannotBe) {
  libmap::GraphNode node = scan_.graph.nodes[1];
  libmap::RgbdFrame frame = scan_.frames.at(2);
  EXPECT_NE(refusal_of_node(scan_.graph.nodes[0], scan_.frames.at(1)).find("node 1"),
            std::string::npos);
  EXPECT_NE(refusal_of_node(node, scan_.frames.at(1)).find("another node's"), std::string::npos);
  node.label = "start";
  EXPECT_NE(refusal_of_node(node, frame).find("label"), std::string::npos);
  node.label = "";
  node.stamp_s = std::numeric_limits<double>::infinity();
  EXPECT_NE(refusal_of_node(node, frame).find("stamp"), std::string::npos);
  node.stamp_s = 0.0;
  node.truth_from_base->translation().x() = std::nan("");
  EXPECT_NE(refusal_of_node(node, frame).find("ground-truth pose"), std::string::npos);
  node.truth_from_base.reset();
  frame.right = libmap::GrayImage(40, 30);
  EXPECT_NE(refusal_of_node(node, frame).find("both"), std::string::npos);
  frame.right = {};
  frame.cameras[0].fx = -1.0;
  EXPECT_NE(refusal_of_node(node, frame).find("node 2: camera"), std::string::npos);
  EXPECT_NE(refusal_of_node({.id = 0}, empty_frame(0)).find("> 0"), std::string::npos);
  frame.cameras[0].fx = 30.0;
  writer_.add_node(node, frame);  // what was refused left nothing behind
  writer_.finish();
  EXPECT_EQ(libmap::RtabmapDatabase(scratch("scan.db")).graph().nodes.size(), 2U);
}

TEST_F(RtabmapWriterRefusal, OfLinksThatCannotBe) {
  libmap::PoseLink link = scan_.graph.links[0];
  writer_.add_link(link);
  std::swap(link.from, link.to);
  EXPECT_NE(reason_of([&] { writer_.add_link(link); }).find("already"), std::string::npos);
  link.type = LinkType::user_closure;
  link.information(2, 3) = std::nan("");
  EXPECT_NE(reason_of([&] { writer_.add_link(link); }).find("information"), std::string::npos);
  // Node 2 is not there.
  EXPECT_NE(reason_of([&] { writer_.finish(); }).find("link 1 -> 2"), std::string::npos);
}

TEST_F(RtabmapWriterRefusal, OfOptimizedPosesOfMissingNodes) {
  writer_.set_optimized_poses({{1, Pose::Identity()}, {4, Pose::Identity()}});
  const libmap::Error error = graspmap_test::error_of([&] { writer_.finish(); });
  EXPECT_EQ(error.context().value, "4");
}

TEST_F(RtabmapWriterRefusal, OfParametersThatTheFormatCannotHold) {
  for (const auto& [key, value] :
       std::map<std::string, std::string>{{"a:b", "c"}, {"a;b", "c"}, {"a", "b;c"}, {"", "c"}}) {
    SCOPED_TRACE(key + "=" + value);
    EXPECT_THROW(RtabmapWriter(scratch("other.db"), {.parameters = {{key, value}}}), libmap::Error);
  }
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
  write_scan(scratch("a.db"), scan);
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

// What RTAB-Map made with the earlier poses, it would show with the new ones.
TEST(CopyWithOptimizedPoses, DropsTheStoredMap) {
  const ExampleScan scan = graspmap_test::example_scan();
  write_scan(scratch("a.db"), scan);
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
  // Seen by no node that has a pose.
  scan.graph.optimized_map_from_base[-4] = landmark;
  scan.graph.links.push_back({.from = 5, .to = -4, .type = libmap::LinkType::landmark});
  write_scan(scratch("a.db"), scan);
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
  // The same ids and poses: the same matrices, whatever the compression made of them.
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

TEST(CopyWithOptimizedPoses, DropsALocalizationThatStandsNowhere) {
  write_scan(scratch("a.db"), graspmap_test::example_scan());
  {
    SQLite::Database database(scratch("a.db").string(), SQLite::OPEN_READWRITE);
    database.exec("UPDATE Admin SET opt_last_localization = zeroblob(48)");
  }
  libmap::copy_with_optimized_poses(scratch("a.db"), scratch("b.db"), {{9, Pose::Identity()}});
  EXPECT_EQ(query(scratch("b.db"), "SELECT opt_last_localization FROM Admin"), (Rows{{"NULL"}}));
}

TEST(CopyWithOptimizedPoses, CopiesADatabaseThatIsOpenElsewhere) {
  const ExampleScan scan = graspmap_test::example_scan();
  write_scan(scratch("a.db"), scan);
  for (const std::string mode : {"DELETE", "WAL"}) {
    SCOPED_TRACE(mode);
    SQLite::Database other(scratch("a.db").string(), SQLite::OPEN_READWRITE);
    other.exec("PRAGMA journal_mode = " + mode);
    libmap::SqliteFile(scratch("a.db")).copy_to(scratch("plain.db"));
    EXPECT_EQ(query(scratch("plain.db"), "PRAGMA journal_mode"), (Rows{{"3:delete"}}));
    // Begun and not committed: the copy must not see it.
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
  write_scan(scratch("a.db"), graspmap_test::example_scan());
  const libmap::Error missing = graspmap_test::error_of([] {
    libmap::copy_with_optimized_poses(scratch("a.db"), scratch("b.db"), {{4, Pose::Identity()}});
  });
  EXPECT_EQ(missing.context().file, scratch("a.db").string());
  EXPECT_EQ(missing.context().value, "4");
  {
    SQLite::Database other(scratch("other.db").string(),
                           SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    other.exec("CREATE TABLE Weather (day TEXT)");
    SQLite::Database old(scratch("old.db").string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    old.exec(
        "CREATE TABLE Node (id INTEGER); CREATE TABLE Admin (version TEXT);"
        "INSERT INTO Admin VALUES ('0.11.8')");
  }
  for (const auto& [name, reason] : std::map<std::string, std::string>{
           {"other.db", "no RTAB-Map database"}, {"old.db", "before 0.13"}}) {
    const libmap::Error error = graspmap_test::error_of(
        [&] { libmap::copy_with_optimized_poses(scratch(name), scratch("b.db"), {}); });
    EXPECT_NE(std::string(error.what()).find(reason), std::string::npos) << error.what();
  }
}

}  // namespace
