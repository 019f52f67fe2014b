#include "libmap/world/convex_pieces.h"

#include <algorithm>
#include <cstddef>

#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/ray_caster.h"

namespace libmap {

namespace {

constexpr double min_height_m = 1e-5;
constexpr double max_depth_of_radius = 1.5;
constexpr double thickness_share = 0.5;
// Rays begin this far behind the surface.
constexpr double ray_start_m = 1e-6;

}  // namespace

std::vector<ConvexPiece> make_convex_pieces(const TriangleMesh& mesh,
                                            const std::vector<bool>& marks, double max_depth_m) {
  const RayCaster rays(mesh);
  std::vector<ConvexPiece> pieces;
  for (std::size_t n = 0; n < mesh.triangles.size(); ++n) {
    if (!marks[n]) continue;
    const Triangle& t = mesh.triangles[n];
    const Eigen::Vector3d normal = area_normal(mesh, t);
    const Eigen::Vector3d center = center_of(mesh, t);
    double longest_m = 0.0;
    double around_m = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double side_m = (mesh.vertices[t[k]] - mesh.vertices[t[(k + 1) % 3]]).norm();
      longest_m = std::max(longest_m, side_m);
      around_m += side_m;
    }
    if (!(normal.norm() > min_height_m * longest_m)) continue;
    double depth_m = std::min(max_depth_m, max_depth_of_radius * normal.norm() / around_m);
    const Eigen::Vector3d behind = -normal.normalized();
    if (const auto hit = rays.cast(center, behind, ray_start_m))
      depth_m = std::min(depth_m, thickness_share * hit->distance);
    ConvexPiece piece{.center = center, .corners_m = {}};
    for (std::size_t k = 0; k < 3; ++k) piece.corners_m[k] = mesh.vertices[t[k]] - center;
    piece.corners_m[3] = depth_m * behind;
    pieces.push_back(piece);
  }
  return pieces;
}

}  // namespace libmap
