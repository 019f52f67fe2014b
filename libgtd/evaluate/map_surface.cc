#include "libgtd/evaluate/map_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "libgtd/shape/curvature.h"
#include "libgtd/shape/point_grid.h"
#include "libmap/core/parallel.h"

namespace libgtd {

namespace {

using Eigen::Vector3d;
using std::numbers::pi;

constexpr double default_radius_voxels = 6.0;
constexpr std::size_t map_voxels_per_chunk = 1 << 12;

// The sign of a normal does not matter here. This direction is in no lattice plane, so that it is
// on one side of every surface of voxels, including walls along z.
Vector3d any_outside() { return {0.2718281828, 0.1414213562, 0.9518901214}; }

// Fraction of the kernel mass on this side of a straight edge at a distance of `edge` radii from
// the middle, -1..1. Across the direction of the edge, the kernel sums up to 4/3 (1 - x^2)^(3/2).
double mass_within(double edge) {
  const double root = std::sqrt(1.0 - edge * edge);
  const double integral =
      edge * root * root * root / 4.0 + 3.0 / 8.0 * (edge * root + std::asin(edge));
  return 0.5 + 8.0 / (3.0 * pi) * integral;
}

// Distance of the mean of this mass from the middle, in radii.
double offset_within(double edge) {
  return 8.0 / (15.0 * pi) * std::pow(1.0 - edge * edge, 2.5) / mass_within(edge);
}

// Inverse of offset_within: fraction of the mass for a mean `offset` radii from the middle.
class MassOfOffset {
 public:
  MassOfOffset() {
    for (std::size_t n = 0; n < masses_.size(); ++n) {
      // The offset decreases with the distance of the edge; solved by bisection.
      double near = -0.99;
      double far = 1.0;
      for (int step = 0; step < 60; ++step) {
        const double middle = (near + far) / 2.0;
        (offset_within(middle) > offset_at(n) ? near : far) = middle;
      }
      masses_[n] = mass_within(near);
    }
  }
  double operator()(double offset) const {
    const double index = std::min(offset / offset_at(1), static_cast<double>(masses_.size() - 1));
    const std::size_t below = std::min(static_cast<std::size_t>(index), masses_.size() - 2);
    return std::lerp(masses_[below], masses_[below + 1], index - static_cast<double>(below));
  }

 private:
  static double offset_at(std::size_t n) { return 0.8 * static_cast<double>(n) / 256.0; }
  std::array<double, 257> masses_{};
};

class AreaCounter {
 public:
  AreaCounter(const std::vector<Vector3d>& centers, double radius_m, double voxel_size_m)
      : centers_(centers),
        radius_m_(radius_m),
        half_voxel_m_(voxel_size_m / 2.0),
        grid_(centers, radius_m) {}

  double area_m2(std::size_t n, const Vector3d& normal, std::vector<PointGrid::Range>& runs) const {
    const double squared_radius = radius_m_ * radius_m_;
    double mass = 0.0;
    Vector3d moment = Vector3d::Zero();
    grid_.find_near(grid_.cell_of(centers_[n]), 1, runs);
    for (const PointGrid::Range& run : runs)
      for (std::uint32_t r = run.first; r < run.last; ++r) {
        const Vector3d offset = centers_[grid_.order()[r]] - centers_[n];
        const double height = offset.dot(normal);
        const Vector3d level = offset - height * normal;
        const double beyond = std::max(0.0, std::abs(height) - half_voxel_m_);
        const double weight = 1.0 - (level.squaredNorm() + beyond * beyond) / squared_radius;
        if (!(weight > 0.0)) continue;
        mass += weight;
        moment += weight * level;
      }
    const double fraction = mass_of_offset_(moment.norm() / mass / radius_m_);
    return fraction * pi * squared_radius / 2.0 / mass;
  }

 private:
  const std::vector<Vector3d>& centers_;
  double radius_m_;
  double half_voxel_m_;
  PointGrid grid_;
  MassOfOffset mass_of_offset_;
};

}  // namespace

void bind(libmap::ParameterTable& table, MapSurfaceOptions& options) {
  table.add("surface_radius_m", options.surface_radius_m, libmap::not_negative,
            "radius within which slope and surface area are estimated, m; 0: six voxel edges");
}

double MapSurface::plan_area_m2(std::size_t n) const {
  const auto whole_m2 = static_cast<double>(area_m2[n]);
  if (std::isnan(slope_deg[n])) return whole_m2;
  return whole_m2 * std::cos(static_cast<double>(slope_deg[n]) * pi / 180.0);
}

MapSurface measure_surface(const VoxelMap& map, const MapSurfaceOptions& options) {
  libmap::check_parameters(options);
  const double size_m = map.lattice.voxel_size_m;
  MapSurface surface;
  surface.radius_m =
      options.surface_radius_m > 0.0 ? options.surface_radius_m : default_radius_voxels * size_m;
  libmap::PointCloud centers;
  centers.positions.reserve(map.size());
  for (std::size_t n = 0; n < map.size(); ++n)
    centers.positions.push_back(map.center_in_terrain(n));
  const CurvatureResult shape = estimate_curvature(
      centers,
      {.method = CurvatureMethod::corrected, .radius_m = surface.radius_m, .up = any_outside()});
  const AreaCounter counter(centers.positions, surface.radius_m, size_m);
  surface.slope_deg.assign(map.size(), std::numeric_limits<float>::quiet_NaN());
  surface.area_m2.assign(map.size(), static_cast<float>(size_m * size_m));
  libmap::parallel_for(map.size(), map_voxels_per_chunk, [&](std::size_t begin, std::size_t end) {
    std::vector<PointGrid::Range> runs;
    for (std::size_t n = begin; n < end; ++n) {
      if (!shape.points[n].valid) continue;
      const Vector3d normal = shape.points[n].normal.cast<double>();
      surface.slope_deg[n] =
          static_cast<float>(std::acos(std::min(1.0, std::abs(normal.z()))) * 180.0 / pi);
      surface.area_m2[n] = static_cast<float>(counter.area_m2(n, normal, runs));
    }
  });
  return surface;
}

}  // namespace libgtd
