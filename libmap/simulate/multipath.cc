#include "libmap/simulate/multipath.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "libmap/core/parallel.h"
#include "libmap/mesh/ray_caster.h"

namespace libmap {

namespace {

constexpr int grid_px = 6;
constexpr int directions = 64;
// By which rays begin off the surface that they leave.
constexpr double lift_m = 1e-4;
// Direct light at least, however flat the surface is seen.
constexpr double min_cosine = 0.1;

// Unit vectors about z whose density is the cosine to it: a spiral, even on the disc below them.
const std::vector<Eigen::Vector3d>& cosine_directions() {
  static const std::vector<Eigen::Vector3d> all = [] {
    std::vector<Eigen::Vector3d> list;
    const double golden_angle = std::numbers::pi * (3.0 - std::sqrt(5.0));
    for (int n = 0; n < directions; ++n) {
      const double square = (n + 0.5) / directions;
      const double radius = std::sqrt(square);
      list.emplace_back(radius * std::cos(n * golden_angle), radius * std::sin(n * golden_angle),
                        std::sqrt(1.0 - square));
    }
    return list;
  }();
  return all;
}

class Reflections {
 public:
  Reflections(const VisibleSurface& surface, const Eigen::Vector3d& camera, double reflectance)
      : caster_(surface.caster()),
        mesh_(surface.mesh()),
        camera_(camera),
        reflectance_(reflectance) {}

  // What is added to the range in this direction; NaN where there is no surface.
  double range_error(const Eigen::Vector3d& direction) const {
    const auto hit = caster_.cast(camera_, direction);
    if (!hit) return std::numeric_limits<double>::quiet_NaN();
    const Eigen::Vector3d point = camera_ + hit->distance * direction;
    const Eigen::Vector3d normal = normal_against(*hit, direction);
    const double range = (point - camera_).norm();
    const double cosine = std::max(min_cosine, -normal.dot(direction) / direction.norm());
    const Eigen::Quaterniond turn =
        Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), normal);
    double light = 0.0;
    double sum = 0.0;
    for (const Eigen::Vector3d& around : cosine_directions()) {
      const Bounce bounce = bounce_from(point + lift_m * normal, turn * around);
      if (!(bounce.light > 0.0)) continue;
      const double part = bounce.light * range * range / cosine / directions;
      light += part;
      sum += part * 0.5 * (bounce.way_m - range);
    }
    return reflectance_ * sum / (1.0 + reflectance_ * light);
  }

 private:
  // Light from the camera by way of what is seen from a point in a direction: of the way to that
  // point, and how strong it is for a reflectance of 1.
  struct Bounce {
    double way_m = 0.0;
    double light = 0.0;
  };

  Eigen::Vector3d normal_against(const RayHit& hit, const Eigen::Vector3d& direction) const {
    const Eigen::Vector3d normal = area_normal(mesh_, mesh_.triangles[hit.triangle]).normalized();
    return normal.dot(direction) > 0.0 ? Eigen::Vector3d(-normal) : normal;
  }

  Bounce bounce_from(const Eigen::Vector3d& point, const Eigen::Vector3d& direction) const {
    const auto hit = caster_.cast(point, direction);
    if (!hit) return {};
    const Eigen::Vector3d normal = normal_against(*hit, direction);
    const Eigen::Vector3d mirror = point + hit->distance * direction + lift_m * normal;
    const Eigen::Vector3d to_camera = camera_ - mirror;
    const double range = to_camera.norm();
    const double cosine = normal.dot(to_camera) / range;
    if (!(cosine > 0.0) || caster_.cast(mirror, to_camera, 0.0, 1.0)) return {};
    return {hit->distance + range, cosine / (range * range)};
  }

  const RayCaster& caster_;
  const TriangleMesh& mesh_;
  Eigen::Vector3d camera_;
  double reflectance_;
};

// The mean of the four nodes around a place, by nearness; 0 where none is known.
double error_between(const Image<double>& grid, double x, double y) {
  const int left = std::clamp(static_cast<int>(x), 0, grid.width - 2);
  const int top = std::clamp(static_cast<int>(y), 0, grid.height - 2);
  double sum = 0.0;
  double weights = 0.0;
  for (int j = 0; j < 2; ++j)
    for (int i = 0; i < 2; ++i) {
      const double error = grid.at(left + i, top + j);
      const double weight =
          std::max(0.0, 1.0 - std::abs(x - left - i)) * std::max(0.0, 1.0 - std::abs(y - top - j));
      if (!std::isfinite(error) || !(weight > 0.0)) continue;
      sum += weight * error;
      weights += weight;
    }
  return weights > 0.0 ? sum / weights : 0.0;
}

void add_errors(DepthImage& depth, const std::vector<Eigen::Vector2d>& rays,
                const Image<double>& grid, double shift) {
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x) {
      float& z = depth.at(x, y);
      const double range_of_depth = rays[depth.index(x, y)].homogeneous().norm();
      if (!(z > 0.0F) || !std::isfinite(range_of_depth)) continue;
      const double error = error_between(grid, (x + shift) / grid_px, (y + shift) / grid_px);
      z += static_cast<float>(error / range_of_depth);
    }
}

}  // namespace

void add_multipath(SurfaceView& view, const VisibleSurface& surface, const ViewRays& rays,
                   const Pose& world_from_camera, double reflectance) {
  if (!(reflectance > 0.0)) return;
  const Reflections reflections(surface, world_from_camera.translation(), reflectance);
  // One node more than reaches over the image.
  Image<double> grid((rays.width - 1) / grid_px + 2, (rays.height - 1) / grid_px + 2,
                     std::numeric_limits<double>::quiet_NaN());
  parallel_for(static_cast<std::size_t>(grid.height), 1, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y)
      for (int x = 0; x < grid.width; ++x) {
        const std::size_t pixel = view.depth.index(std::min(x * grid_px, rays.width - 1),
                                                   std::min(y * grid_px, rays.height - 1));
        const Eigen::Vector2d& ray = rays.centers[pixel];
        if (ray.allFinite())
          grid.at(x, y) = reflections.range_error(world_from_camera.linear() * ray.homogeneous());
      }
  });
  add_errors(view.depth, rays.centers, grid, 0.0);
  add_errors(view.corner_depth, rays.corners, grid, -0.5);
}

}  // namespace libmap
