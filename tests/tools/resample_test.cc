#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "libmap/core/manifest.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "tests/tools/tool_test_support.h"

namespace resample_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::names_in_scratch;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::warned;
using graspmap_test::write_text;
using Words = std::vector<std::string>;

// A ridge of two slopes of 45 degrees over 2 x 1 m.
void write_ridge() {
  libmap::TriangleMesh mesh;
  mesh.vertices = {{-1, 0, 0}, {0, 0, 1}, {1, 0, 0}, {-1, 1, 0}, {0, 1, 1}, {1, 1, 0}};
  mesh.triangles = {{0, 1, 4}, {0, 4, 3}, {1, 2, 5}, {1, 5, 4}};
  mesh.vertex_colors.assign(6, {10, 20, 30});
  mesh.face_fields = {{"filled", libmap::ScalarType::uint8, {0, 0, 1, 1}}};
  libmap::write_mesh(scratch("ridge.ply"), mesh);
}

double smallest_pair(const std::vector<Eigen::Vector3d>& points) {
  double square = std::numeric_limits<double>::infinity();
  for (std::size_t a = 0; a < points.size(); ++a)
    for (std::size_t b = 0; b < a; ++b)
      square = std::min(square, (points[a] - points[b]).squaredNorm());
  return std::sqrt(square);
}

TEST(Resample, EveryFormatHoldsTheSameSamples) {
  write_ridge();
  for (const char* name : {"a.pcd", "a.ply", "a.csv"}) {
    ASSERT_TRUE(succeeded(graspmap({"resample", "ridge.ply", "-o", name, "--radius", "0.05"})));
    const libmap::PointCloud cloud = libmap::read_cloud(scratch(name)).cloud;
    EXPECT_GE(smallest_pair(cloud.positions), 0.05 - (name[2] == 'c' ? 1e-7 : 0.0)) << name;
    EXPECT_NEAR(static_cast<double>(cloud.size()), 0.7 * std::sqrt(8) / 0.0025, 80) << name;
    ASSERT_TRUE(cloud.has_normals());
    ASSERT_TRUE(cloud.has_colors());
    ASSERT_NE(cloud.find_field("filled"), nullptr);
    for (std::size_t n = 0; n < cloud.size(); ++n) {
      const Eigen::Vector3d& p = cloud.positions[n];
      EXPECT_NEAR(p.z(), 1 - std::abs(p.x()), 1e-6);
      EXPECT_NEAR(cloud.normals[n].norm(), 1, 1e-6);
      EXPECT_EQ(cloud.colors[n], (libmap::Color{10, 20, 30}));
      EXPECT_EQ(cloud.find_field("filled")->values[n], p.x() > 0 ? 1 : 0);
    }
    const nlohmann::json results = json_of(std::string(name) + ".json").at("results");
    EXPECT_EQ(results.at("points"), cloud.size());
    EXPECT_NEAR(results.at("area_m2"), std::sqrt(8), 1e-12);
    EXPECT_EQ(results.at("radius_m"), 0.05);
    EXPECT_GE(results.at("smallest_distance_m"), 0.05);
    EXPECT_GT(results.at("relative_radius"), 0.7);
  }
}

TEST(Resample, CountAndTheRadiusItFinds) {
  write_ridge();
  const auto result = graspmap({"resample", "ridge.ply", "-o", "a.pcd", "--count", "2000"});
  ASSERT_TRUE(succeeded(result));
  const nlohmann::json manifest = json_of("a.pcd.json");
  EXPECT_NEAR(static_cast<double>(manifest.at("results").at("points")), 2000, 20);
  // The shortest digits that read back the same number.
  const std::string radius = manifest.at("results").at("radius_m").dump();
  ASSERT_TRUE(succeeded(
      graspmap({"resample", "ridge.ply", "-o", "b.pcd", "--radius", radius, "--threads", "1"})));
  EXPECT_EQ(content("a.pcd"), content("b.pcd"));
  ASSERT_TRUE(succeeded(
      graspmap({"resample", "ridge.ply", "-o", "c.pcd", "--radius", radius, "--seed", "2"})));
  EXPECT_NE(content("a.pcd"), content("c.pcd"));
}

// One per cent off is within one per cent, in whatever way it is computed.
TEST(Resample, CountIsMissedOnlyWhereItIsMissed) {
  write_ridge();
  int exactly = 0;
  for (int count = 200; count <= 700; count += 100) {
    const auto result =
        graspmap({"resample", "ridge.ply", "-o", "a.pcd", "--count", std::to_string(count)});
    ASSERT_TRUE(succeeded(result));
    const int found = json_of("a.pcd.json").at("results").at("points");
    exactly += 100 * std::abs(found - count) == count ? 1 : 0;
    EXPECT_EQ(bool{warned(result, {std::to_string(count), std::to_string(found)})},
              100 * std::abs(found - count) > count)
        << found;
  }
  EXPECT_GT(exactly, 0) << "no case of just one per cent was met";
}

TEST(Resample, ParametersReadBack) {
  write_ridge();
  const auto printed = graspmap(
      {"resample", "ridge.ply", "-o", "a.pcd", "--count", "300", "--seed", "7", "--print-config"});
  ASSERT_TRUE(succeeded(printed));
  write_text(scratch("config.yaml"), printed.standard_output);
  ASSERT_TRUE(
      succeeded(graspmap({"resample", "ridge.ply", "-o", "a.pcd", "--config", "config.yaml"})));
  EXPECT_EQ(json_of("a.pcd.json").at("parameters").at("seed"), 7);
  EXPECT_NEAR(static_cast<double>(json_of("a.pcd.json").at("results").at("points")), 300, 3);
}

TEST(Resample, CarriesFrameAndSiteOn) {
  write_ridge();
  libmap::Manifest manifest;
  manifest.command = "crop";
  manifest.version = "0.1.0";
  manifest.frame = "site";
  manifest.transforms.emplace_back("site_from_map",
                                   libmap::make_pose_from_rpy({1, 2, 3}, {0, 0, 90}));
  write_text(scratch("ridge.ply.json"), libmap::to_json(manifest));
  ASSERT_TRUE(succeeded(graspmap({"resample", "ridge.ply", "-o", "a.pcd", "--radius", "0.1"})));
  const auto read = libmap::read_manifest_of(scratch("a.pcd"));
  ASSERT_TRUE(read);
  EXPECT_EQ(read->frame, "site");
  ASSERT_NE(read->find_transform("site_from_map"), nullptr);
  EXPECT_TRUE(
      read->find_transform("site_from_map")->isApprox(manifest.transforms.front().second, 1e-12));
}

TEST(Resample, BadInput) {
  write_ridge();
  const auto run = [](const Words& more) {
    Words words = {"resample", "ridge.ply", "-o", "a.pcd"};
    words.insert(words.end(), more.begin(), more.end());
    return graspmap(words);
  };
  EXPECT_TRUE(
      bad_input(run({"--radius", "0"}), {.field = "--radius", .value = "0", .bound = "> 0"}));
  EXPECT_TRUE(
      bad_input(run({"--radius", "-1"}), {.field = "--radius", .value = "-1", .bound = "> 0"}));
  EXPECT_TRUE(
      bad_input(run({"--radius", "nan"}), {.field = "--radius", .value = "nan", .bound = "> 0"}));
  EXPECT_TRUE(bad_input(
      run({"--radius", "1e-9"}),
      {.file = "ridge.ply", .field = "radius_m", .value = "1e-09", .bound = ">= 0.00088769355"}));
  EXPECT_TRUE(bad_input(run({"--count", "-5"}),
                        {.field = "--count", .value = "-5", .bound = ">= 0 and <= 1e+08"}));
  EXPECT_TRUE(bad_input(run({"--count", "2000000000"}),
                        {.field = "--count", .value = "2000000000", .bound = ">= 0 and <= 1e+08"}));
  EXPECT_TRUE(bad_input(run({"--count", "100", "--radius", "0.1"}),
                        {.field = "--count", .value = "100", .about = "--radius"}));
  EXPECT_TRUE(bad_input(graspmap({"resample", "none.ply", "-o", "a.pcd"}), {.file = "none.ply"}));
  EXPECT_TRUE(bad_input(graspmap({"resample", "ridge.ply", "-o", "a.obj"}),
                        {.file = "a.obj",
                         .field = "extension",
                         .value = ".obj",
                         .bound = ".pcd, .ply, .csv or .vtp"}));
  EXPECT_TRUE(
      bad_input(graspmap({"resample", "ridge.ply", "-o", "ridge.ply"}), {.file = "ridge.ply"}));
  libmap::TriangleMesh line;
  line.vertices = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  line.triangles = {{0, 1, 2}};
  libmap::write_mesh(scratch("line.ply"), line);
  EXPECT_TRUE(bad_input(graspmap({"resample", "line.ply", "-o", "a.pcd"}), {.file = "line.ply"}));
  EXPECT_EQ(names_in_scratch(), (Words{"line.ply", "ridge.ply"}));
}

}  // namespace resample_test
