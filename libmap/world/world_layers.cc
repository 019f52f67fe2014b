#include "libmap/world/world_layers.h"

#include <algorithm>
#include <map>
#include <unordered_set>
#include <utility>

#include "libmap/core/parallel.h"
#include "libmap/core/pose.h"
#include "libmap/mesh/mesh_parts.h"

namespace libmap {

namespace {

constexpr std::size_t blocks_per_side = 2048;
constexpr std::size_t blocks_per_page = blocks_per_side * blocks_per_side;
constexpr std::size_t points_grain = 1024;
// Squares are this far above the surface, so that it does not hide them.
constexpr double lift_m = 0.001;

// The fourth texel continues the plane of the other three.
Color fourth(const Color& a, const Color& b, const Color& c) {
  Color color{};
  for (std::size_t k = 0; k < 3; ++k)
    color[k] = static_cast<std::uint8_t>(std::clamp(b[k] + c[k] - a[k], 0, 255));
  return color;
}

// MuJoCo rejects meshes in which two triangles run along an edge in the same sense: the later one
// gets vertices of its own.
void detach_repeated_edges(TriangleMesh& mesh) {
  std::unordered_set<std::uint64_t> edges;
  const auto key = [](const Triangle& t, std::size_t k) {
    return std::uint64_t{t[k]} << 32U | t[(k + 1) % 3];
  };
  for (Triangle& t : mesh.triangles) {
    if (edges.contains(key(t, 0)) || edges.contains(key(t, 1)) || edges.contains(key(t, 2)))
      for (std::uint32_t& v : t) v = append_vertex_between(mesh, v, v, 0.0);
    for (std::size_t k = 0; k < 3; ++k) edges.insert(key(t, k));
  }
}

}  // namespace

TexturedMesh bake_vertex_colors(TriangleMesh mesh) {
  TexturedMesh model;
  model.mesh = std::move(mesh);
  const std::size_t count = model.mesh.triangles.size();
  model.texture_coordinates.resize(count);
  model.page_of_triangle.assign(count, no_page);
  if (model.mesh.vertex_colors.empty()) return model;
  for (std::size_t first = 0; first < count; first += blocks_per_page) {
    const std::size_t blocks = std::min(count - first, blocks_per_page);
    std::size_t side = 1;
    while (side * side < blocks) ++side;
    const int size = static_cast<int>(2 * side);
    ColorImage page(size, size);
    const auto page_size = static_cast<float>(size);
    for (std::size_t n = 0; n < blocks; ++n) {
      const Triangle& t = model.mesh.triangles[first + n];
      const std::size_t column = 2 * (n % side);
      const std::size_t row = 2 * (n / side);
      const std::size_t corner = row * 2 * side + column;
      const auto color = [&](std::size_t k) { return model.mesh.vertex_colors[t[k]]; };
      page.pixels[corner] = color(0);
      page.pixels[corner + 1] = color(1);
      page.pixels[corner + 2 * side] = color(2);
      page.pixels[corner + 2 * side + 1] = fourth(color(0), color(1), color(2));
      const Eigen::Vector2f low(static_cast<float>(column) + 0.5F, static_cast<float>(row) + 0.5F);
      model.texture_coordinates[first + n] = {low / page_size,
                                              (low + Eigen::Vector2f::UnitX()) / page_size,
                                              (low + Eigen::Vector2f::UnitY()) / page_size};
      model.page_of_triangle[first + n] = static_cast<std::int32_t>(model.pages.size());
    }
    model.pages.push_back(std::move(page));
  }
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
  for (auto& [key, colored] : by_color) result.meshes.push_back(std::move(colored));
  return result;
}

}  // namespace libmap
