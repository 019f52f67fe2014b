#include "libmap/world/world_visuals.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "libmap/core/parallel.h"
#include "libmap/core/pose.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/surface_distance.h"

namespace libmap {

namespace {

constexpr std::size_t points_grain = 1024;
// Squares are this far above the surface, so that it does not hide them.
constexpr double lift_m = 0.001;

// MuJoCo rejects meshes in which two triangles run along an edge in the same direction. The later
// triangle gets separate vertices.
void detach_repeated_edges(TriangleMesh& mesh) {
  std::set<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (Triangle& t : mesh.triangles) {
    const auto edge = [&](std::size_t k) { return std::pair(t[k], t[(k + 1) % 3]); };
    if (edges.contains(edge(0)) || edges.contains(edge(1)) || edges.contains(edge(2)))
      for (std::uint32_t& v : t) v = append_vertex_between(mesh, v, v, 0.0);
    for (std::size_t k = 0; k < 3; ++k) edges.insert(edge(k));
  }
}

}  // namespace

void round_vertices(TriangleMesh& mesh) {
  const double per_m = std::round(1 / mesh_unit_m);
  for (Eigen::Vector3d& vertex : mesh.vertices) vertex = (vertex * per_m).array().round() / per_m;
  for (Eigen::Vector3f& normal : mesh.vertex_normals)
    normal = (normal * 1e3F).array().round() / 1e3F;
}

TexturedMesh bake_vertex_colors(TriangleMesh mesh) {
  TexturedMesh model;
  model.mesh = std::move(mesh);
  const std::size_t count = model.mesh.triangles.size();
  const bool has_colors = !model.mesh.vertex_colors.empty();
  model.texture_coordinates.resize(count);
  model.page_of_triangle.assign(count, has_colors ? 0 : no_page);
  if (!has_colors) return model;
  const auto side = static_cast<int>(std::ceil(std::sqrt(static_cast<double>(count))));
  ColorImage page(2 * side, 2 * side);
  for (std::size_t n = 0; n < count; ++n) {
    const int column = 2 * (static_cast<int>(n) % side);
    const int row = 2 * (static_cast<int>(n) / side);
    std::array<Eigen::Array3i, 4> colors;
    for (std::size_t k = 0; k < 3; ++k) {
      const Color& color = model.mesh.vertex_colors[model.mesh.triangles[n][k]];
      colors[k] = {color[0], color[1], color[2]};
    }
    // The fourth texel continues the plane of the other three.
    colors[3] = (colors[1] + colors[2] - colors[0]).max(0).min(255);
    for (int k = 0; k < 4; ++k) {
      const Eigen::Array3i& color = colors[static_cast<std::size_t>(k)];
      page.pixels[page.index(column + k % 2, row + k / 2)] = {static_cast<std::uint8_t>(color[0]),
                                                              static_cast<std::uint8_t>(color[1]),
                                                              static_cast<std::uint8_t>(color[2])};
      if (k < 3)
        model.texture_coordinates[n][static_cast<std::size_t>(k)] =
            (Eigen::Array2f(static_cast<float>(column + k % 2), static_cast<float>(row + k / 2)) +
             0.5F) /
            static_cast<float>(2 * side);
    }
  }
  model.pages.push_back(std::move(page));
  return model;
}
TexturedMesh page_of(const TexturedMesh& model, std::int32_t page) {
  std::vector<bool> keep(model.mesh.triangles.size());
  TexturedMesh result;
  for (std::size_t t = 0; t < keep.size(); ++t) {
    keep[t] = model.page_of_triangle[t] == page;
    if (keep[t]) result.texture_coordinates.push_back(model.texture_coordinates[t]);
  }
  result.mesh = select_triangles(model.mesh, keep);
  detach_repeated_edges(result.mesh);
  round_vertices(result.mesh);
  result.page_of_triangle.assign(result.mesh.triangles.size(), page == no_page ? no_page : 0);
  if (page != no_page) result.pages.push_back(model.pages[static_cast<std::size_t>(page)]);
  return result;
}

ScoreSquares score_squares(const std::vector<Eigen::Vector3d>& points,
                           const std::vector<Color>& colors, double size_m,
                           const TriangleMesh& surface) {
  const SurfaceDistance distance(surface);
  std::vector<SurfacePoint> nearest(points.size());
  parallel_each(points.size(), points_grain,
                [&](std::size_t n) { nearest[n] = distance.nearest(points[n]); });
  std::map<Color, ColoredMesh> by_color;
  ScoreSquares result;
  for (std::size_t n = 0; n < points.size(); ++n) {
    if (!(nearest[n].distance_m <= size_m)) continue;
    ++result.on_surface;
    const Eigen::Vector3d normal =
        area_normal(surface, surface.triangles[nearest[n].triangle]).normalized();
    if (!normal.allFinite()) continue;
    ColoredMesh& colored = by_color[colors[n]];
    colored.color = colors[n];
    const Eigen::Matrix3d turn = shortest_rotation(Eigen::Vector3d::UnitZ(), normal);
    const auto first = static_cast<std::uint32_t>(colored.mesh.vertices.size());
    for (const auto& [x, y] : {std::pair(-0.5, -0.5), {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}})
      colored.mesh.vertices.emplace_back(nearest[n].position +
                                         turn * Eigen::Vector3d(x * size_m, y * size_m, lift_m));
    colored.mesh.triangles.push_back({first, first + 1, first + 2});
    colored.mesh.triangles.push_back({first, first + 2, first + 3});
  }
  for (auto& [key, colored] : by_color) {
    round_vertices(colored.mesh);
    result.meshes.push_back(std::move(colored));
  }
  return result;
}

}  // namespace libmap
