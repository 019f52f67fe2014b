// Triangle mesh, with or without textures, as plain data.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "libmap/core/image.h"
#include "libmap/core/point_cloud.h"

namespace libmap {

using Triangle = std::array<std::uint32_t, 3>;  // vertex indices, counter-clockwise from outside

// Vertices are positions in meters. `vertex_normals` and `vertex_colors` are empty or have one
// entry per vertex. Vertex fields have one value per vertex, face fields one value per triangle.
struct TriangleMesh {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Triangle> triangles;
  std::vector<Eigen::Vector3f> vertex_normals;
  std::vector<Color> vertex_colors;
  std::vector<ScalarField> vertex_fields;
  std::vector<ScalarField> face_fields;

  // Throws Error naming the first array of a wrong length or index out of range.
  void check() const;
};

// Appends the vertices and triangles of `more`. Keeps normals, colors and fields that both meshes
// have; keeps everything if one mesh has no vertices. Throws Error for more than 2^32 - 1 vertices.
void append_mesh(const TriangleMesh& more, TriangleMesh& mesh);

// Returns the normal of a triangle; its length is twice the triangle's area, m2.
Eigen::Vector3d area_normal(const TriangleMesh& mesh, const Triangle& triangle);

// Returns the surface area in m2.
double surface_area(const TriangleMesh& mesh);

// Returns the volume in a closed mesh, m3; negative if the triangles are clockwise from outside.
double signed_volume(const TriangleMesh& mesh);

// Returns unit vertex normals: area-weighted means over adjacent triangles; zero without triangles.
std::vector<Eigen::Vector3f> estimate_vertex_normals(const TriangleMesh& mesh);

// Texture coordinates of a triangle's corners: 0 to 1 over the width and height of the texture
// page, from the top left (as in glTF; OBJ counts from the bottom). The center of texel (column,
// row) is ((column + 0.5) / width, (row + 0.5) / height).
using TextureCorners = std::array<Eigen::Vector2f, 3>;

// Page index of a triangle without texture.
constexpr std::int32_t no_page = -1;

// Mesh with texture pages (images). `texture_coordinates` and `page_of_triangle`, an index of
// `pages`, have one entry per triangle; triangles without texture have the page no_page.
struct TexturedMesh {
  TriangleMesh mesh;
  std::vector<TextureCorners> texture_coordinates;
  std::vector<std::int32_t> page_of_triangle;
  std::vector<ColorImage> pages;

  bool has_texture() const { return !pages.empty(); }

  // Throws Error naming the first array of a wrong length, page out of range or coordinate that is
  // not finite, and the errors of TriangleMesh::check.
  void check() const;
};

}  // namespace libmap
