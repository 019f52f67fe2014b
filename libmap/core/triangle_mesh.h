// A triangle mesh as plain data.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "libmap/core/image.h"
#include "libmap/core/point_cloud.h"

namespace libmap {

using Triangle = std::array<std::uint32_t, 3>;  // vertex indices, counter-clockwise from outside

// Positions in meters. `vertex_normals` and `vertex_colors` are empty or one a vertex, vertex
// fields hold one value per vertex, face fields one per triangle.
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

// The vertices and triangles of `more` behind the others. Normals, colors and fields are left that
// both have; all of one if the other has no vertices.
void append_mesh(const TriangleMesh& more, TriangleMesh& mesh);

// Twice-signed-area normal of a triangle, not normalized: its length is twice the area in m2.
Eigen::Vector3d area_normal(const TriangleMesh& mesh, const Triangle& triangle);

// Surface area in m2.
double surface_area(const TriangleMesh& mesh);

// Signed volume in m3 by the divergence theorem; the enclosed volume of a closed mesh.
double signed_volume(const TriangleMesh& mesh);

// Unit vertex normals: mean of the adjacent triangles' normals weighted by area.
std::vector<Eigen::Vector3f> estimate_vertex_normals(const TriangleMesh& mesh);

// Where a triangle's corners lie on its page: from 0 to 1 over the page's width and height, from
// the top left (as in glTF; OBJ counts from the bottom). The center of texel (column, row) lies at
// ((column + 0.5) / width, (row + 0.5) / height).
using TextureCorners = std::array<Eigen::Vector2f, 3>;

// A triangle without texture.
constexpr std::int32_t no_page = -1;

// `texture_coordinates` and `page_of_triangle` are one a triangle. Corners without texture have
// the page no_page.
struct TexturedMesh {
  TriangleMesh mesh;
  std::vector<TextureCorners> texture_coordinates;
  std::vector<std::int32_t> page_of_triangle;
  std::vector<ColorImage> pages;

  bool has_texture() const { return !pages.empty(); }

  // Throws Error naming the first array of a wrong length, page out of range or coordinate that is
  // not finite; and what TriangleMesh::check throws.
  void check() const;
};

}  // namespace libmap
