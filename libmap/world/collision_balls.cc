#include "libmap/world/collision_balls.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>

#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/ray_caster.h"
#include "libmap/mesh/surface_distance.h"

namespace libmap {

namespace {

constexpr double units_per_m = 1e5;
// A ball is accepted if it reaches the surface within this share of the bound, else it shrinks.
constexpr double tangent_share = 0.5;
constexpr double next_radius = 0.8;
// A triangle is divided into 4 parts up to this many times; the parts may be in different balls.
constexpr int max_divisions = 2;
// Rays begin this far behind the surface.
constexpr double ray_start_m = 1e-6;

class BallCover {
 public:
  BallCover(const TriangleMesh& body, const CollisionBallOptions& options)
      : rays_(body), surface_(body), options_(options) {}

  // Adds balls until each part of the triangle is within the bound of one ball; by convexity, its
  // corners are sufficient. Parts smaller than the bound always are.
  void cover(const TriangleCorners& part, const Eigen::Vector3d& inward) {
    if (is_covered(part, max_divisions)) return;
    add_ball((part[0] + part[1] + part[2]) / 3.0, inward);
    if (is_covered(part, max_divisions)) return;
    for (const TriangleCorners& quarter : quarters_of(part)) cover(quarter, inward);
  }

  std::vector<CollisionBall> balls;

 private:
  using Cell = std::array<std::int64_t, 3>;

  Cell cell_of(const Eigen::Vector3d& point) const {
    const Eigen::Array3d cell = (point / options_.max_radius_m).array().floor();
    return {std::llround(cell.x()), std::llround(cell.y()), std::llround(cell.z())};
  }

  bool is_covered(const TriangleCorners& part, int divisions) const {
    if (is_in_ball(part)) return true;
    if (divisions == 0) return false;
    const auto quarters = quarters_of(part);
    return std::all_of(quarters.begin(), quarters.end(), [&](const TriangleCorners& quarter) {
      return is_covered(quarter, divisions - 1);
    });
  }

  bool is_in_ball(const TriangleCorners& part) const {
    const auto near = balls_of_cell_.find(cell_of(part[0]));
    return near != balls_of_cell_.end() &&
           std::any_of(near->second.begin(), near->second.end(), [&](std::uint32_t n) {
             const double reach_m = balls[n].radius_m + options_.max_deviation_m;
             return std::all_of(part.begin(), part.end(), [&](const Eigen::Vector3d& corner) {
               return (corner - balls[n].center).norm() <= reach_m;
             });
           });
  }

  // The largest ball inside of the body that touches the surface at a point, then larger by the
  // bound. Nothing is between the point and the middle of the body behind it.
  void add_ball(const Eigen::Vector3d& point, const Eigen::Vector3d& inward) {
    double depth_m = options_.max_radius_m;
    if (const auto hit = rays_.cast(point, inward, ray_start_m, 2 * depth_m))
      depth_m = hit->distance / 2;
    CollisionBall ball;
    for (;; depth_m *= next_radius) {
      ball.center = ((point + depth_m * inward) * units_per_m).array().round() / units_per_m;
      const double room_m = surface_.nearest(ball.center).distance_m;
      ball.radius_m = std::floor((room_m + options_.max_deviation_m) * units_per_m) / units_per_m;
      if (room_m >= depth_m - tangent_share * options_.max_deviation_m) break;
    }
    const Eigen::Vector3d reach =
        Eigen::Vector3d::Constant(ball.radius_m + options_.max_deviation_m);
    const Cell low = cell_of(ball.center - reach);
    const Cell high = cell_of(ball.center + reach);
    for (std::int64_t x = low[0]; x <= high[0]; ++x)
      for (std::int64_t y = low[1]; y <= high[1]; ++y)
        for (std::int64_t z = low[2]; z <= high[2]; ++z)
          balls_of_cell_[{x, y, z}].push_back(static_cast<std::uint32_t>(balls.size()));
    balls.push_back(ball);
  }

  RayCaster rays_;
  SurfaceDistance surface_;
  CollisionBallOptions options_;
  std::map<Cell, std::vector<std::uint32_t>> balls_of_cell_;
};

}  // namespace

std::vector<CollisionBall> cover_with_balls(const TriangleMesh& mesh,
                                            const std::vector<bool>& marks,
                                            const TriangleMesh& body,
                                            const CollisionBallOptions& options) {
  if (count_of(marks) == 0) return {};
  BallCover cover(body, options);
  for (std::size_t n = 0; n < marks.size(); ++n) {
    const Eigen::Vector3d inward = -area_normal(mesh, mesh.triangles[n]).normalized();
    if (marks[n] && inward.norm() > 0.5) cover.cover(corners_of(mesh, mesh.triangles[n]), inward);
  }
  return std::move(cover.balls);
}

}  // namespace libmap
