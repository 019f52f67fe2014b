#include <gtest/gtest.h>

#include "libmap/cloud/cloud_io.h"
#include "libmap/core/pose.h"
#include "libmap/mesh/mesh_io.h"
#include "tests/tools/tool_test_support.h"

namespace {

using graspmap_test::bad_input;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::names_in_scratch;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using Words = std::vector<std::string>;

// A square of 1 m at z = 0, and a grid of points over its left half, 3 mm above, one 30 mm.
void write_square_and_points() {
  libmap::TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  libmap::write_mesh(scratch("square.ply"), mesh);
  libmap::PointCloud cloud;
  for (int x = 0; x <= 50; ++x)
    for (int y = 0; y <= 100; ++y) cloud.positions.emplace_back(0.01 * x, 0.01 * y, 0.003);
  cloud.positions[0].z() = 0.03;
  cloud.add_field("views", libmap::ScalarType::uint16);
  libmap::write_cloud(scratch("points.ply"), cloud);
}

nlohmann::json compared(const Words& more) {
  Words words = {"compare", "points.ply", "square.ply", "--json"};
  words.insert(words.end(), more.begin(), more.end());
  const auto result = graspmap(words);
  EXPECT_TRUE(succeeded(result));
  return nlohmann::json::parse(result.standard_output);
}

TEST(Compare, DistancesAndCompleteness) {
  write_square_and_points();
  const nlohmann::json json = compared({});
  EXPECT_EQ(json.at("points"), 51 * 101);
  EXPECT_NEAR(json.at("median_m"), 0.003, 1e-8);
  EXPECT_NEAR(json.at("p95_m"), 0.003, 1e-8);
  EXPECT_NEAR(json.at("max_m"), 0.03, 1e-8);
  EXPECT_NEAR(json.at("rmse_m"), std::sqrt((5150 * 9e-6 + 9e-4) / 5151), 1e-8);
  // The left half and as far beyond as 10 mm in space reach along the surface.
  EXPECT_NEAR(json.at("completeness"), 0.5 + std::sqrt(1e-4 - 9e-6), 0.003);
  EXPECT_NEAR(compared({"--within", "0.0025"}).at("completeness"), 0.0, 1e-9);
  EXPECT_TRUE(names_in_scratch() == (std::vector<std::string>{"points.ply", "square.ply"}));
}

TEST(Compare, TransformAndBox) {
  write_square_and_points();
  const nlohmann::json moved = compared({"--transform=1,0,-0.003,0,0,90"});
  EXPECT_NEAR(moved.at("median_m"), 0, 1e-8) << "turned about z it lies over the square again";
  EXPECT_NEAR(moved.at("completeness"), 0.51, 0.01);
  const nlohmann::json boxed = compared({"--box=0.1,0.1,-1,0.2,0.2,1"});
  EXPECT_NEAR(static_cast<double>(boxed.at("points")), 121, 22);  // points on the border
  EXPECT_EQ(boxed.at("completeness"), 1.0);
  EXPECT_NEAR(static_cast<double>(boxed.at("surface_samples")), 200, 60);
}

TEST(Compare, CloudWithDistances) {
  write_square_and_points();
  ASSERT_TRUE(succeeded(graspmap(
      {"compare", "points.ply", "square.ply", "--transform", "0,0,1,0,0,0", "-o", "out.ply"})));
  const libmap::PointCloud cloud = libmap::read_cloud(scratch("out.ply")).cloud;
  ASSERT_NE(cloud.find_field("distance"), nullptr);
  EXPECT_NE(cloud.find_field("views"), nullptr) << "its own fields stay";
  EXPECT_NEAR(cloud.find_field("distance")->values[1], 1.003, 1e-6);
  EXPECT_NEAR(cloud.positions[1].z(), 1.003, 1e-6);
  const nlohmann::json manifest = json_of("out.ply.json");
  EXPECT_EQ(manifest.at("parameters").at("transform"), "0,0,1,0,0,0");
  EXPECT_NEAR(manifest.at("results").at("median_m"), 1.003, 1e-6);
}

TEST(Compare, BadInput) {
  write_square_and_points();
  EXPECT_TRUE(
      bad_input(graspmap({"compare", "points.ply", "square.ply", "--transform", "1e300,0,0,0,0,0"}),
                {"points.ply", "too far from the mesh"}));
  const auto run = [](const Words& more) {
    Words words = {"compare", "points.ply", "square.ply"};
    words.insert(words.end(), more.begin(), more.end());
    return graspmap(words);
  };
  EXPECT_TRUE(bad_input(run({"--transform", "1,2,3"}), {"--transform", "1,2,3", "X,Y,Z"}));
  EXPECT_TRUE(bad_input(run({"--transform", "1,2,3,4,5,nan"}), {"--transform"}));
  EXPECT_TRUE(bad_input(run({"--transform", "1,2,3,4,5,6,7"}), {"--transform"}));
  EXPECT_TRUE(bad_input(run({"--box", "1,0,0,0,1,1"}), {"--box", "inside out"}));
  EXPECT_TRUE(bad_input(run({"--box", "5,5,5,6,6,6"}), {"points.ply", "no point lies in the box"}));
  EXPECT_TRUE(bad_input(run({"--within", "0"}), {"--within"}));
  EXPECT_TRUE(bad_input(run({"-o", "square.ply"}), {"square.ply"}));
  EXPECT_TRUE(bad_input(graspmap({"compare", "none.ply", "square.ply"}), {"none.ply"}));
  EXPECT_TRUE(bad_input(graspmap({"compare", "points.ply", "points.ply"}), {"points.ply"}));
}

}  // namespace
