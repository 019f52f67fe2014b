// Makes the visual meshes of a world: one mesh per texture page of the surface, and one mesh per
// color of a map's scores.
#pragma once

#include <cstddef>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/core/triangle_mesh.h"

namespace libmap {

// Unit to which coordinates in OBJ files are rounded; float32 resolves 2e-6 m at 16 m.
constexpr double mesh_unit_m = 1e-6;
// Rounds vertices to mesh_unit_m, and normals to three decimals, so that files are shorter.
void round_vertices(TriangleMesh& mesh);

// Returns the mesh with its vertex colors as a texture. Each triangle has 2 x 2 texels; bilinear
// interpolation of the texels is linear interpolation of the vertex colors. Without vertex colors,
// the result has no page.
TexturedMesh bake_vertex_colors(TriangleMesh mesh);

// Returns the triangles of one page (no_page: the triangles without texture), with this page alone
// and rounded vertices. Vertices are duplicated so that no two triangles run along an edge in the
// same direction, which MuJoCo requires.
TexturedMesh page_of(const TexturedMesh& model, std::int32_t page);

struct ColoredMesh {
  Color color{};
  TriangleMesh mesh;
};

// Squares on the surface, with sides of size_m: one for each point of a map. Points farther than
// size_m from the surface are omitted.
struct ScoreSquares {
  std::vector<ColoredMesh> meshes;  // one mesh per color, ascending by red, green, blue
  std::size_t on_surface = 0;       // number of points within size_m of the surface
};
ScoreSquares score_squares(const std::vector<Eigen::Vector3d>& points,
                           const std::vector<Color>& colors, double size_m,
                           const TriangleMesh& surface);

}  // namespace libmap
