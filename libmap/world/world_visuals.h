// Meshes that a world shows: a surface by the pages of its texture, and the scores of a map on it.
#pragma once

#include <cstddef>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/core/triangle_mesh.h"

namespace libmap {

// Unit of the coordinates in OBJ files, far below float32's resolution at 16 m.
constexpr double mesh_unit_m = 1e-6;
// Rounds vertices to this unit, and normals to three decimals, for short files.
void round_vertices(TriangleMesh& mesh);

// The mesh with its vertex colors as a texture: each triangle has 2 x 2 texels, between whose
// centers bilinear interpolation is that of the colors. Without colors there is no page.
TexturedMesh bake_vertex_colors(TriangleMesh mesh);

// The triangles of one page (no_page: without texture), with this page alone, rounded. No two of
// them run along an edge in the same sense.
TexturedMesh page_of(const TexturedMesh& model, std::int32_t page);

struct ColoredMesh {
  Color color{};
  TriangleMesh mesh;
};

// A square on the surface for each point of a map, one mesh per color. Points farther from the
// surface than the size of a square have none.
struct ScoreSquares {
  std::vector<ColoredMesh> meshes;
  std::size_t on_surface = 0;
};
ScoreSquares score_squares(const std::vector<Eigen::Vector3d>& points,
                           const std::vector<Color>& colors, double size_m,
                           const TriangleMesh& surface);

}  // namespace libmap
