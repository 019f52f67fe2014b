#include "libmap/io/mesh_io.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <clocale>
#include <cmath>
#include <cstring>
#include <limits>
#include <locale>

#include "libmap/core/text.h"
#include "libmap/io/cloud_io.h"
#include "tests/libmap/io/cloud_samples.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace mesh_io_test {

namespace fs = std::filesystem;
using graspmap_test::as_float;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::read_text;
using graspmap_test::scratch_folder;
using graspmap_test::uniform;
using graspmap_test::write_text;
using ::testing::HasSubstr;

struct Format {
  const char* extension;
  FileEncoding encoding;
  bool big_endian;
  const char* name;
  bool keeps_normals;
  bool keeps_colors;
  bool keeps_fields;
  bool keeps_order;  // true if the order of the vertices is preserved
};

std::ostream& operator<<(std::ostream& out, const Format& format) { return out << format.name; }

const Format formats[] = {
    {".ply", FileEncoding::ascii, false, "ply_ascii", true, true, true, true},
    {".ply", FileEncoding::binary, false, "ply_little_endian", true, true, true, true},
    {".ply", FileEncoding::binary, true, "ply_big_endian", true, true, true, true},
    {".obj", FileEncoding::ascii, false, "obj", true, true, false, false},
    {".off", FileEncoding::ascii, false, "off", false, false, false, true},
    {".stl", FileEncoding::binary, false, "stl_binary", false, false, false, false},
    {".stl", FileEncoding::ascii, false, "stl_ascii", false, false, false, false},
    {".glb", FileEncoding::binary, false, "glb", true, true, false, false}};

// A bumpy sheet of 2 (n-1)^2 triangles whose heights are floats.
TriangleMesh sheet(std::uint32_t n) {
  TriangleMesh mesh;
  for (std::uint32_t y = 0; y < n; ++y)
    for (std::uint32_t x = 0; x < n; ++x) {
      mesh.vertices.emplace_back(0.25 * x, 0.5 * y, as_float(uniform(-1, 1)));
      mesh.vertex_colors.push_back({static_cast<std::uint8_t>(x * 7), static_cast<std::uint8_t>(y),
                                    static_cast<std::uint8_t>(200 + x % 50)});
    }
  for (std::uint32_t y = 0; y + 1 < n; ++y)
    for (std::uint32_t x = 0; x + 1 < n; ++x) {
      const std::uint32_t corner = y * n + x;
      mesh.triangles.push_back({corner, corner + 1, corner + n});
      mesh.triangles.push_back({corner + 1, corner + n + 1, corner + n});
    }
  mesh.vertex_normals = estimate_vertex_normals(mesh);
  mesh.vertex_fields = graspmap_test::sample_fields(mesh.vertices.size());
  mesh.face_fields = graspmap_test::sample_fields(mesh.triangles.size());
  return mesh;
}

fs::path write_sample(const Format& format, const TriangleMesh& mesh) {
  const fs::path path = scratch_folder() / (std::string("mesh") + format.extension);
  write_mesh(path, mesh, {format.encoding, format.big_endian});
  return path;
}

MeshReadResult read_as(const std::string& extension, const std::string& bytes) {
  const fs::path path = scratch_folder() / ("given" + extension);
  write_text(path, bytes);
  return read_mesh(path);
}

Error error_as(const std::string& extension, const std::string& bytes) {
  const Error error = error_of([&] { read_as(extension, bytes); });
  EXPECT_EQ(error.kind(), ErrorKind::bad_input);
  EXPECT_EQ(error.context().file, (scratch_folder() / ("given" + extension)).string());
  return error;
}

class MeshFormat : public ::testing::TestWithParam<Format> {};

INSTANTIATE_TEST_SUITE_P(All, MeshFormat, ::testing::ValuesIn(formats),
                         [](const auto& test) { return std::string(test.param.name); });

// Compares corners, so that the order of the vertices does not matter.
void expect_same_surface(const TriangleMesh& read, const TriangleMesh& written,
                         const Format& format) {
  ASSERT_EQ(read.vertices.size(), written.vertices.size());
  ASSERT_EQ(read.triangles.size(), written.triangles.size());
  ASSERT_EQ(read.vertex_normals.empty(), !format.keeps_normals);
  ASSERT_EQ(read.vertex_colors.empty(), !format.keeps_colors);
  for (std::size_t i = 0; i < read.triangles.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = read.triangles[i][k];
      const std::uint32_t b = written.triangles[i][k];
      ASSERT_LE((read.vertices[a] - written.vertices[b]).norm(), 2e-7 * written.vertices[b].norm());
      if (format.keeps_normals) {
        ASSERT_LE((read.vertex_normals[a] - written.vertex_normals[b]).norm(), 1e-6F);
      }
      if (format.keeps_colors) {
        ASSERT_EQ(read.vertex_colors[a], written.vertex_colors[b]);
      }
    }
}

TEST_P(MeshFormat, KeepsTheSurfaceAndItsSharedVertices) {
  const TriangleMesh mesh = sheet(12);
  const MeshReadResult read = read_mesh(write_sample(GetParam(), mesh));
  EXPECT_NO_THROW(read.mesh.check());
  expect_same_surface(read.mesh, mesh, GetParam());
  EXPECT_EQ(read.info.format, std::string(GetParam().extension).substr(1));
  EXPECT_EQ(read.info.faces, mesh.triangles.size());
  EXPECT_EQ(read.info.encoding, GetParam().encoding);
  if (GetParam().keeps_order) {
    EXPECT_EQ(read.mesh.vertices, mesh.vertices);
    EXPECT_EQ(read.mesh.triangles, mesh.triangles);
  }
}

TEST_P(MeshFormat, KeepsFieldsWhereItCan) {
  const TriangleMesh mesh = sheet(5);
  const TriangleMesh read = read_mesh(write_sample(GetParam(), mesh)).mesh;
  if (GetParam().keeps_fields) {
    EXPECT_EQ(read.vertex_fields, mesh.vertex_fields);
    EXPECT_EQ(read.face_fields, mesh.face_fields);
  } else {
    EXPECT_TRUE(read.vertex_fields.empty());
    EXPECT_TRUE(read.face_fields.empty());
  }
}

TEST_P(MeshFormat, KeepsMoreVerticesThanSixteenBitsCount) {
  TriangleMesh mesh = sheet(270);
  mesh.vertex_fields.clear();
  mesh.face_fields.clear();
  expect_same_surface(read_mesh(write_sample(GetParam(), mesh)).mesh, mesh, GetParam());
}

TEST_P(MeshFormat, BareGeometryStaysBare) {
  TriangleMesh mesh = sheet(3);
  mesh.vertex_normals.clear();
  mesh.vertex_colors.clear();
  mesh.vertex_fields.clear();
  mesh.face_fields.clear();
  const TriangleMesh read = read_mesh(write_sample(GetParam(), mesh)).mesh;
  EXPECT_TRUE(read.vertex_normals.empty());
  EXPECT_TRUE(read.vertex_colors.empty());
  EXPECT_EQ(read.vertices.size(), 9U);
  EXPECT_EQ(read.triangles.size(), 8U);
}

TEST_P(MeshFormat, FarVerticesAreDoublesOrTheNearestFloats) {
  TriangleMesh mesh;
  mesh.vertices = {{500000.123456, 4100000.5, 10},
                   {500001.25, 4100000.5, 10},
                   {500000.25, 4100001.75, 10.000001}};
  mesh.triangles = {{0, 1, 2}};
  const TriangleMesh read = read_mesh(write_sample(GetParam(), mesh)).mesh;
  ASSERT_EQ(read.vertices.size(), 3U);
  for (int i = 0; i < 3; ++i) {
    if (GetParam().keeps_order) {
      EXPECT_EQ(read.vertices[static_cast<std::size_t>(i)],
                mesh.vertices[static_cast<std::size_t>(i)]);
    } else {
      EXPECT_LE(
          (read.vertices[static_cast<std::size_t>(i)] - mesh.vertices[static_cast<std::size_t>(i)])
              .cwiseAbs()
              .maxCoeff(),
          0.51);
    }
  }
}

TEST_P(MeshFormat, SameBytesTwiceAndUnderAnyLocale) {
  class CommaPoint : public std::numpunct<char> {
    char do_decimal_point() const override { return ','; }
    char do_thousands_sep() const override { return '.'; }
    std::string do_grouping() const override { return "\3"; }
  };
  const TriangleMesh mesh = sheet(40);
  const std::string usual = read_text(write_sample(GetParam(), mesh));
  EXPECT_EQ(read_text(write_sample(GetParam(), mesh)), usual);
  const std::locale before = std::locale::global(std::locale(std::locale(), new CommaPoint));
  std::setlocale(LC_ALL, "de_DE.UTF-8");
  const fs::path path = write_sample(GetParam(), mesh);
  const TriangleMesh read = read_mesh(path).mesh;
  std::setlocale(LC_ALL, "C");
  std::locale::global(before);
  EXPECT_EQ(read_text(path), usual);
  expect_same_surface(read, mesh, GetParam());
}

TEST_P(MeshFormat, DamageIsAnErrorAndNeverACrash) {
  const std::string bytes = read_text(write_sample(GetParam(), sheet(3)));
  graspmap_test::expect_no_crash(
      bytes, [&](const std::string& damaged) { read_as(GetParam().extension, damaged); }, 60);
}

TEST_P(MeshFormat, FilesThatAreNone) {
  const std::string extension = GetParam().extension;
  EXPECT_TRUE(is_error(error_as(extension, ""), {.file = "given" + extension}));
  error_as(extension, std::string(1, '\0'));
  error_as(extension, std::string(1000, '\0'));
  error_as(extension, "\xff\xfe\x80 not a mesh \xc3\x28\n\xf0\x28\x8c\xbc\n");
  const fs::path folder = scratch_folder() / ("folder" + extension);
  fs::create_directories(folder);
  for (const fs::path& path : {folder, scratch_folder() / ("missing" + extension)})
    EXPECT_EQ(error_of([&] { read_mesh(path); }).context().file, path.string());
  const fs::path nowhere = scratch_folder() / "no_such_folder" / ("mesh" + extension);
  EXPECT_TRUE(is_error(error_of([&] { write_mesh(nowhere, sheet(2)); }),
                       {.file = nowhere, .kind = ErrorKind::failed}));
}

TEST_P(MeshFormat, IndicesOutOfRangeAreNotWritten) {
  TriangleMesh mesh = sheet(3);
  mesh.triangles[1][2] = 9;
  EXPECT_TRUE(is_error(error_of([&] { write_sample(GetParam(), mesh); }),
                       {.field = "vertex of triangle 1", .value = "9", .bound = "< 9"}));
}

TEST_P(MeshFormat, VerticesThatAreNotFiniteAreNotWritten) {
  TriangleMesh mesh = sheet(3);
  mesh.vertices[4].y() = std::numeric_limits<double>::quiet_NaN();
  const Error error = error_of([&] { write_sample(GetParam(), mesh); });
  EXPECT_TRUE(is_error(error, {.field = "vertex", .value = "4"}));
}

TEST(MeshFiles, PolygonsBecomeTrianglesWithTheirFields) {
  const MeshReadResult read = read_as(
      ".ply",
      "ply\nformat ascii 1.0\nelement vertex 5\nproperty double x\nproperty double y\n"
      "property double z\nelement face 2\nproperty short part\nproperty list uchar uint "
      "vertex_index\nproperty list uchar float texcoord\nelement edge 1\nproperty int a\n"
      "end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n.5 2 0\n-7 4 0 1 2 3 2 .5 .5\n8 3 3 2 4 0\n12\n");
  EXPECT_EQ(read.mesh.triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}, {3, 2, 4}}));
  ASSERT_EQ(read.mesh.face_fields.size(), 1U);
  EXPECT_EQ(read.mesh.face_fields[0], (ScalarField{"part", ScalarType::int16, {-7, -7, 8}}));
  EXPECT_EQ(read.info.faces, 2U);
  EXPECT_THAT(read.info.skipped, ::testing::ElementsAre("list texcoord", "element edge"));
}

TEST(MeshFiles, BrokenPlyFaces) {
  const auto mesh = [](const std::string& face) {
    return "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
           "property float z\nelement face 1\nproperty list char int vertex_indices\nend_header\n"
           "0 0 0\n1 0 0\n0 1 0\n" +
           face + "\n";
  };
  EXPECT_EQ(read_as(".ply", mesh("3 0 1 2")).mesh.triangles.size(), 1U);
  EXPECT_TRUE(is_error(error_as(".ply", mesh("3 0 1 3")),
                       {.field = "face 0", .value = "3", .bound = ">= 0 and < 3"}));
  EXPECT_TRUE(is_error(error_as(".ply", mesh("3 0 1 -1")),
                       {.field = "face 0", .value = "-1", .bound = ">= 0 and < 3"}));
  EXPECT_TRUE(is_error(error_as(".ply", mesh("2 0 1")),
                       {.field = "face 0", .value = "2", .bound = ">= 3"}));
  EXPECT_TRUE(
      is_error(error_as(".ply", mesh("-3 0 1 2")), {.field = "vertex_indices", .value = "-3"}));
  EXPECT_TRUE(
      is_error(error_as(".ply", mesh("4 0 1 2")), {.field = "vertex_indices", .value = "4"}));
  EXPECT_TRUE(
      is_error(error_as(".ply", mesh("0")), {.field = "face 0", .value = "0", .bound = ">= 3"}));
  std::string nan = mesh("3 0 1 2");
  nan.replace(nan.find("1 0 0\n"), 5, "1 nan");
  EXPECT_TRUE(is_error(error_as(".ply", nan.replace(nan.find("1 nan\n"), 6, "1 nan 0\n")),
                       {.field = "vertex 1"}));
}

TEST(MeshFiles, GlbHasYUp) {
  TriangleMesh mesh;
  mesh.vertices = {{1, 2, 3}, {2, 2, 3}, {1, 3, 5}};
  mesh.triangles = {{0, 1, 2}};
  const fs::path path = scratch_folder() / "up.glb";
  write_mesh(path, mesh);
  // The node's matrix, column by column: (x, y, z) is drawn at (x, z, -y).
  EXPECT_THAT(read_text(path), HasSubstr("\"matrix\":[1.0,0.0,0.0,0.0,0.0,0.0,-1.0,0.0,0.0,1.0,"));
  EXPECT_EQ(read_mesh(path).mesh.vertices, mesh.vertices);
}

// Mid gray, 188 of 255 in sRGB, is half the linear intensity. All bytes are preserved.
TEST(MeshFiles, GlbHasLinearColors) {
  TriangleMesh mesh;
  for (int n = 0; n < 256; ++n) {
    mesh.vertices.emplace_back(n, n % 7, 0);
    const auto byte = static_cast<std::uint8_t>(n);
    mesh.vertex_colors.push_back({byte, static_cast<std::uint8_t>(255 - n), 188});
  }
  for (std::uint32_t n = 0; n < 254; ++n) mesh.triangles.push_back({n, n + 1, n + 2});
  const fs::path path = scratch_folder() / "colors.glb";
  write_mesh(path, mesh);
  EXPECT_EQ(read_mesh(path).mesh.vertex_colors, mesh.vertex_colors);
  // The blue of a vertex as float32 in the file: 0.50289 (IEC 61966-2-1).
  const std::string bytes = read_text(path);
  int near_half = 0;
  for (std::size_t at = 0; at + 4 <= bytes.size(); at += 4) {
    float value = 0;
    std::memcpy(&value, bytes.data() + at, 4);
    near_half += std::abs(value - 0.50289F) < 1e-4F ? 1 : 0;
  }
  EXPECT_GE(near_half, 256);
}

// A primitive without attributes, for which assimp reads at address 0.
TEST(MeshFiles, WhatAssimpFallsOverIsAnError) {
  const fs::path path = scratch_folder() / "mesh.glb";
  fs::copy_file(
      graspmap_test::source_folder() / "tests/fuzz/findings/glb/primitive_without_attributes",
      path);
  EXPECT_TRUE(is_error(error_of([&] { read_mesh(path); }),
                       {.file = graspmap_test::scratch_folder() / "mesh.glb"}));
}

// Errors reported by assimp, and numbers that it accepts.
TEST(MeshFiles, WhatAssimpRefusesIsSaid) {
  const std::string two = "v 0 0 0\nv 0 1 0\n";
  EXPECT_TRUE(is_error(error_as(".stl", std::string(84, 'x')), {.file = "given.stl"}));
  EXPECT_TRUE(is_error(error_as(".obj", two + "v nan 0 0\nf 1 2 3\n"), {.field = "vertex 2"}));
  EXPECT_TRUE(is_error(error_as(".obj", two + "v 1e999 0 0\nf 1 2 3\n"),
                       {.field = "line 3", .value = "'1e999'"}));
  const fs::path path = scratch_folder() / "mesh.glb";
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0.625}};
  mesh.triangles = {{0, 1, 2}};
  write_mesh(path, mesh);
  std::string bytes = read_text(path);
  const float z = 0.625F;
  const std::size_t at = bytes.rfind(std::string(reinterpret_cast<const char*>(&z), sizeof z));
  ASSERT_NE(at, std::string::npos);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  bytes.replace(at, sizeof nan, reinterpret_cast<const char*>(&nan), sizeof nan);
  EXPECT_TRUE(is_error(error_as(".glb", bytes), {.field = "vertex 2"}));
}

TEST(MeshFiles, WhatSinglePrecisionCannotHoldIsNotWritten) {
  TriangleMesh mesh = sheet(3);
  mesh.vertices[4].y() = -1e39;
  for (const char* extension : {".obj", ".stl", ".glb"}) {
    const fs::path path = scratch_folder() / (std::string("far") + extension);
    const Error error = error_of([&] { write_mesh(path, mesh); });
    EXPECT_TRUE(is_error(error, {.file = path, .field = "vertex 4", .value = "1e+39 m"}));
    EXPECT_FALSE(fs::exists(path));
  }
  for (const char* extension : {".ply", ".off"}) {
    const fs::path path = scratch_folder() / (std::string("far") + extension);
    write_mesh(path, mesh);
    EXPECT_EQ(read_mesh(path).mesh.vertices, mesh.vertices);
  }
}

TEST(MeshFiles, NoTriangleIsNotWrittenByAssimp) {
  for (const std::string format : {"stl", "glb"})
    EXPECT_TRUE(is_error(error_of([&] { write_mesh(scratch_folder() / ("mesh." + format), {}); }),
                         {.field = "triangles"}));
}

TEST(MeshFiles, ObjKeepsMapCoordinates) {
  std::string text;
  TriangleMesh truth;
  for (int i = 0; i < 10; ++i)
    for (int j = 0; j < 10; ++j) {
      truth.vertices.emplace_back(451230 + 0.02 * i, 5412340 + 0.02 * j, 812 + 0.003 * i * j);
      text += "v " + libmap::to_text(truth.vertices.back().x()) + " " +
              libmap::to_text(truth.vertices.back().y()) + " " +
              libmap::to_text(truth.vertices.back().z()) + "\n";
    }
  for (int n = 0; n < 90; ++n)
    if (n % 10 != 9)
      text += "f " + std::to_string(n + 1) + " " + std::to_string(n + 11) + " " +
              std::to_string(n + 12) + "\\\n " + std::to_string(n + 2) + "\n";
  const MeshReadResult read = read_as(".obj", text);
  EXPECT_EQ(read.mesh.triangles.size(), 162U);
  ASSERT_EQ(read.mesh.vertices.size(), 100U);
  EXPECT_EQ(read.info.fields.front().type, ScalarType::float64);
  for (const Eigen::Vector3d& vertex : read.mesh.vertices)
    EXPECT_NE(std::find(truth.vertices.begin(), truth.vertices.end(), vertex),
              truth.vertices.end());
}

// A normal per face does not split shared vertices.
TEST(MeshFiles, ObjWithNormalsOfFacesStaysJoined) {
  const std::string roof = "v 0 0 0\nv 0 1 0\nv 1 0 1\nv 1 1 1\nv 2 0 0\nv 2 1 0\n";
  const std::string normals = "vn -1 0 1\nvn 1 0 1\n";
  const TriangleMesh joined =
      read_as(".obj", roof + normals + "f 1//1 3//1 4//1 2//1\nf 3//2 5//2 6//2 4//2\n").mesh;
  ASSERT_EQ(joined.vertices.size(), 6U);
  ASSERT_EQ(joined.vertex_normals.size(), 6U);
  EXPECT_EQ(joined.vertex_normals[0], Eigen::Vector3f(-1, 0, 1)) << "as it is in the file";
  EXPECT_EQ(joined.vertex_normals[1], Eigen::Vector3f(0, 0, 1)) << "of the ridge";
  // Triangles without shared vertices, as many programs write them.
  const TriangleMesh soup = read_as(".obj",
                                    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
                                    "f 1 2 3\nf 4 5 6\n")
                                .mesh;
  EXPECT_EQ(soup.vertices.size(), 4U);
}

TEST(MeshFiles, ObjErrorsNameTheLineAndTheList) {
  const std::string three = "v 0 0 0\nv 0 1 0\nv 1 0 0\nvt 0 0\nvn 0 0 1\n";
  const auto bound_of = [&](const std::string& face) {
    const Error error = error_of([&] { read_as(".obj", three + face); });
    EXPECT_EQ(error.context().field, "line 6") << face;
    return error.context().bound;
  };
  EXPECT_EQ(bound_of("f 1 2 9\n"), "1 to 3");
  EXPECT_EQ(bound_of("f 1/1 2/2 3/1\n"), "1 to 1") << "texture coordinate";
  EXPECT_EQ(bound_of("f 1//1 2//1 3//2\n"), "1 to 1");
  EXPECT_EQ(bound_of("f 0 1 2\n"), "1 to 3");
  EXPECT_EQ(bound_of("f -1 -2 -4\n"), "1 to 3");
  bound_of("f 1 2\n");
  bound_of("v 1 2\n");
  bound_of("v 1 2 three\n");
}

TEST(MeshFiles, ObjWithQuadsAndGroups) {
  const MeshReadResult read =
      read_as(".obj",
              "# made by hand\no one\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"
              "o two\nv 5 5 5\nv 6 5 5\nv 5 6 5\nf -3 -2 -1\n");
  EXPECT_EQ(read.mesh.triangles.size(), 3U);
  EXPECT_EQ(read.mesh.vertices.size(), 7U);
  EXPECT_NEAR(surface_area(read.mesh), 1.5, 1e-12);
}

// OBJ 3.0 has x y z w; colors after the position are a convention of MeshLab and others.
TEST(MeshFiles, ObjColumnsOfAVertex) {
  const auto read = [](const std::string& columns) {
    return read_as(".obj", "v 2 0 0" + columns + "\nv 0 2 0" + columns + "\nv 0 0 2" + columns +
                               "\nf 1 2 3\n")
        .mesh;
  };
  const std::vector<libmap::Color> orange(3, libmap::Color{255, 128, 0});
  for (const std::string columns : {"", " 1", " 1 0.5 0", " 1 1 0.5 0", " 1 1 1 1 1"})
    EXPECT_EQ(read(columns).vertices[0], Eigen::Vector3d(2, 0, 0)) << columns;
  EXPECT_EQ(read(" 2").vertices[0], Eigen::Vector3d(1, 0, 0));
  EXPECT_EQ(read(" 1 0.5 0").vertex_colors, orange);
  EXPECT_EQ(read(" 1 1 0.5 0").vertex_colors, orange);
  for (const std::string columns : {"", " 1", " 1 1", " 1 1 1 1 1", " 1 1 1 1 1 1 1 1"})
    EXPECT_TRUE(read(columns).vertex_colors.empty()) << columns;
}

TEST(MeshFiles, OffOfOtherPrograms) {
  const MeshReadResult read =
      read_as(".off",
              "COFF 5 2 0 # counts\n# vertices\n0 0 0 255 0 0 255\n1 0 0 0 0 0 0\n1 1 0 0 0 0 0\n\n"
              "0 1 0 1 1 1 1\n.5 2 1e-3 9 9 9 9\n4 0 1 2 3  10 20 30\n3 3 2 4\n");
  EXPECT_EQ(read.mesh.triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}, {3, 2, 4}}));
  EXPECT_EQ(read.mesh.vertices[4], Eigen::Vector3d(0.5, 2, 1e-3));
  for (const char* const text :
       {"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n",
        "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n2 0 1\n", "OFF\n3 1 0\n0 0 0\n1 0\n0 1 0\n3 0 1 2\n",
        "OFF\n3 1 0\n0 0 0\n1 0 0\n0 nan 0\n3 0 1 2\n",
        "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "OFF\n4000000000 1 0\n0 0 0\n",
        "OFF\n3 4000000000 0\n0 0 0\n", "OFF\n", "OFF BINARY\n"})
    error_as(".off", text);
}

TEST(MeshFiles, NoTriangleIsAnError) {
  EXPECT_TRUE(is_error(error_as(".obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\n"), {.field = "triangles"}));
  const fs::path path = scratch_folder() / "cloud.ply";
  write_cloud(path, graspmap_test::sample_cloud(4));
  EXPECT_TRUE(is_error(error_of([&] { read_mesh(path); }), {.field = "triangles"}));
}

TEST(MeshFiles, UnknownExtensionNamesTheKnownOnes) {
  const fs::path path = scratch_folder() / "mesh.objj";
  write_text(path, "x");
  EXPECT_TRUE(is_error(
      error_of([&] { read_mesh(path); }),
      {.field = "extension", .value = ".objj", .bound = ".ply, .obj, .stl, .off, .glb or .tif"}));
  EXPECT_TRUE(is_error(
      error_of([&] { write_mesh(path, sheet(2)); }),
      {.field = "extension", .value = ".objj", .bound = ".ply, .obj, .stl, .off, .glb or .vtp"}));
}

TEST(FileKinds, ByExtensionAndContent) {
  const auto cloud = [](const char* name) {
    const fs::path path = scratch_folder() / name;
    write_cloud(path, graspmap_test::sample_cloud(3));
    return path;
  };
  const auto mesh = [](const char* name) {
    const fs::path path = scratch_folder() / name;
    write_mesh(path, sheet(3));
    return path;
  };
  for (const char* const name : {"a.pcd", "a.ply", "a.csv"})
    EXPECT_EQ(file_kind(cloud(name)), FileKind::cloud) << name;
  for (const char* const name : {"a.ply", "a.obj", "a.stl", "a.off", "a.glb", "A.PLY"})
    EXPECT_EQ(file_kind(mesh(name)), FileKind::mesh) << name;
  EXPECT_TRUE(is_error(error_of([] { file_kind("scan.db"); }),
                       {.file = "scan.db", .field = "extension", .value = ".db"}));
  EXPECT_TRUE(is_error(error_of([&] { file_kind(scratch_folder() / "missing.ply"); }),
                       {.file = scratch_folder() / "missing.ply"}));
}

TEST(FileKinds, AMeshReadsAsTheCloudOfItsVertices) {
  const TriangleMesh written = sheet(4);
  const fs::path path = scratch_folder() / "mesh.ply";
  write_mesh(path, written);
  const CloudReadResult read = read_cloud(path);
  EXPECT_EQ(read.cloud.positions, written.vertices);
  EXPECT_EQ(read.cloud.fields, written.vertex_fields);
  EXPECT_THAT(read.info.skipped, ::testing::Contains("18 faces"));
}

TEST(RealMeshes, GroundTruthOfTheSite) {
  GRASPMAP_REQUIRE_DATA();
  const fs::path path = graspmap_test::data_folder() / "scans" / "site_ground_truth_mesh.ply";
  EXPECT_EQ(file_kind(path), FileKind::mesh);
  const MeshReadResult read = read_mesh(path);
  EXPECT_EQ(read.mesh.triangles.size(), 228342U);
  EXPECT_EQ(read.mesh.vertices.size(), 114693U);
  EXPECT_EQ(read.info.fields[0].type, ScalarType::float64);
  EXPECT_NO_THROW(read.mesh.check());
  // Round trips through all other formats.
  const double area = surface_area(read.mesh);
  for (const char* const name : {"m.obj", "m.off", "m.stl", "m.glb", "m.ply"}) {
    const fs::path copy = scratch_folder() / name;
    write_mesh(copy, read.mesh);
    const TriangleMesh again = read_mesh(copy).mesh;
    EXPECT_EQ(again.triangles.size(), 228342U) << name;
    EXPECT_NEAR(surface_area(again), area, 1e-5 * area) << name;
  }
}

}  // namespace mesh_io_test
}  // namespace libmap
