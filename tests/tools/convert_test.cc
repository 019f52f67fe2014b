#include <gtest/gtest.h>

#include "libmap/cloud/cloud_io.h"
#include "libmap/mesh/mesh_io.h"
#include "tests/tools/tool_test_support.h"

namespace {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using libmap::PointCloud;
using Words = std::vector<std::string>;

PointCloud sample_map() {
  PointCloud cloud = graspmap_test::bumpy_terrain(0.1);
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    cloud.normals.emplace_back(0.0F, 0.25F, static_cast<float>(graspmap_test::uniform(0.5, 1)));
    cloud.colors.push_back({static_cast<std::uint8_t>(n % 256), 7, 255});
  }
  libmap::ScalarField& score = cloud.add_field("score", libmap::ScalarType::float32);
  for (double& value : score.values)
    value = static_cast<double>(static_cast<float>(graspmap_test::uniform(-1, 1)));
  libmap::ScalarField& index = cloud.add_field("i", libmap::ScalarType::int32);
  for (std::size_t n = 0; n < cloud.size(); ++n) index.values[n] = static_cast<double>(n) - 100;
  return cloud;
}

TEST(Convert, FieldsGoThroughEveryFormatAndBack) {
  const PointCloud cloud = sample_map();
  libmap::write_cloud(scratch("a.pcd"), cloud);
  const Words chain = {"a.pcd", "b.ply", "c.vtp", "d.csv", "e.pcd"};
  for (std::size_t n = 0; n + 1 < chain.size(); ++n)
    ASSERT_TRUE(succeeded(graspmap({"convert", chain[n], chain[n + 1]})));
  const PointCloud last = libmap::read_cloud(scratch("e.pcd")).cloud;
  EXPECT_EQ(last.positions, cloud.positions);
  EXPECT_EQ(last.normals, cloud.normals);
  EXPECT_EQ(last.colors, cloud.colors);
  ASSERT_EQ(last.fields.size(), 2U);
  for (std::size_t field = 0; field < 2; ++field) {
    EXPECT_EQ(last.fields[field].name, cloud.fields[field].name);
    for (std::size_t n = 0; n < cloud.size(); ++n)
      ASSERT_EQ(static_cast<float>(last.fields[field].values[n]),
                static_cast<float>(cloud.fields[field].values[n]));
  }
}

TEST(Convert, ThereAndBackIsTheSameBytes) {
  libmap::write_cloud(scratch("a.pcd"), sample_map());
  for (const char* through : {"b.ply", "b.vtp"}) {
    ASSERT_TRUE(succeeded(graspmap({"convert", "a.pcd", through})));
    ASSERT_TRUE(succeeded(graspmap({"convert", through, "back.pcd"})));
    EXPECT_EQ(content("back.pcd"), content("a.pcd")) << through;
  }
}

TEST(Convert, Encodings) {
  libmap::write_cloud(scratch("a.pcd"), sample_map());
  for (const char* encoding : {"ascii", "binary", "binary_compressed"}) {
    ASSERT_TRUE(succeeded(graspmap({"convert", "a.pcd", "b.pcd", "--encoding", encoding})));
    EXPECT_NE(content("b.pcd").find(std::string("DATA ") + encoding + "\n"), std::string::npos);
    ASSERT_TRUE(succeeded(graspmap({"convert", "b.pcd", "back.pcd"})));
    EXPECT_EQ(content("back.pcd"), content("a.pcd")) << encoding;
  }
  ASSERT_TRUE(succeeded(graspmap({"convert", "a.pcd", "big.ply", "--big-endian"})));
  EXPECT_NE(content("big.ply").find("binary_big_endian"), std::string::npos);
}

TEST(Convert, MeshToMeshAndToCloud) {
  libmap::TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  libmap::write_mesh(scratch("m.ply"), mesh);
  ASSERT_TRUE(succeeded(graspmap({"convert", "m.ply", "m.stl"})));
  ASSERT_TRUE(succeeded(graspmap({"convert", "m.stl", "m2.obj"})));
  EXPECT_NEAR(libmap::signed_volume(libmap::read_mesh(scratch("m2.obj")).mesh), 1.0 / 6, 1e-6);
  ASSERT_TRUE(succeeded(graspmap({"convert", "m.ply", "m.pcd"})));
  EXPECT_EQ(libmap::read_cloud(scratch("m.pcd")).cloud.positions, mesh.vertices);
}

TEST(Convert, ManifestOfAMapIsPassedOn) {
  graspmap_test::write_terrain();
  ASSERT_TRUE(
      succeeded(graspmap({"score", "terrain.pcd", "--curvature-radius", "0", "-o", "map.pcd"})));
  ASSERT_TRUE(succeeded(graspmap({"convert", "map.pcd", "map.vtp"})));
  const nlohmann::json from = graspmap_test::json_of("map.pcd.json");
  const nlohmann::json to = graspmap_test::json_of("map.vtp.json");
  EXPECT_EQ(to.at("frame"), from.at("frame"));
  EXPECT_EQ(to.at("transforms"), from.at("transforms"));
  EXPECT_EQ(to.at("command"), "convert");
}

TEST(Convert, BadInputLeavesNothing) {
  libmap::write_cloud(scratch("a.pcd"), sample_map());
  graspmap_test::write_text(scratch("foreign.ply"), "precious");
  const Words before = graspmap_test::names_in_scratch();
  EXPECT_TRUE(bad_input(graspmap({"convert", "none.pcd", "b.ply"}), {"none.pcd: no such file"}));
  EXPECT_TRUE(bad_input(graspmap({"convert", "a.pcd", "b.xyz"}), {"b.xyz"}));
  EXPECT_TRUE(bad_input(graspmap({"convert", "a.pcd", "b"}), {"error: b: "}));
  EXPECT_TRUE(bad_input(graspmap({"convert", "a.pcd", "b.stl"}), {"b.stl", "no faces"}));
  EXPECT_TRUE(bad_input(graspmap({"convert", "a.xyz", "b.pcd"}), {"a.xyz"}));
  EXPECT_TRUE(bad_input(graspmap({"convert", "foreign.ply", "b.pcd"}), {"foreign.ply"}));
  EXPECT_TRUE(bad_input(graspmap({"convert", "a.pcd", "foreign.ply"}), {"foreign.ply", "--force"}));
  EXPECT_TRUE(bad_input(graspmap({"convert", "a.pcd", "b.pcd", "--encoding", "asci"}),
                        {"--encoding is asci", "did you mean 'ascii'"}));
  EXPECT_EQ(graspmap_test::names_in_scratch(), before);
  EXPECT_EQ(content("foreign.ply"), "precious");
}

}  // namespace
