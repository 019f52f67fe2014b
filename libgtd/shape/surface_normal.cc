#include "libgtd/shape/surface_normal.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "libgtd/shape/point_grid.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"

namespace libgtd {

namespace {

using Eigen::Vector3d;

SurfaceNormal facing(const Vector3d& fitted, const Vector3d& outside, const Vector3d& up) {
  double side = side_of(fitted, outside);
  if (side == 0) side = side_of(fitted, up);
  const Vector3d normal = side < 0 ? Vector3d(-fitted) : fitted;
  SurfaceNormal result;
  result.slope_deg = static_cast<float>(std::acos(std::clamp(normal.dot(up), -1.0, 1.0)) *
                                        (180.0 / std::numbers::pi));
  if (side != 0) result.normal = normal.cast<float>();
  return result;
}

class PlaneFitter {
 public:
  PlaneFitter(const PointGrid& grid, const std::vector<Vector3d>& cell_sorted, double radius,
              const Vector3d& up)
      : candidates_(grid, cell_sorted), radius_(radius), up_(up.normalized()) {}

  void enter(const PointGrid::Cell& cell) {
    candidates_.enter(cell, 2);
    neighbors_.make_room(candidates_.count());
  }

  // Fits at a position in the cell entered last.
  SurfaceNormal fit(const Vector3d& position, const Vector3d& outside) {
    const NeighborLoops::Coordinates neighbors = neighbors_.coordinates();
    const std::size_t count = loops_.select(candidates_.coordinates(), candidates_.count(),
                                            position.data(), radius_, neighbors);
    if (count < 3) return {};
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(covariance_of(loops_, neighbors, count));
    if (!determines_plane(solver.eigenvalues())) return {};
    const Vector3d normal = solver.eigenvectors().col(0).normalized();
    return normal.allFinite() ? facing(normal, outside, up_) : SurfaceNormal{};
  }

 private:
  CellSurroundings candidates_;
  double radius_;
  Vector3d up_;
  const NeighborLoops& loops_ = neighbor_loops_of(libmap::best_instruction_set());
  CoordinateRows neighbors_;
};

}  // namespace

double side_of(const Vector3d& normal, const Vector3d& outside) {
  constexpr double min_cosine = 1e-3;
  if (!outside.allFinite() || !(outside.norm() > 0)) return 0;
  const double cosine = normal.dot(outside.normalized());
  return std::abs(cosine) < min_cosine ? 0 : cosine;
}

std::vector<SurfaceNormal> fit_surface_normals(const libmap::PointCloud& cloud,
                                               const std::vector<Vector3d>& positions,
                                               const std::vector<Eigen::Vector3f>& outsides,
                                               const SurfaceNormalOptions& options) {
  if (!(options.radius_m > 0) || std::isinf(options.radius_m))
    throw libmap::Error("out of range", {.field = "radius_m",
                                         .value = libmap::to_text(options.radius_m),
                                         .bound = "> 0 and finite"});
  if (!options.up.allFinite() || !(options.up.norm() > 0))
    throw libmap::Error("has length zero or is not finite", {.field = "up"});
  if (!outsides.empty() && outsides.size() != positions.size())
    throw libmap::Error("number of outer directions differs from number of positions",
                        {.field = "outsides",
                         .value = std::to_string(outsides.size()),
                         .bound = std::to_string(positions.size())});
  // Half the radius, slightly enlarged for rounding at the cell borders.
  const double cell_m = options.radius_m * (0.5 + 1e-6);
  const PointGrid grid(cloud.positions, cell_m);
  const PointGrid groups(positions, cell_m);
  const std::vector<Vector3d> cell_sorted = sorted_by_cell(grid, cloud.positions);
  std::vector<SurfaceNormal> normals(positions.size());
  libmap::parallel_for(groups.cells().size(), 16, [&](std::size_t begin, std::size_t end) {
    PlaneFitter fitter(grid, cell_sorted, options.radius_m, options.up);
    for (std::size_t c = begin; c < end; ++c) {
      fitter.enter(groups.cells()[c]);
      for (std::uint32_t n = groups.ranges()[c].first; n < groups.ranges()[c].last; ++n) {
        const std::uint32_t at = groups.order()[n];
        normals[at] = fitter.fit(positions[at], outsides.empty() ? Vector3d::Zero().eval()
                                                                 : outsides[at].cast<double>());
      }
    }
  });
  return normals;
}

}  // namespace libgtd
