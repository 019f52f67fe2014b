#include "tests/libmap/scan/example_scan.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gtest/gtest.h>

#include "libmap/camera/depth_codec.h"
#include "libmap/scan/rtabmap_blobs.h"
#include "tests/support/test_support.h"

namespace graspmap_test {

using libmap::LinkType;
using libmap::Pose;

namespace {

double draw() { return uniform(-1.0, 1.0); }

libmap::Matrix6d random_information() {
  libmap::Matrix6d root;
  for (int i = 0; i < 36; ++i) root(i / 6, i % 6) = draw();
  return root.transpose() * root;
}

void expect_same_pose(const Pose& actual, const Pose& expected, double tolerance) {
  EXPECT_LE((actual.matrix() - expected.matrix()).cwiseAbs().maxCoeff(), tolerance);
}

void expect_same_pose(const std::optional<Pose>& actual, const std::optional<Pose>& expected,
                      double tolerance) {
  ASSERT_EQ(actual.has_value(), expected.has_value());
  if (actual) expect_same_pose(*actual, *expected, tolerance);
}

void expect_same_node(const libmap::GraphNode& actual, const libmap::GraphNode& expected,
                      double tolerance) {
  EXPECT_EQ(actual.id, expected.id);
  EXPECT_EQ(actual.session, expected.session);
  EXPECT_EQ(actual.weight, expected.weight);
  EXPECT_EQ(actual.stamp_s, expected.stamp_s);
  EXPECT_EQ(actual.label, expected.label);
  expect_same_pose(actual.odometry_from_base, expected.odometry_from_base, tolerance);
  expect_same_pose(actual.truth_from_base, expected.truth_from_base, tolerance);
  EXPECT_EQ(actual.velocity, expected.velocity);
  ASSERT_EQ(actual.gps.has_value(), expected.gps.has_value());
  if (!actual.gps) return;
  EXPECT_EQ(actual.gps->stamp_s, expected.gps->stamp_s);
  EXPECT_EQ(actual.gps->longitude_deg, expected.gps->longitude_deg);
  EXPECT_EQ(actual.gps->latitude_deg, expected.gps->latitude_deg);
  EXPECT_EQ(actual.gps->altitude_m, expected.gps->altitude_m);
  EXPECT_EQ(actual.gps->error_m, expected.gps->error_m);
  EXPECT_EQ(actual.gps->bearing_deg, expected.gps->bearing_deg);
}

void expect_same_link(const libmap::PoseLink& actual, const libmap::PoseLink& expected,
                      double tolerance) {
  EXPECT_EQ(actual.from, expected.from);
  EXPECT_EQ(actual.to, expected.to);
  EXPECT_EQ(actual.type, expected.type);
  expect_same_pose(actual.from_from_to, expected.from_from_to, tolerance);
  const double scale = expected.information.cwiseAbs().maxCoeff();
  EXPECT_LE((actual.information - expected.information).cwiseAbs().maxCoeff(), tolerance * scale);
}

// As in RTAB-Map, with the last localization at the last pose.
void store_optimized_poses(const std::filesystem::path& path,
                           const std::map<int, Pose>& map_from_base) {
  if (map_from_base.empty()) return;
  const libmap::OptimizedPoseBlobs blobs = libmap::to_blobs(map_from_base);
  const std::string localization = libmap::to_blob(map_from_base.rbegin()->second);
  SQLite::Database database(path.string(), SQLite::OPEN_READWRITE);
  SQLite::Statement update(
      database, "UPDATE Admin SET opt_ids = ?, opt_poses = ?, opt_last_localization = ?");
  int index = 0;
  for (const std::string* blob : {&blobs.ids, &blobs.poses, &localization})
    update.bind(++index, blob->data(), static_cast<int>(blob->size()));
  update.exec();
}

}  // namespace

Pose random_float_pose() {
  const Pose pose = libmap::make_pose(Eigen::Vector3d(draw(), draw(), draw()),
                                      Eigen::Quaterniond(draw(), draw(), draw(), draw()));
  Pose rounded = pose;
  rounded.matrix() = pose.matrix().cast<float>().cast<double>();
  return rounded;
}

libmap::Camera example_camera(int width, int height) {
  libmap::Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = width * uniform(0.7, 0.9);
  camera.fy = camera.fx * uniform(0.99, 1.01);
  camera.cx = width * uniform(0.45, 0.55);
  camera.cy = height * uniform(0.45, 0.55);
  camera.base_from_camera = random_float_pose();
  return camera;
}

libmap::ColorImage random_color(int width, int height) {
  libmap::ColorImage image(width, height);
  for (libmap::Color& pixel : image.pixels)
    for (std::uint8_t& channel : pixel) channel = static_cast<std::uint8_t>(uniform(0.0, 256.0));
  return image;
}

libmap::DepthImage random_depth(int width, int height) {
  libmap::MillimeterImage image(width, height);
  for (std::uint16_t& pixel : image.pixels)
    if (draw() < 0.6) pixel = static_cast<std::uint16_t>(uniform(1.0, 5000.0));
  return libmap::to_meters(image);
}

ExampleScan example_scan() {
  ExampleScan scan;
  for (const int id : {1, 2, 5, 9}) {
    libmap::GraphNode node;
    node.id = id;
    node.session = id / 5;
    node.weight = id == 2 ? -1 : 3;
    node.stamp_s = 1600000000.0 + 0.1 * id;
    node.odometry_from_base = random_float_pose();
    if (id != 5) node.truth_from_base = random_float_pose();
    scan.graph.nodes.push_back(node);
    libmap::RgbdFrame frame;
    frame.node = id;
    frame.stamp_s = node.stamp_s;
    frame.cameras.push_back(example_camera(40, 30));
    frame.color = random_color(40, 30);
    frame.depth = random_depth(20, 15);
    scan.frames.emplace(id, std::move(frame));
  }
  scan.graph.nodes[0].label = "start";
  scan.graph.nodes[3].label = "Fels Nr. 2, \"oben\"";
  scan.graph.nodes[1].velocity = {0.5, -0.25, 0.125, 1.0, -2.0, 0.75};
  scan.graph.nodes[2].gps = libmap::GpsFix{1600000001.5, 138.25, 35.75, 12.5, 0.5, 270.25};
  const auto link = [&](int from, int to, LinkType type) {
    scan.graph.links.push_back({from, to, type, random_float_pose(), random_information()});
  };
  link(1, 2, LinkType::neighbor);
  link(1, 9, LinkType::global_closure);
  link(2, 5, LinkType::user_closure);
  link(5, 9, LinkType::neighbor);
  link(9, 9, LinkType::gravity);
  for (const int id : {1, 2, 9}) scan.graph.optimized_map_from_base[id] = random_float_pose();
  return scan;
}

void write_database(const std::filesystem::path& path, const ExampleScan& scan,
                    const libmap::RtabmapWriterOptions& options) {
  libmap::RtabmapWriter writer(path, options);
  for (const libmap::PoseLink& link : scan.graph.links) writer.add_link(link);
  for (const libmap::GraphNode& node : scan.graph.nodes)
    writer.add_node(node, scan.frames.at(node.id));
  writer.finish();
  store_optimized_poses(path, scan.graph.optimized_map_from_base);
}

void expect_same_camera(const libmap::Camera& actual, const libmap::Camera& expected,
                        double tolerance) {
  EXPECT_EQ(actual.width, expected.width);
  EXPECT_EQ(actual.height, expected.height);
  EXPECT_NEAR(actual.fx, expected.fx, tolerance);
  EXPECT_NEAR(actual.fy, expected.fy, tolerance);
  EXPECT_NEAR(actual.cx, expected.cx, tolerance);
  EXPECT_NEAR(actual.cy, expected.cy, tolerance);
  EXPECT_EQ(actual.distortion_model, expected.distortion_model);
  EXPECT_EQ(actual.distortion, expected.distortion);
  // Reading makes rotations proper, which removes float32's rounding.
  expect_same_pose(actual.base_from_camera, expected.base_from_camera, 1e-7);
}

void expect_same_frame(const libmap::RgbdFrame& actual, const libmap::RgbdFrame& expected,
                       double camera_tolerance) {
  EXPECT_EQ(actual.node, expected.node);
  EXPECT_EQ(actual.stamp_s, expected.stamp_s);
  EXPECT_TRUE(actual.color == expected.color);
  EXPECT_TRUE(actual.depth == expected.depth);
  EXPECT_TRUE(actual.right == expected.right);
  ASSERT_EQ(actual.cameras.size(), expected.cameras.size());
  for (std::size_t i = 0; i < actual.cameras.size(); ++i)
    expect_same_camera(actual.cameras[i], expected.cameras[i], camera_tolerance);
}

void expect_same_graph(const libmap::PoseGraph& actual, const libmap::PoseGraph& expected,
                       double pose_tolerance) {
  ASSERT_EQ(actual.nodes.size(), expected.nodes.size());
  for (std::size_t i = 0; i < actual.nodes.size(); ++i) {
    SCOPED_TRACE("node " + std::to_string(expected.nodes[i].id));
    expect_same_node(actual.nodes[i], expected.nodes[i], pose_tolerance);
  }
  ASSERT_EQ(actual.links.size(), expected.links.size());
  for (std::size_t i = 0; i < actual.links.size(); ++i) {
    SCOPED_TRACE("link " + std::to_string(i));
    expect_same_link(actual.links[i], expected.links[i], pose_tolerance);
  }
  ASSERT_EQ(actual.optimized_map_from_base.size(), expected.optimized_map_from_base.size());
  for (const auto& [id, pose] : expected.optimized_map_from_base) {
    ASSERT_EQ(actual.optimized_map_from_base.count(id), 1U);
    expect_same_pose(actual.optimized_map_from_base.at(id), pose, pose_tolerance);
  }
}

}  // namespace graspmap_test
