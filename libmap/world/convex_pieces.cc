#include "libmap/world/convex_pieces.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/ray_caster.h"

namespace libmap {

namespace {

constexpr double min_height_m = 1e-5;
constexpr double max_depth_of_radius = 1.5;
constexpr double thickness_share = 0.5;
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

// How far apart the diagonals of the quadrilateral beside this half-edge are; nothing if it is not
// convex as seen along its mean normal, or reflex by the diagonal in front.
std::optional<double> bulge_of(const TriangleMesh& mesh, HalfEdge h, HalfEdge other) {
  const auto& at = mesh.vertices;
  const Eigen::Vector3d& a = at[source_of(mesh.triangles, h)];
  const Eigen::Vector3d& b = at[target_of(mesh.triangles, h)];
  const Eigen::Vector3d& c = at[target_of(mesh.triangles, next_in_triangle(h))];
  const Eigen::Vector3d& d = at[target_of(mesh.triangles, next_in_triangle(other))];
  const Eigen::Vector3d normal = (b - a).cross(c - a) + (a - b).cross(d - b);
  const std::array<Eigen::Vector3d, 4> outline = {a, d, b, c};
  for (std::size_t k = 0; k < 4; ++k) {
    const Eigen::Vector3d in = outline[(k + 1) % 4] - outline[k];
    const Eigen::Vector3d out = outline[(k + 2) % 4] - outline[(k + 1) % 4];
    if (!(normal.dot(in.cross(out)) > 1e-3 * normal.norm() * in.norm() * out.norm()))
      return std::nullopt;
  }
  return std::abs(normal.normalized().dot(a - c));
}

// The best partner of a triangle, of those that are marked and free.
std::optional<std::pair<HalfEdge, double>> partner_of(const TriangleMesh& mesh,
                                                      const std::vector<HalfEdge>& opposite,
                                                      const std::vector<bool>& free,
                                                      std::size_t triangle, double max_bulge_m) {
  std::optional<std::pair<HalfEdge, double>> best;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto h = static_cast<HalfEdge>(3 * triangle + k);
    if (!is_joined(opposite[h]) || !free[opposite[h] / 3]) continue;
    const auto bulge = bulge_of(mesh, h, opposite[h]);
    if (bulge && *bulge <= max_bulge_m && (!best || *bulge < best->second)) best = {h, *bulge};
  }
  return best;
}

}  // namespace

ConvexPieces make_convex_pieces(const TriangleMesh& mesh, const std::vector<bool>& marks,
                                double max_deviation_m, double max_depth_m) {
  ConvexPieces result;
  if (std::none_of(marks.begin(), marks.end(), [](bool mark) { return mark; })) return result;
  const RayCaster rays(mesh);
  const std::vector<HalfEdge> opposite = opposites_of(mesh);
  std::vector<bool> free = marks;
  std::vector<double> radius_m(mesh.triangles.size());
  for (std::size_t n = 0; n < free.size(); ++n) {
    radius_m[n] = inscribed_radius(mesh, mesh.triangles[n]);
    free[n] = free[n] && radius_m[n] > min_height_m / 2;
  }
  for (std::size_t n = 0; n < free.size(); ++n) {
    if (!free[n]) continue;
    const Triangle& t = mesh.triangles[n];
    std::vector<std::uint32_t> corners(t.begin(), t.end());
    Eigen::Vector3d normal = area_normal(mesh, t);
    double depth_m = std::min(max_depth_m, max_depth_of_radius * radius_m[n]);
    double bulge_m = 0.0;
    free[n] = false;
    if (const auto partner = partner_of(mesh, opposite, free, n, max_deviation_m)) {
      const HalfEdge other = opposite[partner->first];
      corners.push_back(target_of(mesh.triangles, next_in_triangle(other)));
      normal += area_normal(mesh, mesh.triangles[other / 3]);
      depth_m = std::min(depth_m, max_depth_of_radius * radius_m[other / 3]);
      free[other / 3] = false;
      bulge_m = partner->second;
      result.deviation_m = std::max(result.deviation_m, bulge_m);
    }
    Eigen::Vector3d center = Eigen::Vector3d::Zero();
    for (const std::uint32_t v : corners)
      center += mesh.vertices[v] / static_cast<double>(corners.size());
    const Eigen::Vector3d behind = -normal.normalized();
    if (const auto hit = rays.cast(center, behind, ray_start_m + bulge_m))
      depth_m = std::min(depth_m, thickness_share * hit->distance);
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
