#include <gtest/gtest.h>

#include <cmath>

#include "libmap/cloud/cloud_io.h"
#include "libmap/mesh/mesh_io.h"
#include "tests/tools/tool_test_support.h"

namespace {

using graspmap_test::bad_input;
using graspmap_test::graspmap;
using graspmap_test::ProgramResult;
using graspmap_test::scratch;
using graspmap_test::succeeded;

nlohmann::json info(const std::string& file) {
  const ProgramResult result = graspmap({"info", file, "--json"});
  EXPECT_TRUE(succeeded(result));
  return nlohmann::json::parse(result.standard_output);
}

TEST(Info, Cloud) {
  libmap::PointCloud cloud;
  cloud.positions = {{1, 2, 3}, {-1, 5, 0.5}, {NAN, 0, 0}};
  cloud.add_field("heat", libmap::ScalarType::float32).values = {0.25, -4, 9};
  libmap::write_cloud(scratch("a.pcd"), cloud);
  const nlohmann::json json = info("a.pcd");
  EXPECT_EQ(json.at("kind"), "cloud");
  EXPECT_EQ(json.at("points"), 2);
  EXPECT_EQ(json.at("dropped_points"), 1);
  EXPECT_EQ(json.at("normals"), false);
  EXPECT_EQ(json.at("bounds_m").at("min"), (std::vector<double>{-1, 2, 0.5}));
  EXPECT_EQ(json.at("bounds_m").at("max"), (std::vector<double>{1, 5, 3}));
  EXPECT_EQ(json.at("fields").at(0).at("name"), "heat");
  EXPECT_EQ(json.at("fields").at(0).at("range"), (std::vector<double>{-4, 0.25}));
}

TEST(Info, EmptyCloud) {
  libmap::write_cloud(scratch("a.pcd"), {});
  const nlohmann::json json = info("a.pcd");
  EXPECT_EQ(json.at("points"), 0);
  EXPECT_TRUE(json.at("bounds_m").is_null());
  EXPECT_TRUE(succeeded(graspmap({"info", "a.pcd"})));
}

TEST(Info, Mesh) {
  libmap::TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {2, 0, 0}, {0, 3, 0}};
  mesh.triangles = {{0, 1, 2}};
  libmap::write_mesh(scratch("m.ply"), mesh);
  const nlohmann::json json = info("m.ply");
  EXPECT_EQ(json.at("kind"), "mesh");
  EXPECT_EQ(json.at("vertices"), 3);
  EXPECT_EQ(json.at("triangles"), 1);
  EXPECT_EQ(json.at("area_m2"), 3);
}

TEST(Info, MapSaysWhatMadeIt) {
  graspmap_test::write_terrain();
  ASSERT_TRUE(
      succeeded(graspmap({"score", "terrain.pcd", "--curvature-radius", "0", "-o", "map.pcd"})));
  const nlohmann::json json = info("map.pcd");
  EXPECT_EQ(json.at("kind"), "graspability map");
  EXPECT_EQ(json.at("frame"), "terrain");
  EXPECT_TRUE(json.at("made_by").get<std::string>().starts_with("graspmap score"));
  EXPECT_EQ(json.at("results").at("scored_voxels"), json.at("points"));
  const ProgramResult plain = graspmap({"info", "map.pcd"});
  EXPECT_TRUE(succeeded(plain));
  EXPECT_NE(plain.standard_output.find("kind: graspability map\n"), std::string::npos);
  EXPECT_EQ(plain.standard_error, "");
}

TEST(Info, BadInput) {
  EXPECT_TRUE(bad_input(graspmap({"info", "none.pcd"}), {"none.pcd: no such file"}));
  graspmap_test::write_text(scratch("a.txt"), "hello");
  EXPECT_TRUE(bad_input(graspmap({"info", "a.txt"}), {"a.txt"}));
  graspmap_test::write_text(scratch("a.ply"), "hello");
  EXPECT_TRUE(bad_input(graspmap({"info", "a.ply", "--json"}), {"a.ply"}));
  EXPECT_TRUE(bad_input(graspmap({"info", "."}), {}));
}

}  // namespace
