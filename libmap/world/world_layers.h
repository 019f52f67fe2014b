// Visible shapes of a simulator world: a mesh by texture pages, and squares of map scores.
#pragma once

#include <cstddef>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/mesh/surface_distance.h"

namespace libmap {

// Returns the mesh with vertex colors as a texture: 2 x 2 texels per triangle; bilinear
// interpolation of texels equals interpolation of the colors. Without colors, there are no pages.
TexturedMesh bake_vertex_colors(TriangleMesh mesh);

// Returns the triangles of one page (no_page: without texture), with this page only. No two
// triangles have a common edge in the same direction.
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
