#include "libmap/texture/textured_mesh_io.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/io/mesh_io.h"
#include "tests/libmap/texture/painted_scan.h"
#include "tests/libmap/texture/textured_samples.h"
#include "tests/support/test_support.h"

namespace textured_mesh_io_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::scratch_folder;
using graspmap_test::uniform;
using libmap::TexturedMesh;
using Json = nlohmann::json;

// Two pages of random colors, a triangle of none, and normals where `normals` is set.
TexturedMesh random_model(bool normals) {
  TexturedMesh model;
  model.mesh = graspmap_test::grid_mesh(4, 2.0, 0.5);
  // float32 holds them exactly.
  for (Eigen::Vector3d& vertex : model.mesh.vertices) {
    vertex.z() = std::round(uniform(0, 64)) / 64.0;
    if (normals) model.mesh.vertex_normals.emplace_back(0.6F, 0.0F, 0.8F);
  }
  for (const auto& [width, height] : {std::pair{20, 12}, {8, 24}}) {
    libmap::ColorImage& page = model.pages.emplace_back(width, height);
    for (libmap::Color& color : page.pixels)
      for (std::uint8_t& channel : color) channel = static_cast<std::uint8_t>(uniform(0, 256));
  }
  for (std::size_t t = 0; t < model.mesh.triangles.size(); ++t) {
    model.page_of_triangle.push_back(t == 7 ? libmap::no_page : static_cast<int>(t % 2));
    libmap::TextureCorners& corners = model.texture_coordinates.emplace_back();
    for (Eigen::Vector2f& corner : corners)
      corner = {static_cast<float>(std::round(uniform(0, 256)) / 256),
                static_cast<float>(std::round(uniform(0, 256)) / 256)};
  }
  return model;
}

// Both models have the same triangles, with equal positions, page and colors.
void expect_same(const TexturedMesh& read, const TexturedMesh& written, double color_tolerance) {
  ASSERT_EQ(read.mesh.triangles.size(), written.mesh.triangles.size());
  ASSERT_EQ(read.mesh.vertices.size(), written.mesh.vertices.size());
  ASSERT_EQ(read.pages.size(), written.pages.size());
  for (std::size_t p = 0; p < read.pages.size(); ++p) {
    ASSERT_EQ(read.pages[p].width, written.pages[p].width);
    ASSERT_EQ(read.pages[p].height, written.pages[p].height);
    EXPECT_TRUE(color_tolerance > 0.0 || read.pages[p] == written.pages[p]);
  }
  int found = 0;
  for (std::uint32_t t = 0; t < written.mesh.triangles.size(); ++t)
    for (std::uint32_t r = 0; r < read.mesh.triangles.size(); ++r) {
      bool same = true;
      for (std::size_t k = 0; k < 3; ++k)
        same = same && (read.mesh.vertices[read.mesh.triangles[r][k]] -
                        written.mesh.vertices[written.mesh.triangles[t][k]])
                               .norm() < 1e-6;
      if (!same) continue;
      ++found;
      EXPECT_EQ(read.page_of_triangle[r], written.page_of_triangle[t]);
      if (written.page_of_triangle[t] == libmap::no_page) continue;
      for (std::size_t k = 0; k < 3; ++k)
        EXPECT_LT((read.texture_coordinates[r][k] - written.texture_coordinates[t][k]).norm(),
                  1e-6F);
      EXPECT_LT((graspmap_test::texture_color(read, r, 0.3, 0.2) -
                 graspmap_test::texture_color(written, t, 0.3, 0.2))
                    .norm(),
                static_cast<float>(color_tolerance) + 1e-3F);
    }
  EXPECT_EQ(found, static_cast<int>(written.mesh.triangles.size()));
}

TEST(TexturedMeshIo, ReadsBackWhatItWrote) {
  for (const bool normals : {false, true})
    for (const std::string name : {"model.obj", "model.glb", "a model.obj", "MODEL.GLB"}) {
      const TexturedMesh model = random_model(normals);
      const auto path = scratch_folder() / name;
      graspmap_test::write_textured_mesh(path, model);
      const TexturedMesh read = libmap::read_textured_mesh(path);
      expect_same(read, model, 0.0);
      ASSERT_EQ(read.mesh.vertex_normals.size(), normals ? read.mesh.vertices.size() : 0U);
      for (const Eigen::Vector3f& normal : read.mesh.vertex_normals)
        EXPECT_LT((normal - Eigen::Vector3f(0.6F, 0, 0.8F)).norm(), 1e-6F);
      // Without its texture it is a mesh like any other.
      const libmap::TriangleMesh plain = libmap::read_mesh(path).mesh;
      EXPECT_EQ(plain.vertices.size(), model.mesh.vertices.size());
      EXPECT_EQ(plain.triangles.size(), model.mesh.triangles.size());
    }
}

// Map coordinates, of which float32 keeps half a meter.
TEST(TexturedMeshIo, ObjKeepsMapCoordinates) {
  TexturedMesh model = random_model(true);
  for (Eigen::Vector3d& vertex : model.mesh.vertices)
    vertex += Eigen::Vector3d(500000.123456789, 4649776.22, 1830.4);
  const auto path = scratch_folder() / "utm.obj";
  graspmap_test::write_textured_mesh(path, model);
  expect_same(libmap::read_textured_mesh(path), model, 0.0);
}

// Materials as other programs write them: options, backslashes, names with spaces, none at all.
TEST(TexturedMeshIo, MaterialsOfOtherPrograms) {
  const auto folder = scratch_folder();
  std::filesystem::create_directory(folder / "maps");
  for (const char* name : {"a.png", "b c.png"})
    graspmap_test::write_text(folder / "maps" / name, libmap::encode_png(libmap::ColorImage(4, 4)));
  graspmap_test::write_text(folder / "my model.mtl",
                            "# by hand\nnewmtl first one\r\n  Kd 1 1 1\r\n"
                            "\tmap_Kd -s 1 1 1 maps\\a.png\r\nnewmtl plain\nKd 1 0 0\n"
                            "newmtl second\nmap_Kd maps/b c.png \n");
  graspmap_test::write_text(folder / "m.obj",
                            "mtllib my model.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n"
                            "vt 0 0\nvt 1 0.25\nvt 0 1\nf 1/1 2/2 3/3\nusemtl second\n"
                            "f 1/1 2/2 4/3 3/1\nusemtl first one\nf 1/1 2/-2 3/3\nf 1 2 3\n"
                            "usemtl plain\nf 1/1 2/2 3/3\nusemtl missing\nf 1/1 2/2 3/3\n");
  const TexturedMesh read = libmap::read_textured_mesh(folder / "m.obj");
  EXPECT_EQ(read.page_of_triangle,
            (std::vector<std::int32_t>{libmap::no_page, 1, 1, 0, libmap::no_page, libmap::no_page,
                                       libmap::no_page}));
  EXPECT_EQ(read.pages.size(), 2U);
  EXPECT_EQ(read.mesh.vertices.size(), 4U);
  EXPECT_EQ(read.texture_coordinates[2][1], Eigen::Vector2f(0, 0));
  EXPECT_EQ(read.texture_coordinates[3][1], Eigen::Vector2f(1, 0.75F));
  graspmap_test::write_text(folder / "bad.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1 2/1 3/1\n");
  EXPECT_TRUE(is_error(error_of([&] { libmap::read_textured_mesh(folder / "bad.obj"); }),
                       {.field = "line 4", .value = "'1'"}));
}

TEST(TexturedMeshIo, FilesOfAModel) {
  const TexturedMesh model = random_model(false);
  const auto folder = scratch_folder();
  libmap::TexturedMeshWriteOptions options;
  std::vector<std::string> names;
  for (const auto& file : libmap::textured_mesh_files(folder / "m.obj", model, options))
    names.push_back(file.path.filename());
  EXPECT_EQ(names, (std::vector<std::string>{"m_0.png", "m_1.png", "m.mtl", "m.obj"}));
  EXPECT_EQ(libmap::textured_mesh_files(folder / "m.glb", model, options).size(), 1U);
  options.image_format = libmap::ImageFormat::jpeg;
  options.jpeg_quality = 100;
  for (const std::string name : {"j.obj", "j.glb"}) {
    TexturedMesh smooth = model;
    for (libmap::ColorImage& page : smooth.pages)
      for (int y = 0; y < page.height; ++y)
        for (int x = 0; x < page.width; ++x)
          page.at(x, y) = {static_cast<std::uint8_t>(100 + x), static_cast<std::uint8_t>(90 + y),
                           80};
    graspmap_test::write_textured_mesh(folder / name, smooth, options);
    expect_same(libmap::read_textured_mesh(folder / name), smooth, 6.0);
  }
  EXPECT_TRUE(std::filesystem::exists(folder / "j_1.jpg"));
}

TEST(TexturedMeshIo, GlbIsWhatItsStandardSays) {
  const TexturedMesh model = random_model(false);
  const auto path = scratch_folder() / "m.glb";
  graspmap_test::write_textured_mesh(path, model);
  const std::string bytes = graspmap_test::read_text(path);
  const auto word = [&](std::size_t at) {
    std::uint32_t value = 0;
    for (std::size_t i = 4; i-- > 0;)
      value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
    return value;
  };
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(word(4), 2U);
  EXPECT_EQ(word(8), bytes.size());
  EXPECT_EQ(word(12) % 4, 0U);
  EXPECT_EQ(bytes.substr(16, 4), "JSON");
  const std::size_t binary = 20 + word(12);
  EXPECT_EQ(bytes.substr(binary + 4, 3), "BIN");
  EXPECT_EQ(binary + 8 + word(binary), bytes.size());
  const Json json = Json::parse(bytes.substr(20, word(12)));
  // Each primitive's positions, carried by the node's matrix, are x, z, -y of a vertex: y is up.
  const auto node = json["nodes"][json["scenes"][0]["nodes"][0].get<std::size_t>()];
  const auto matrix = node["matrix"].get<std::vector<double>>();
  const Eigen::Matrix4d scene_from_mesh = Eigen::Map<const Eigen::Matrix4d>(matrix.data());
  std::set<std::vector<double>> expected;
  for (const Eigen::Vector3d& v : model.mesh.vertices) expected.insert({v.x(), v.z(), -v.y()});
  std::set<std::vector<double>> found;
  std::size_t corners = 0;
  const auto view_start = [&](const Json& accessor) {
    const Json& view = json["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    return binary + 8 + view["byteOffset"].get<std::size_t>() +
           accessor.value("byteOffset", std::size_t{0});
  };
  for (const Json& mesh : json["meshes"])
    for (const Json& primitive : mesh["primitives"]) {
      const Json& positions =
          json["accessors"][primitive["attributes"]["POSITION"].get<std::size_t>()];
      for (std::size_t n = 0; n < positions["count"].get<std::size_t>(); ++n) {
        float place[3];
        std::memcpy(place, bytes.data() + view_start(positions) + n * sizeof(place), sizeof(place));
        const Eigen::Vector4d carried =
            scene_from_mesh * Eigen::Vector4d(place[0], place[1], place[2], 1.0);
        found.insert({carried.x(), carried.y(), carried.z()});
      }
      corners +=
          json["accessors"][primitive["indices"].get<std::size_t>()]["count"].get<std::size_t>();
      const Json& material = json["materials"][primitive["material"].get<std::size_t>()];
      EXPECT_TRUE(material["extensions"].contains("KHR_materials_unlit"));
    }
  EXPECT_EQ(found, expected);
  EXPECT_EQ(corners, 3 * model.mesh.triangles.size());
  ASSERT_EQ(json["images"].size(), 2U);
  for (const Json& image : json["images"]) {
    EXPECT_EQ(image["mimeType"], "image/png");
    const Json& view = json["bufferViews"][image["bufferView"].get<std::size_t>()];
    EXPECT_EQ(bytes.substr(binary + 8 + view["byteOffset"].get<std::size_t>(), 4), "\x89PNG");
  }
}

TEST(TexturedMeshIo, MeshesWithoutTexture) {
  const TexturedMesh model = random_model(false);
  for (const std::string name : {"plain.obj", "plain.glb"}) {
    libmap::write_mesh(scratch_folder() / name, model.mesh);
    const TexturedMesh read = libmap::read_textured_mesh(scratch_folder() / name);
    EXPECT_FALSE(read.has_texture());
    EXPECT_EQ(read.mesh.triangles.size(), model.mesh.triangles.size());
  }
}

TEST(TexturedMeshIo, FilesThatAreBroken) {
  const auto folder = scratch_folder();
  const TexturedMesh model = random_model(false);
  EXPECT_EQ(error_of([&] { graspmap_test::write_textured_mesh(folder / "m.ply", model); })
                .context()
                .bound,
            ".obj or .glb");
  EXPECT_TRUE(is_error(error_of([&] { libmap::read_textured_mesh(folder / "none.obj"); }),
                       {.file = folder / "none.obj"}));
  graspmap_test::write_text(folder / "endless.obj", "v 0 0 0\n");
  std::filesystem::resize_file(folder / "endless.obj", std::uintmax_t{1} << 43U);
  EXPECT_EQ(error_of([&] { libmap::read_textured_mesh(folder / "endless.obj"); }).context().field,
            "size");
  graspmap_test::write_textured_mesh(folder / "m.obj", model);
  std::filesystem::remove(folder / "m_1.png");
  EXPECT_TRUE(is_error(error_of([&] { libmap::read_textured_mesh(folder / "m.obj"); }),
                       {.file = graspmap_test::scratch_folder() / "m_1.png"}));
  graspmap_test::write_text(folder / "m_1.png", "this is no picture");
  EXPECT_TRUE(is_error(error_of([&] { libmap::read_textured_mesh(folder / "m.obj"); }),
                       {.file = folder / "m_1.png", .field = "image", .bound = "JPEG or PNG"}));
  // Without its materials it has no texture.
  std::filesystem::remove(folder / "m.mtl");
  EXPECT_FALSE(libmap::read_textured_mesh(folder / "m.obj").has_texture());
  graspmap_test::write_textured_mesh(folder / "m.glb", model);
  const std::string whole = graspmap_test::read_text(folder / "m.glb");
  for (const double fraction : {0.0, 0.01, 0.3, 0.8, 0.999}) {
    graspmap_test::write_text(
        folder / "cut.glb",
        whole.substr(0, static_cast<std::size_t>(fraction * static_cast<double>(whole.size()))));
    EXPECT_TRUE(is_error(error_of([&] { libmap::read_textured_mesh(folder / "cut.glb"); }),
                         {.file = folder / "cut.glb"}))
        << fraction;
  }
  for (const std::size_t at : {12U, 13U, 14U, 15U}) {  // the length of the text
    std::string forged = whole;
    forged[at] = '\xff';
    graspmap_test::write_text(folder / "forged.glb", forged);
    const libmap::Error error =
        error_of([&] { libmap::read_textured_mesh(folder / "forged.glb"); });
    EXPECT_TRUE(at == 12U || error.context().field == "length of the JSON text") << error.what();
  }
  TexturedMesh wrong = model;
  wrong.page_of_triangle[3] = 2;
  EXPECT_EQ(error_of([&] { graspmap_test::write_textured_mesh(folder / "w.glb", wrong); })
                .context()
                .field,
            "texture page of triangle 3");
  wrong = model;
  wrong.texture_coordinates.pop_back();
  EXPECT_TRUE(
      is_error(error_of([&] { graspmap_test::write_textured_mesh(folder / "w.glb", wrong); }),
               {.field = "texture_coordinates", .value = "31 values", .bound = "32"}));
  EXPECT_TRUE(is_error(
      error_of([&] { graspmap_test::write_textured_mesh(folder / "w.glb", TexturedMesh{}); }),
      {.field = "triangles of the mesh"}));
}

TEST(TexturedMesh, AImageOfManyNamesIsOnePage) {
  const auto folder = scratch_folder();
  graspmap_test::write_text(folder / "a.png", libmap::encode_png(libmap::ColorImage(4, 4)));
  std::string materials;
  std::string model = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n";
  for (int n = 0; n < 30; ++n) {
    const std::string name = "m" + std::to_string(n);
    materials += "newmtl " + name + "\nmap_Kd ";
    for (int k = 0; k < n; ++k) materials += "./";
    materials += "a.png\n";
    model += "usemtl " + name + "\nf 1/1 2/2 3/3\n";
  }
  graspmap_test::write_text(folder / "m.mtl", materials);
  graspmap_test::write_text(folder / "m.obj", model);
  const TexturedMesh read = libmap::read_textured_mesh(folder / "m.obj");
  EXPECT_EQ(read.pages.size(), 1U);
  EXPECT_EQ(read.page_of_triangle, std::vector<std::int32_t>(30, 0));
}

TEST(TexturedMesh, WhatSinglePrecisionCannotHoldIsNotWritten) {
  TexturedMesh model = random_model(false);
  model.mesh.vertices[2].x() = 1e39;
  for (const char* name : {"far.obj", "far.glb"}) {
    const auto path = scratch_folder() / name;
    EXPECT_EQ(error_of([&] { graspmap_test::write_textured_mesh(path, model); }).context().field,
              "vertex 2");
    EXPECT_FALSE(std::filesystem::exists(path));
  }
}

}  // namespace textured_mesh_io_test
