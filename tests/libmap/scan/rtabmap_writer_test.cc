#include "libmap/scan/rtabmap_writer.h"

#include <gtest/gtest.h>

#include <cstring>
#include <set>
#include <string>
#include <vector>

#include "libmap/camera/matrix_codec.h"
#include "libmap/core/file_output.h"
#include "libmap/scan/rtabmap_blobs.h"
#include "libmap/scan/rtabmap_reader.h"
#include "tests/libmap/scan/database_rows.h"
#include "tests/libmap/scan/example_scan.h"
#include "tests/support/lower_limit.h"
#include "tests/support/test_support.h"

namespace rtabmap_writer_test {

namespace fs = std::filesystem;
using graspmap_test::ExampleScan;
using graspmap_test::open_database;
using graspmap_test::query;
using graspmap_test::Rows;
using graspmap_test::write_database;
using libmap::DepthFormat;
using libmap::ImageFormat;
using libmap::LinkType;
using libmap::Pose;
using libmap::RtabmapWriter;

fs::path scratch(const std::string& name) { return graspmap_test::scratch_folder() / name; }

libmap::RgbdFrame empty_frame(int node) {
  libmap::RgbdFrame frame;
  frame.node = node;
  return frame;
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
    write_database(path, scan, {.depth = depth, .color = ImageFormat::png});
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
  write_database(path, scan);
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
  write_database(path, scan, {.depth = DepthFormat::float_png});
  EXPECT_TRUE(libmap::RtabmapDatabase(path).read_frame(5).depth == scan.frames.at(5).depth);
}

TEST(RtabmapWriter, StoresJpegByDefault) {
  ExampleScan scan = graspmap_test::example_scan();
  libmap::ColorImage& image = scan.frames.at(1).color;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x)
      image.at(x, y) = {static_cast<std::uint8_t>(4 * x), static_cast<std::uint8_t>(5 * y), 90};
  const fs::path path = scratch("scan.db");
  write_database(path, scan);
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
  write_database(path, scan, {.color = ImageFormat::png});
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
  write_database(path, scan, {.color = ImageFormat::png});
  const libmap::RgbdFrame read = libmap::RtabmapDatabase(path).read_frame(5);
  EXPECT_TRUE(read.color == frame.color);
  EXPECT_TRUE(read.right == frame.right);
  EXPECT_TRUE(read.depth.empty());
  ASSERT_EQ(read.stereo.size(), 1U);
  EXPECT_NEAR(read.stereo[0].baseline_m, 0.12, 1e-9);
  EXPECT_NEAR(read.stereo[0].right_from_left.translation().x(), -0.12, 1e-9);
  graspmap_test::expect_same_camera(read.stereo[0].left, stereo.left);
  // A frame that was read can be written again.
  scan.frames.at(5) = read;
  write_database(scratch("again.db"), scan, {.color = ImageFormat::png});
  const libmap::RgbdFrame again = libmap::RtabmapDatabase(scratch("again.db")).read_frame(5);
  ASSERT_EQ(again.stereo.size(), 1U);
  graspmap_test::expect_same_camera(again.stereo[0].left, read.stereo[0].left);
  graspmap_test::expect_same_camera(again.stereo[0].right, read.stereo[0].right);
  // The baseline is stored as a product with the focal length.
  EXPECT_NEAR(again.stereo[0].baseline_m, read.stereo[0].baseline_m, 1e-15);
}

TEST(RtabmapWriter, StoresLinksInBothDirectionsWithOneInformation) {
  const ExampleScan scan = graspmap_test::example_scan();
  const fs::path path = scratch("scan.db");
  write_database(path, scan);
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
  write_database(path, scan);
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

// Equal input gives equal bytes, independent of time, earlier content of the file, and memory.
TEST(RtabmapWriter, WritesTheSameBytesEachTime) {
  const ExampleScan scan = graspmap_test::example_scan();
  write_database(scratch("a.db"), scan);
  libmap::write_text(scratch("b.db"), std::string(200000, 'x'));
  { const std::vector<std::string> dirt(5000, std::string(777, '\xA5')); }
  write_database(scratch("b.db"), scan);
  EXPECT_EQ(graspmap_test::read_text(scratch("a.db")), graspmap_test::read_text(scratch("b.db")));
  EXPECT_EQ(query(scratch("a.db"), "SELECT id, time_enter FROM Node WHERE id IN (1, 9)"),
            (Rows{{"1:1", "3:2020-09-13 12:26:40"}, {"1:9", "3:2020-09-13 12:26:40"}}));
  for (const char* table : {"Info", "Admin"})
    EXPECT_EQ(query(scratch("a.db"), std::string("SELECT time_enter FROM ") + table),
              (Rows{{"3:2020-09-13 12:26:40"}}));
}

TEST(RtabmapWriter, MakesASoundDatabase) {
  write_database(scratch("scan.db"), graspmap_test::example_scan());
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

// Words of the triggers' statements, without the separators.
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
  write_database(scratch("scan.db"), graspmap_test::example_scan());
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
  EXPECT_TRUE(graspmap_test::is_error(
      graspmap_test::error_of([&] { libmap::RtabmapDatabase read(scratch("scan.db")); }),
      {.file = scratch("scan.db")}));
  EXPECT_EQ(names_beside(scratch("scan.db")), std::vector<std::string>{"scan.db"});
}

TEST(RtabmapWriter, ReportsWhereItCannotWrite) {
  const libmap::Error error =
      graspmap_test::error_of([] { RtabmapWriter writer(scratch("missing/scan.db")); });
  EXPECT_EQ(error.context().file, scratch("missing/scan.db").string());
  EXPECT_EQ(error.kind(), libmap::ErrorKind::failed);
}

TEST(RtabmapWriter, ReportsAFullDisk) {
  const ExampleScan scan = graspmap_test::example_scan();
  const libmap::Error error = graspmap_test::error_of([&] {
    const graspmap_test::FileSizeLimit limit(8192);
    write_database(scratch("scan.db"), scan);
  });
  EXPECT_EQ(error.context().file, scratch("scan.db").string());
  EXPECT_TRUE(graspmap_test::is_error(
      error, {.file = scratch("scan.db"), .kind = libmap::ErrorKind::failed}))
      << error.what();
  EXPECT_EQ(error.kind(), libmap::ErrorKind::failed);
}

}  // namespace rtabmap_writer_test
