// Databases of all versions are recognized by their tables and read alike.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "libmap/scan/rtabmap_reader.h"
#include "libmap/scan/scan_verification.h"
#include "tests/libmap/scan/sample_checks.h"
#include "tests/libmap/scan/sample_database.h"
#include "tests/support/test_support.h"

namespace rtabmap_schema_test {

namespace fs = std::filesystem;
using libmap::LinkType;
using libmap::PoseLink;
using libmap::RgbdFrame;
using libmap::RtabmapDatabase;
using namespace graspmap_test;

class EverySchema : public testing::TestWithParam<SchemaVersion> {};

TEST_P(EverySchema, NodesAndPoses) {
  const SchemaVersion version = GetParam();
  const RtabmapDatabase scan(sample_file(version));
  EXPECT_EQ(scan.version(), version.text());
  EXPECT_TRUE(scan.warnings().empty()) << scan.warnings().front();
  const libmap::PoseGraph& graph = scan.graph();
  ASSERT_EQ(graph.nodes.size(), 3U);
  for (int id = 1; id <= 3; ++id) {
    const libmap::GraphNode& node = graph.nodes.at(static_cast<std::size_t>(id - 1));
    EXPECT_EQ(node.id, id);
    EXPECT_EQ(node.weight, id - 1);
    EXPECT_EQ(node.stamp_s, 100.25 + id);
    EXPECT_EQ(node.label, id == 1 ? "start" : "");
    expect_same_pose(node.odometry_from_base, sample_pose(id));
    EXPECT_EQ(node.truth_from_base.has_value(), version >= (SchemaVersion{11, 1}));
    if (node.truth_from_base) expect_same_pose(node.truth_from_base, sample_truth(id));
    EXPECT_EQ(node.velocity.has_value(), version >= (SchemaVersion{13, 0}));
    EXPECT_EQ(node.gps.has_value(), version >= (SchemaVersion{14, 0}));
    if (node.velocity) {
      EXPECT_EQ(node.velocity->at(5), 0.25);
    }
    if (node.gps) {
      EXPECT_EQ(node.gps->latitude_deg, 48.25);
    }
  }
  EXPECT_EQ(graph.optimized_map_from_base.size(), version >= (SchemaVersion{13, 0}) ? 3U : 0U);
  for (const auto& [id, pose] : graph.optimized_map_from_base)
    expect_same_pose(pose, sample_optimized(id));
}

TEST_P(EverySchema, LinksOnceEach) {
  const SchemaVersion version = GetParam();
  const RtabmapDatabase scan(sample_file(version));
  const libmap::PoseGraph& graph = scan.graph();
  EXPECT_EQ(graph.links.size(), version >= (SchemaVersion{18, 3}) ? 5U : 3U);
  const PoseLink* neighbor = find_link(graph, 1, 2, LinkType::neighbor);
  ASSERT_NE(neighbor, nullptr);
  expect_same_pose(neighbor->from_from_to, sample_pose(1).inverse() * sample_pose(2));
  EXPECT_NEAR(neighbor->information(0, 0), 100, 1e-9);
  EXPECT_NEAR(neighbor->information(5, 5), version >= (SchemaVersion{13, 0}) ? 100 : 25, 1e-9);
  EXPECT_EQ(neighbor->information(0, 5), 0);
  ASSERT_NE(find_link(graph, 1, 3, LinkType::global_closure), nullptr);
  if (version < SchemaVersion{18, 3}) return;
  EXPECT_NE(find_link(graph, 1, 1, LinkType::gravity), nullptr);
  EXPECT_NE(find_link(graph, 2, -1, LinkType::landmark), nullptr);
}

TEST_P(EverySchema, Frames) {
  const RtabmapDatabase scan(sample_file(GetParam()));
  for (int id = 1; id <= 3; ++id) {
    const RgbdFrame frame = scan.read_frame(id);
    EXPECT_EQ(frame.node, id);
    EXPECT_EQ(frame.stamp_s, 100.25 + id);
    EXPECT_EQ(frame.color, sample_color(id));
    EXPECT_EQ(frame.depth, libmap::to_meters(sample_depth(id)));
    ASSERT_EQ(frame.cameras.size(), 1U);
    const libmap::Camera& camera = frame.cameras[0];
    EXPECT_EQ(camera.width, 32);
    EXPECT_EQ(camera.height, 24);
    EXPECT_EQ(camera.fx, 30);
    EXPECT_EQ(camera.fy, 31);
    EXPECT_EQ(camera.cx, 15.5);
    EXPECT_EQ(camera.cy, 11.5);
    EXPECT_EQ(camera.base_from_camera.translation(), Eigen::Vector3d(0.5, 0.25, 0.125));
  }
}

TEST_P(EverySchema, EverythingElse) {
  const SchemaVersion version = GetParam();
  const RtabmapDatabase scan(sample_file(version));
  EXPECT_EQ(scan.word_count(), 2U);
  EXPECT_EQ(scan.feature_count(), 2U);
  const auto parameters = scan.parameters();
  if (version >= SchemaVersion{11, 8}) {
    EXPECT_EQ(parameters.size(), 3U);
    EXPECT_EQ(parameters.at("Kp/Max"), "500");
    EXPECT_EQ(parameters.at("Path/Url"), "http://x");
    EXPECT_EQ(parameters.at("Empty"), "");
  }
  EXPECT_TRUE(libmap::verify_scan(scan).faults.empty())
      << libmap::verify_scan(scan).faults.front().reason;
}

std::string name_of(const testing::TestParamInfo<SchemaVersion>& info) {
  return "v0_" + std::to_string(info.param.minor) + "_" + std::to_string(info.param.patch);
}
INSTANTIATE_TEST_SUITE_P(RtabmapReader, EverySchema, testing::ValuesIn(schema_versions()), name_of);

TEST(RtabmapSchema, SchemasAreToldApartByTheirColumns) {
  const auto recognized = [](SchemaVersion version) {
    const fs::path file = sample_file(version);
    execute(file, "UPDATE Admin SET version = '9.99.9'");
    const RtabmapDatabase scan(file);
    EXPECT_EQ(scan.version(), "9.99.9");
    return scan.recognized_version();
  };
  for (const SchemaVersion version : {SchemaVersion{10, 0},
                                      {10, 7},
                                      {11, 1},
                                      {11, 10},
                                      {13, 0},
                                      {14, 0},
                                      {16, 0},
                                      {17, 0},
                                      {18, 0},
                                      {20, 0},
                                      {22, 0},
                                      {23, 0}})
    EXPECT_EQ(recognized(version), version.text());
}

TEST(RtabmapSchema, WhatComesAfterTodayIsNamed) {
  const fs::path file = sample_file();
  execute(file, "ALTER TABLE Data ADD COLUMN hologram BLOB");
  execute(file, "CREATE TABLE Smell (id INTEGER)");
  execute(file, "CREATE TABLE \"odd \"\"name(\" (id INTEGER)");
  const RtabmapDatabase scan(file);
  ASSERT_EQ(scan.warnings().size(), 3U);
  EXPECT_TRUE(scan.warnings()[0].starts_with("Data.hologram "));
  EXPECT_TRUE(scan.warnings()[1].starts_with("Smell "));
  EXPECT_TRUE(scan.warnings()[2].starts_with("odd \"name( "));
  for (const std::string& warning : scan.warnings())
    EXPECT_TRUE(libmap::is_about_unknown_part(warning));
  EXPECT_EQ(scan.read_frame(1).color, sample_color(1));
}

TEST(RtabmapSchema, ImagesInTablesOfTheirOwn) {
  const fs::path file = scratch_folder() / "old.db";
  execute(file,
          "CREATE TABLE Node (id INTEGER PRIMARY KEY, map_id INTEGER, weight INTEGER, pose BLOB)");
  execute(file, "CREATE TABLE Image (id INTEGER PRIMARY KEY, data BLOB)");
  execute(file,
          "CREATE TABLE Depth (id INTEGER PRIMARY KEY, data BLOB, fx FLOAT, fy FLOAT, cx FLOAT, cy "
          "FLOAT, local_transform BLOB, data2d BLOB)");
  execute(file,
          "CREATE TABLE Link (from_id INTEGER, to_id INTEGER, type INTEGER, variance FLOAT, "
          "transform BLOB)");
  for (int id = 1; id <= 3; ++id) {
    const std::string key = std::to_string(id);
    execute(file, "INSERT INTO Node VALUES (" + key + ", 0, 0, ?)", {pose_bytes(sample_pose(id))});
    execute(file, "INSERT INTO Image VALUES (" + key + ", ?)", {encode_png(sample_color(id))});
  }
  execute(file, "INSERT INTO Depth VALUES (1, ?, 30, 31, 15.5, 11.5, ?, NULL)",
          {encode_png(sample_depth(1)), pose_bytes(libmap::optical_to_body_rotation())});
  execute(
      file, "INSERT INTO Depth VALUES (2, ?, 30, 0.125, 15.5, 11.5, ?, NULL)",
      {encode_png(libmap::GrayImage(32, 24, 9)), pose_bytes(libmap::optical_to_body_rotation())});
  execute(file, "INSERT INTO Link VALUES (1, 2, 0, 0.25, ?)", {pose_bytes(sample_pose(1))});
  const RtabmapDatabase scan(file);
  EXPECT_EQ(scan.recognized_version(), "before 0.10.0");
  EXPECT_EQ(scan.graph().links.at(0).information(3, 3), 4);
  EXPECT_EQ(scan.read_frame(1).depth, libmap::to_meters(sample_depth(1)));
  EXPECT_EQ(scan.read_frame(1).cameras.at(0).fy, 31);
  EXPECT_EQ(scan.read_frame(1).cameras.at(0).width, 32);
  // An fy below 1 is a baseline.
  EXPECT_EQ(scan.read_frame(2).stereo.at(0).baseline_m, 0.125);
  EXPECT_EQ(scan.read_frame(2).right.at(0, 0), 9);
  EXPECT_TRUE(scan.read_frame(3).cameras.empty());
  EXPECT_TRUE(libmap::verify_scan(scan).faults.empty());
}

}  // namespace rtabmap_schema_test
