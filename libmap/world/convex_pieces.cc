#include "libmap/world/convex_pieces.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <utility>

#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/ray_caster.h"

namespace libmap {

namespace {

constexpr double min_height_m = 1e-5;
constexpr double max_depth_of_radius = 1.5;
constexpr double thickness_fraction = 0.5;
// MuJoCo rejects flatter pieces.
constexpr double min_depth_m = 2e-4;
constexpr std::size_t max_outline = 8;
// Rays begin this far behind the surface.
constexpr double ray_start_m = 1e-6;
// Centers are multiples of this, so that equal corners stay equal when they are rounded to it.
constexpr double center_unit_m = 1e-5;

// Twice the area over the perimeter is the radius of the inscribed circle.
double inscribed_radius(const TriangleMesh& mesh, const Triangle& t) {
  double around_m = 0.0;
  for (std::size_t k = 0; k < 3; ++k)
    around_m += (mesh.vertices[t[k]] - mesh.vertices[t[(k + 1) % 3]]).norm();
  return area_normal(mesh, t).norm() / around_m;
}

// Triangles of one piece: a convex outline as seen along their mean normal.
struct Facet {
  std::vector<std::uint32_t> outline;  // vertices
  std::vector<HalfEdge> edges;         // edge n begins at vertex n of the outline
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  double radius_m = 0.0;  // smallest of the inscribed circles
  double bulge_m = 0.0;   // extent along the normal
};

double extent_along(const TriangleMesh& mesh, const Facet& facet) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const std::uint32_t v : facet.outline) {
    const double height = facet.normal.normalized().dot(mesh.vertices[v]);
    low = std::min(low, height);
    high = std::max(high, height);
  }
  return high - low;
}

bool is_convex(const TriangleMesh& mesh, const Facet& facet) {
  const std::size_t size = facet.outline.size();
  for (std::size_t k = 0; k < size; ++k) {
    const Eigen::Vector3d& corner = mesh.vertices[facet.outline[(k + 1) % size]];
    const Eigen::Vector3d in = corner - mesh.vertices[facet.outline[k]];
    const Eigen::Vector3d out = mesh.vertices[facet.outline[(k + 2) % size]] - corner;
    if (!(facet.normal.dot(in.cross(out)) > 1e-3 * facet.normal.norm() * in.norm() * out.norm()))
      return false;
  }
  return true;
}

// The facet with the triangle beyond its n-th edge.
Facet grown(const TriangleMesh& mesh, Facet facet, std::size_t n, HalfEdge beyond,
            double radius_m) {
  const HalfEdge next = next_in_triangle(beyond);
  const auto at = static_cast<std::ptrdiff_t>(n);
  facet.outline.insert(facet.outline.begin() + at + 1, target_of(mesh.triangles, next));
  facet.edges[n] = next;
  facet.edges.insert(facet.edges.begin() + at + 1, previous_in_triangle(beyond));
  facet.normal += area_normal(mesh, mesh.triangles[beyond / 3]);
  facet.radius_m = std::min(facet.radius_m, radius_m);
  facet.bulge_m = extent_along(mesh, facet);
  return facet;
}

// Adds the flattest neighbor for as long as the facet stays convex and flat enough. A neighbor
// whose third corner is already on the outline would close a fan; it makes the outline reflex.
Facet grow_facet(const TriangleMesh& mesh, const std::vector<HalfEdge>& opposite,
                 const std::vector<double>& radius_m, double max_bulge_m, Facet facet,
                 std::vector<bool>& free) {
  while (facet.outline.size() < max_outline) {
    std::optional<Facet> best;
    HalfEdge added = 0;
    for (std::size_t n = 0; n < facet.edges.size(); ++n) {
      const HalfEdge beyond = opposite[facet.edges[n]];
      if (!is_joined(beyond) || !free[beyond / 3]) continue;
      Facet more = grown(mesh, facet, n, beyond, radius_m[beyond / 3]);
      if (more.bulge_m > max_bulge_m || (best && more.bulge_m >= best->bulge_m) ||
          !is_convex(mesh, more))
        continue;
      best = std::move(more);
      added = beyond;
    }
    if (!best) break;
    facet = std::move(*best);
    free[added / 3] = false;
  }
  return facet;
}

}  // namespace

ConvexPieces make_convex_pieces(const TriangleMesh& mesh, const std::vector<bool>& marks,
                                const TriangleMesh& body, double body_error_m,
                                double max_deviation_m, double max_depth_m) {
  ConvexPieces result;
  if (std::none_of(marks.begin(), marks.end(), [](bool mark) { return mark; })) return result;
  const RayCaster rays(body);
  const std::vector<HalfEdge> opposite = opposites_of(mesh);
  std::vector<bool> free = marks;
  std::vector<double> radius_m(mesh.triangles.size());
  for (std::size_t n = 0; n < free.size(); ++n) {
    radius_m[n] = inscribed_radius(mesh, mesh.triangles[n]);
    free[n] = free[n] && radius_m[n] > min_height_m / 2;
  }
  for (std::size_t n = 0; n < free.size(); ++n) {
    if (!free[n]) continue;
    free[n] = false;
    const auto h = static_cast<HalfEdge>(3 * n);
    const Triangle& t = mesh.triangles[n];
    const Facet facet = grow_facet(mesh, opposite, radius_m, max_deviation_m,
                                   {.outline = {t[0], t[1], t[2]},
                                    .edges = {h, h + 1, h + 2},
                                    .normal = area_normal(mesh, t),
                                    .radius_m = radius_m[n]},
                                   free);
    const std::vector<std::uint32_t>& corners = facet.outline;
    result.deviation_m = std::max(result.deviation_m, facet.bulge_m);
    double depth_m = std::min(max_depth_m, max_depth_of_radius * facet.radius_m);
    Eigen::Vector3d center = Eigen::Vector3d::Zero();
    for (const std::uint32_t v : corners)
      center += mesh.vertices[v] / static_cast<double>(corners.size());
    const Eigen::Vector3d behind = -facet.normal.normalized();
    if (const auto hit = rays.cast(center, behind, ray_start_m + facet.bulge_m + body_error_m))
      depth_m = std::min(depth_m, thickness_fraction * hit->distance);
    depth_m = std::max(depth_m, min_depth_m);
    ConvexPiece piece;
    piece.center = (center / center_unit_m).array().round() / std::round(1 / center_unit_m);
    for (const std::uint32_t v : corners)
      piece.corners_m.emplace_back(mesh.vertices[v] - piece.center);
    piece.corners_m.emplace_back(center + depth_m * behind - piece.center);
    result.pieces.push_back(std::move(piece));
  }
  return result;
}

}  // namespace libmap
