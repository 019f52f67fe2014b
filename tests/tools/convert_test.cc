#include <gtest/gtest.h>

#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/texture/textured_mesh_io.h"
#include "tests/libmap/texture/textured_samples.h"
#include "tests/tools/tool_test_support.h"

namespace convert_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::warned;
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
  const Words chain = {"a.pcd", "b.ply", "d.csv", "e.pcd"};
  for (std::size_t n = 0; n + 1 < chain.size(); ++n)
    ASSERT_TRUE(succeeded(graspmap({"convert", chain[n], "-o", chain[n + 1]})));
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
  ASSERT_TRUE(succeeded(graspmap({"convert", "a.pcd", "-o", "b.ply"})));
  ASSERT_TRUE(succeeded(graspmap({"convert", "b.ply", "-o", "back.pcd"})));
  EXPECT_EQ(content("back.pcd"), content("a.pcd"));
}

TEST(Convert, Encodings) {
  libmap::write_cloud(scratch("a.pcd"), sample_map());
  for (const char* encoding : {"ascii", "binary", "binary_compressed"}) {
    ASSERT_TRUE(succeeded(graspmap({"convert", "a.pcd", "-o", "b.pcd", "--encoding", encoding})));
    EXPECT_NE(content("b.pcd").find(std::string("DATA ") + encoding + "\n"), std::string::npos);
    ASSERT_TRUE(succeeded(graspmap({"convert", "b.pcd", "-o", "back.pcd"})));
    EXPECT_EQ(content("back.pcd"), content("a.pcd")) << encoding;
  }
  ASSERT_TRUE(succeeded(graspmap({"convert", "a.pcd", "-o", "big.ply", "--big-endian"})));
  EXPECT_NE(content("big.ply").find("binary_big_endian"), std::string::npos);
}

TEST(Convert, MeshToMeshAndToCloud) {
  libmap::TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  libmap::write_mesh(scratch("m.ply"), mesh);
  ASSERT_TRUE(succeeded(graspmap({"convert", "m.ply", "-o", "m.stl"})));
  ASSERT_TRUE(succeeded(graspmap({"convert", "m.stl", "-o", "m2.obj"})));
  EXPECT_NEAR(libmap::signed_volume(libmap::read_mesh(scratch("m2.obj")).mesh), 1.0 / 6, 1e-6);
  ASSERT_TRUE(succeeded(graspmap({"convert", "m.ply", "-o", "m.pcd"})));
  EXPECT_EQ(libmap::read_cloud(scratch("m.pcd")).cloud.positions, mesh.vertices);
}

TEST(Convert, ManifestOfAMapIsPassedOn) {
  graspmap_test::write_terrain();
  ASSERT_TRUE(
      succeeded(graspmap({"score", "terrain.pcd", "--curvature-radius", "0", "-o", "map.pcd"})));
  ASSERT_TRUE(succeeded(graspmap({"convert", "map.pcd", "-o", "map.ply"})));
  const nlohmann::json from = graspmap_test::json_of("map.pcd.json");
  const nlohmann::json to = graspmap_test::json_of("map.ply.json");
  EXPECT_EQ(to.at("frame"), from.at("frame"));
  EXPECT_EQ(to.at("transforms"), from.at("transforms"));
  EXPECT_EQ(to.at("command"), "convert");
  // Values that analyses of the map need.
  EXPECT_EQ(to.at("parameters").at("zero_plane_m"), from.at("parameters").at("zero_plane_m"));
  EXPECT_EQ(to.at("results").at("lattice_origin_m"), from.at("results").at("lattice_origin_m"));
  const auto evaluated = [](const char* map) {
    EXPECT_TRUE(
        succeeded(graspmap({"analyze", map, map, "-o", "sum", "--names", "map|map", "--force"})));
    return content("sum/maps.csv");
  };
  EXPECT_EQ(evaluated("map.ply"), evaluated("map.pcd"));
}

TEST(Convert, AMapTakesEveryEncoding) {
  graspmap_test::write_terrain();
  ASSERT_TRUE(
      succeeded(graspmap({"score", "terrain.pcd", "--curvature-radius", "0", "-o", "map.pcd"})));
  ASSERT_TRUE(succeeded(graspmap({"convert", "map.pcd", "-o", "text.pcd", "--encoding", "ascii"})));
  EXPECT_NE(content("text.pcd").find("DATA ascii\n"), std::string::npos);
  ASSERT_TRUE(succeeded(graspmap({"convert", "map.pcd", "-o", "same.pcd"})));
  EXPECT_EQ(content("same.pcd"), content("map.pcd"));
  EXPECT_TRUE(bad_input(graspmap({"convert", "map.pcd", "same.pcd", "-o", "two.pcd"}),
                        {.file = "same.pcd"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("two.pcd")));
}

TEST(Convert, WhatAFormatHasNoPlaceForIsSaid) {
  libmap::TriangleMesh mesh;
  mesh.vertices = {{4.5e6 + 0.1, 0, 0}, {4.5e6 + 1.1, 0, 0}, {4.5e6, 1, 0}};
  mesh.triangles = {{0, 1, 2}};
  mesh.vertex_colors = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}};
  mesh.vertex_fields.push_back({"seen", libmap::ScalarType::float32, {1, 2, 3}});
  libmap::write_mesh(scratch("m.ply"), mesh);
  const auto told = [](const char* output) {
    const auto result = graspmap({"convert", "m.ply", "-o", output});
    EXPECT_TRUE(succeeded(result));
    return result;
  };
  EXPECT_EQ(told("m.vtp").standard_error, "");
  EXPECT_TRUE(warned(told("m.stl"), {".stl", "colors, seen"}));
  EXPECT_TRUE(warned(told("m.stl"), {".stl", "100 mm"}));
  EXPECT_TRUE(warned(told("m.obj"), {".obj", "seen"}));
  EXPECT_FALSE(warned(told("m.obj"), {" mm"}));
}

TEST(Convert, TexturesGoFromModelToModel) {
  libmap::TexturedMesh model;
  model.mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  model.mesh.triangles = {{0, 1, 2}};
  model.texture_coordinates = {
      {Eigen::Vector2f(0, 0), Eigen::Vector2f(1, 0), Eigen::Vector2f(0, 1)}};
  model.page_of_triangle = {0};
  model.pages.emplace_back(4, 4, libmap::Color{200, 10, 30});
  graspmap_test::write_textured_mesh(scratch("a.obj"), model);
  ASSERT_TRUE(succeeded(graspmap({"convert", "a.obj", "-o", "b.glb"})));
  ASSERT_TRUE(succeeded(graspmap({"convert", "b.glb", "-o", "c.obj"})));
  const libmap::TexturedMesh read = libmap::read_textured_mesh(scratch("c.obj"));
  ASSERT_EQ(read.pages.size(), 1U);
  EXPECT_EQ(read.pages[0].pixels, model.pages[0].pixels);
  EXPECT_EQ(read.mesh.vertices, model.mesh.vertices);
  // Only the mesh is converted if the format has no textures or the image is missing.
  const auto plain = graspmap({"convert", "a.obj", "-o", "d.ply"});
  ASSERT_TRUE(succeeded(plain));
  EXPECT_TRUE(warned(plain, {"texture", ".obj", ".glb"}));
  std::filesystem::remove(scratch("a_0.png"));
  const auto broken = graspmap({"convert", "a.obj", "-o", "e.glb"});
  ASSERT_TRUE(succeeded(broken));
  EXPECT_TRUE(warned(broken, {"texture", "a_0.png"}));
}

// All commands report unreadable clouds and meshes by the same messages.
TEST(Convert, VtpIsWrittenOnly) {
  graspmap_test::write_terrain();
  std::filesystem::create_directory(scratch("in"));
  for (const char* name : {"a.vtp", "in/a.vtp"})
    ASSERT_TRUE(succeeded(graspmap({"convert", "terrain.pcd", "-o", name})));
  graspmap_test::write_text(scratch("points.csv"), "x,y,z\n0,0,0\n");
  for (const Words& words : {Words{"info", "a.vtp"},
                             {"convert", "a.vtp", "-o", "b.ply"},
                             {"score", "a.vtp", "-o", "b.pcd"},
                             {"score", "in", "-o", "b.pcd"},
                             {"lookup", "a.vtp", "points.csv", "-o", "b.csv"},
                             {"render", "a.vtp", "-o", "b.png"},
                             {"mesh", "a.vtp", "-o", "b.ply"},
                             {"resample", "a.vtp", "--count", "9", "-o", "b.ply"},
                             {"footholds", "a.vtp", "-o", "b.csv"},
                             {"crop", "a.vtp", "--size", "1x1", "-o", "b.ply"},
                             {"compare", "a.vtp", "terrain.pcd"},
                             {"convert", "a.vtp", "-o", "b.mcap"}})
    EXPECT_TRUE(bad_input(graspmap(words), {.about = ".vtp"})) << words.front();
}

TEST(Convert, BadInputLeavesNothing) {
  libmap::write_cloud(scratch("a.pcd"), graspmap_test::bumpy_terrain(0.1));
  graspmap_test::write_text(scratch("foreign.ply"), "precious");
  const Words before = graspmap_test::names_in_scratch();
  EXPECT_TRUE(bad_input(graspmap({"convert", "none.pcd", "-o", "b.ply"}), {.file = "none.pcd"}));
  EXPECT_TRUE(bad_input(graspmap({"convert", "a.pcd", "-o", "b.xyz"}),
                        {.file = "b.xyz",
                         .field = "extension",
                         .value = ".xyz",
                         .bound = ".pcd, .ply, .csv or .vtp"}));
  EXPECT_TRUE(
      bad_input(graspmap({"convert", "a.pcd", "-o", "b"}), {.file = "a.pcd", .field = "score"}));
  EXPECT_TRUE(bad_input(graspmap({"convert", "a.pcd", "-o", "b.stl"}), {.file = "b.stl"}));
  EXPECT_TRUE(bad_input(graspmap({"convert", "a.xyz", "-o", "b.pcd"}),
                        {.file = "a.xyz", .field = "extension", .value = ".xyz"}));
  EXPECT_TRUE(
      bad_input(graspmap({"convert", "foreign.ply", "-o", "b.pcd"}), {.file = "foreign.ply"}));
  EXPECT_TRUE(bad_input(graspmap({"convert", "a.pcd", "-o", "foreign.ply"}),
                        {.file = "foreign.ply", .about = "--force"}));
  EXPECT_TRUE(bad_input(graspmap({"convert", "a.pcd", "-o", "b.pcd", "--encoding", "asci"}),
                        {.field = "--encoding",
                         .value = "asci",
                         .bound = "one of ascii binary binary_compressed",
                         .about = "'ascii'"}));
  EXPECT_TRUE(
      bad_input(graspmap({"convert", "a.pcd", "-o", "b.ply", "--encoding", "binary_compressed"}),
                {.file = "b.ply", .field = "--encoding", .value = "binary_compressed"}));
  EXPECT_TRUE(bad_input(graspmap({"convert", "a.pcd", "-o", "b.pcd", "--big-endian"}),
                        {.file = "b.pcd", .field = "--big-endian"}));
  EXPECT_EQ(graspmap_test::names_in_scratch(), before);
  EXPECT_EQ(content("foreign.ply"), "precious");
}

}  // namespace convert_test
