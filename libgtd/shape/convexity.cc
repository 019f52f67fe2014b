#include "libgtd/shape/convexity.h"

#include <cmath>
#include <optional>
#include <string>

#include "libgtd/shape/point_grid.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"

namespace libgtd {

namespace {

constexpr std::size_t positions_per_chunk = 1024;

constexpr double default_bend = 0.1;  // curvature times radius

bool is_convex(const Curvature& c, const CurvatureResult& of, double height,
               const ConvexityOptions& options) {
  if (!c.valid) return false;
  if (of.method == CurvatureMethod::corrected)
    return c.k2 > options.min_curvature_per_m.value_or(default_bend / of.radius_m);
  const double gaussian = static_cast<double>(c.k1) * static_cast<double>(c.k2);  // eq. 3-19
  return gaussian > options.min_gaussian_curvature && height > options.zero_plane_m;
}

void check_bound(const char* field, double value) {
  if (std::isnan(value)) throw libmap::Error("not a number", {.field = field, .value = "nan"});
}

// Searches for points near given positions; neighboring positions share a search.
class NearSearch {
 public:
  NearSearch(const std::vector<Eigen::Vector3d>& points, const PointGrid& grid, double distance)
      : points_(points), grid_(grid), square_(distance * distance) {}

  bool is_near(const Eigen::Vector3d& position) {
    if (!grid_.reaches(position)) return false;
    const PointGrid::Cell cell = grid_.cell_of(position);
    if (!cell_ || *cell_ != cell) {
      grid_.find_near(cell, 1, runs_);
      cell_ = cell;
    }
    for (const PointGrid::Range& run : runs_)
      for (std::uint32_t k = run.first; k < run.last; ++k)
        if ((points_[grid_.order()[k]] - position).squaredNorm() < square_) return true;
    return false;
  }

 private:
  const std::vector<Eigen::Vector3d>& points_;
  const PointGrid& grid_;
  double square_;
  std::optional<PointGrid::Cell> cell_;
  std::vector<PointGrid::Range> runs_;
};

}  // namespace

std::vector<std::uint8_t> find_convex(const CurvatureResult& curvature,
                                      const std::vector<Eigen::Vector3d>& positions,
                                      const ConvexityOptions& options) {
  if (positions.size() != curvature.points.size())
    throw libmap::Error("number of positions differs from number of curvatures",
                        {.field = "positions",
                         .value = std::to_string(positions.size()),
                         .bound = std::to_string(curvature.points.size())});
  check_bound("min_curvature_per_m", options.min_curvature_per_m.value_or(0));
  check_bound("min_gaussian_curvature", options.min_gaussian_curvature);
  check_bound("zero_plane_m", options.zero_plane_m);
  std::vector<std::uint8_t> convex(positions.size(), 0);
  for (std::size_t i = 0; i < positions.size(); ++i)
    convex[i] = is_convex(curvature.points[i], curvature, positions[i].z(), options) ? 1 : 0;
  return convex;
}

std::vector<std::uint8_t> mark_near_convex(const std::vector<Eigen::Vector3d>& positions,
                                           const std::vector<Eigen::Vector3d>& convex_points,
                                           double distance_m) {
  if (!(distance_m > 0) || std::isinf(distance_m))
    throw libmap::Error(
        "out of range",
        {.field = "distance_m", .value = libmap::to_text(distance_m), .bound = "> 0 and finite"});
  // Cells slightly wider than the distance, because of rounding at their borders.
  const PointGrid grid(convex_points, distance_m * (1 + 1e-6));
  std::vector<std::uint8_t> near(positions.size(), 0);
  if (grid.cells().empty()) return near;
  libmap::parallel_for(positions.size(), positions_per_chunk,
                       [&](std::size_t begin, std::size_t end) {
                         NearSearch search(convex_points, grid, distance_m);
                         for (std::size_t i = begin; i < end; ++i)
                           near[i] = search.is_near(positions[i]) ? 1 : 0;
                       });
  return near;
}

}  // namespace libgtd
