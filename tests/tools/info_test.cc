#include <gtest/gtest.h>

#include <cmath>

#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "tests/tools/tool_test_support.h"

namespace info_test {

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

// Two faults: a wing on an inner edge, and a triangle that runs through others.
libmap::TriangleMesh faulty_mesh() {
  libmap::TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {2, 0, 0},  {2, 2, 0},   {0, 2, 0},  {0, 0, 1},
                   {9, 9, 9}, {1, 1, -1}, {1, 1.2, 1}, {1.2, 1, 1}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}, {0, 2, 4}, {6, 7, 8}};
  mesh.face_fields = {{"filled", libmap::ScalarType::uint8, {0, 1, 0, 0}}};
  return mesh;
}

TEST(Info, MeshAsASurface) {
  libmap::write_mesh(scratch("m.ply"), faulty_mesh());
  const nlohmann::json surface = info("m.ply").at("surface");
  EXPECT_EQ(surface.at("watertight"), false);
  EXPECT_EQ(surface.at("manifold"), false);
  EXPECT_EQ(surface.at("components"), 2);
  EXPECT_TRUE(surface.at("genus").is_null());
  EXPECT_TRUE(surface.at("volume_m3").is_null());
  EXPECT_EQ(surface.at("filled_triangles"), 1);
  const nlohmann::json& faults = surface.at("faults");
  EXPECT_EQ(faults.at("non_manifold_edges"), 1);
  EXPECT_EQ(faults.at("unused_vertices"), 1);
  EXPECT_GE(faults.at("self_intersections"), 1);
}

TEST(Info, BoundariesLongestFirst) {
  libmap::TriangleMesh mesh;
  for (int n = 0; n < 14; ++n) {
    const double size = n + 1;
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (const Eigen::Vector3d& corner : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(3 * size, 0, 0),
                                          Eigen::Vector3d(0, 4 * size, 0)})
      mesh.vertices.push_back(corner + Eigen::Vector3d(0, 0, n));
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  libmap::write_mesh(scratch("m.ply"), mesh);
  const nlohmann::json boundaries = info("m.ply").at("surface").at("boundaries");
  EXPECT_EQ(boundaries.at("count"), 14);
  EXPECT_EQ(boundaries.at("length_m"), 12 * 105);
  ASSERT_EQ(boundaries.at("longest").size(), 10U);
  EXPECT_EQ(boundaries.at("longest").at(0).at("length_m"), 12 * 14);
  EXPECT_EQ(boundaries.at("longest").at(0).at("diameter_m"), 5 * 14);
  EXPECT_EQ(boundaries.at("longest").at(0).at("edges"), 3);
  const ProgramResult plain = graspmap({"info", "m.ply"});
  EXPECT_TRUE(succeeded(plain));
  EXPECT_NE(plain.standard_output.find("      length_m 168, diameter_m 70, edges 3\n"),
            std::string::npos);
}

TEST(Info, ClosedMesh) {
  libmap::TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {3, 0, 0}, {0, 3, 0}, {0, 0, 2}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  libmap::write_mesh(scratch("m.off"), mesh);
  const nlohmann::json surface = info("m.off").at("surface");
  EXPECT_EQ(surface.at("watertight"), true);
  EXPECT_EQ(surface.at("genus"), 0);
  EXPECT_EQ(surface.at("volume_m3"), 3);
  EXPECT_EQ(surface.at("boundaries").at("count"), 0);
  const ProgramResult plain = graspmap({"info", "m.off"});
  EXPECT_NE(plain.standard_output.find("  watertight: yes\n"), std::string::npos);
}

TEST(Info, QuickLeavesSelfIntersectionsOut) {
  libmap::write_mesh(scratch("m.ply"), faulty_mesh());
  const ProgramResult result = graspmap({"info", "m.ply", "--quick", "--json"});
  ASSERT_TRUE(succeeded(result));
  const auto surface = nlohmann::json::parse(result.standard_output).at("surface");
  EXPECT_TRUE(surface.at("faults").at("self_intersections").is_null());
  EXPECT_EQ(surface.at("faults").at("non_manifold_edges"), 1);
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
  graspmap_test::write_text(scratch("far.off"), "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1e32 0\n3 0 1 2\n");
  EXPECT_TRUE(bad_input(graspmap({"info", "far.off"}),
                        {.file = "far.off",
                         .field = "vertex 2",
                         .value = "100000000000000005366162204393472.000000"}));
  EXPECT_TRUE(bad_input(graspmap({"info", "none.pcd"}), {.file = "none.pcd"}));
  graspmap_test::write_text(scratch("a.txt"), "hello");
  EXPECT_TRUE(bad_input(graspmap({"info", "a.txt"}),
                        {.file = "a.txt", .field = "extension", .value = ".txt"}));
  graspmap_test::write_text(scratch("a.ply"), "hello");
  EXPECT_TRUE(bad_input(graspmap({"info", "a.ply", "--json"}), {.file = "a.ply"}));
  EXPECT_TRUE(bad_input(graspmap({"info", "."}), {.file = "."}));
}

}  // namespace info_test
