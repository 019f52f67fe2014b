#include "libgtd/shape/curvature.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <string>

#include "libgtd/shape/neighbor_loops.h"
#include "libgtd/shape/point_grid.h"
#include "libgtd/shape/surface_normal.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"

namespace libgtd {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr std::size_t min_neighbors = 6;  // a quadric has six coefficients
// Minimum remainder of a column of the normal equations after elimination of the columns before it.
constexpr double min_pivot = 1e-6;

// Sets the columns u, v, w: widest, second and thinnest direction of the neighborhood. Returns
// false if the points do not determine a plane.
bool tangent_frame(const Matrix3d& covariance, Matrix3d& frame) {
  Eigen::SelfAdjointEigenSolver<Matrix3d> solver;
  solver.computeDirect(covariance);
  if (!determines_plane(solver.eigenvalues())) return false;
  const Vector3d w = solver.eigenvectors().col(0).normalized();
  const Vector3d wide = solver.eigenvectors().col(2);
  const Vector3d u = (wide - wide.dot(w) * w).normalized();
  frame << u, w.cross(u), w;
  return frame.allFinite();
}

// Normal equations of w = f + d u + e v + a u^2 + b u v + c v^2.
void normal_equations(const NeighborLoops& loops, const NeighborLoops::Coordinates& neighbors,
                      std::size_t count, const Matrix3d& frame, Matrix6d& matrix, Vector6d& right) {
  std::array<double, NeighborLoops::quadric_sums> m;
  loops.sum_quadric(neighbors, count, frame.data(), m.data());
  matrix << static_cast<double>(count), m[0], m[1], m[2], m[3], m[4],  //
      m[0], m[2], m[3], m[5], m[6], m[7],                              //
      m[1], m[3], m[4], m[6], m[7], m[8],                              //
      m[2], m[5], m[6], m[9], m[10], m[11],                            //
      m[3], m[6], m[7], m[10], m[11], m[12],                           //
      m[4], m[7], m[8], m[11], m[12], m[13];
  right << m[14], m[15], m[16], m[17], m[18], m[19];
}

// Solves by L D L^T; returns false if the columns are not independent.
bool solve(const Matrix6d& matrix, const Vector6d& right, Vector6d& solution) {
  Matrix6d l = Matrix6d::Identity();
  Vector6d d;
  for (int j = 0; j < 6; ++j) {
    d[j] = matrix(j, j);
    for (int k = 0; k < j; ++k) d[j] -= l(j, k) * l(j, k) * d[k];
    if (!(d[j] > min_pivot * matrix(j, j))) return false;
    for (int i = j + 1; i < 6; ++i) {
      double value = matrix(i, j);
      for (int k = 0; k < j; ++k) value -= l(i, k) * l(j, k) * d[k];
      l(i, j) = value / d[j];
    }
  }
  solution = right;
  l.triangularView<Eigen::UnitLower>().solveInPlace(solution);
  solution.array() /= d.array();
  l.transpose().triangularView<Eigen::UnitUpper>().solveInPlace(solution);
  return solution.allFinite();
}

// Eigenvalues of the Weingarten map of this quadric at u = v = 0, larger first; positive if the
// surface bends towards +w (do Carmo, Differential Geometry of Curves and Surfaces, 3.3).
std::array<double, 2> bending(const Vector6d& quadric) {
  const double d = quadric[1], e = quadric[2];
  const double stretch = std::sqrt(1 + d * d + e * e);
  const double l = 2 * quadric[3] / stretch, m = quadric[4] / stretch, n = 2 * quadric[5] / stretch;
  // I = C C^T turns I^-1 II into the symmetric C^-1 II C^-T.
  const double c00 = std::sqrt(1 + d * d), c10 = d * e / c00;
  const double c11 = stretch / c00;
  const double s00 = l / (c00 * c00);
  const double s01 = (m / c00 - c10 * s00) / c11;
  const double s11 = (n - 2 * c10 * m / c00 + c10 * c10 * s00) / (c11 * c11);
  const double middle = (s00 + s11) / 2;
  const double half = std::hypot((s00 - s11) / 2, s01);
  return {middle + half, middle - half};
}

class QuadricFitter {
 public:
  // `cell_sorted` are the cloud's points in the order of the grid.
  QuadricFitter(const libmap::PointCloud& cloud, const PointGrid& grid,
                const std::vector<Vector3d>& cell_sorted, double radius, const Vector3d& up)
      : cloud_(cloud), candidates_(grid, cell_sorted), radius_(radius), up_(up.normalized()) {}

  // Gathers the surroundings of a cell for fit().
  void enter(const PointGrid::Cell& cell) {
    candidates_.enter(cell, 2);
    neighbors_.make_room(candidates_.count());
    is_fitted_ = false;
  }

  // Fits at a point of the cell entered last.
  Curvature fit(std::size_t point) {
    const Vector3d& position = cloud_.positions[point];
    if (!is_fitted_ || !is_same_position(position, position_)) {
      surface_ = fit_at(position);
      position_ = position;
      is_fitted_ = true;
    }
    if (!surface_) return {};
    double cosine = 0;
    if (cloud_.has_normals())
      cosine = side_of(surface_->normal, cloud_.normals[point].cast<double>());
    if (cosine == 0) cosine = side_of(surface_->normal, up_);
    if (cosine == 0) return {};
    const int side = cosine > 0 ? 1 : -1;
    const auto [toward, away] = surface_->bending;
    Curvature result;
    result.k1 = static_cast<float>((side > 0 ? -away : toward) / radius_);
    result.k2 = static_cast<float>((side > 0 ? -toward : away) / radius_);
    result.normal = (side * surface_->normal).cast<float>();
    result.valid = std::isfinite(result.k1) && std::isfinite(result.k2);
    return result.valid ? result : Curvature{};
  }

 private:
  // Fitted surface before the outside is known.
  struct Surface {
    Vector3d normal;
    std::array<double, 2> bending;
  };

  std::optional<Surface> fit_at(const Vector3d& position) {
    const NeighborLoops::Coordinates neighbors = neighbors_.coordinates();
    const std::size_t count =
        loops_.select(candidates_.coordinates(), candidates_.count(), position.data(), radius_, neighbors);
    Matrix3d frame;
    Matrix6d matrix;
    Vector6d right, quadric;
    if (count < min_neighbors || !tangent_frame(covariance_of(loops_, neighbors, count), frame))
      return std::nullopt;
    normal_equations(loops_, neighbors, count, frame, matrix, right);
    if (!solve(matrix, right, quadric)) return std::nullopt;
    const Vector3d normal = (frame * Vector3d(-quadric[1], -quadric[2], 1)).normalized();
    return Surface{normal, bending(quadric)};
  }

  const libmap::PointCloud& cloud_;
  CellSurroundings candidates_;
  double radius_;
  Vector3d up_;
  const NeighborLoops& loops_ = neighbor_loops_of(libmap::best_instruction_set());
  CoordinateRows neighbors_;
  // Last fit, shared by coincident points.
  bool is_fitted_ = false;
  Vector3d position_ = Vector3d::Zero();
  std::optional<Surface> surface_;
};

// Queries by cell of the grid, so that the surroundings of a cell are gathered once; coincident
// points are adjacent.
struct QueriesByCell {
  std::vector<std::size_t> queries;  // indices in the list of queries, by cell
  std::vector<std::size_t> begins;   // first query of each cell, and the end
};

QueriesByCell queries_by_cell(const PointGrid& grid, const std::vector<Vector3d>& positions,
                              const std::vector<std::size_t>& queries) {
  const std::size_t nowhere = grid.cells().size();
  std::vector<std::size_t> cell_of_point(positions.size(), nowhere);
  for (std::size_t c = 0; c < grid.cells().size(); ++c)
    for (std::uint32_t k = grid.ranges()[c].first; k < grid.ranges()[c].last; ++k)
      cell_of_point[grid.order()[k]] = c;
  QueriesByCell sorted;
  sorted.begins.assign(nowhere + 2, 0);
  for (const std::size_t query : queries) ++sorted.begins[cell_of_point[query] + 1];
  for (std::size_t c = 1; c < sorted.begins.size(); ++c) sorted.begins[c] += sorted.begins[c - 1];
  sorted.queries.resize(queries.size());
  std::vector<std::size_t> at = sorted.begins;
  for (std::size_t q = 0; q < queries.size(); ++q)
    sorted.queries[at[cell_of_point[queries[q]]]++] = q;
  const auto begin_of = [&](std::size_t c) {
    return sorted.queries.begin() + static_cast<std::ptrdiff_t>(sorted.begins[c]);
  };
  for (std::size_t c = 0; c < nowhere; ++c)
    std::sort(begin_of(c), begin_of(c + 1), [&](std::size_t a, std::size_t b) {
      return is_position_less(positions[queries[a]], positions[queries[b]]);
    });
  return sorted;
}

std::vector<Curvature> fit_quadrics(const libmap::PointCloud& cloud,
                                    const CurvatureOptions& options,
                                    const std::vector<std::size_t>& queries) {
  // Half the radius, slightly enlarged for rounding at the cell borders.
  const PointGrid grid(cloud.positions, options.radius_m * (0.5 + 1e-6));
  const std::vector<Vector3d> cell_sorted = sorted_by_cell(grid, cloud.positions);
  const QueriesByCell groups = queries_by_cell(grid, cloud.positions, queries);
  std::vector<Curvature> results(queries.size());
  libmap::parallel_for(grid.cells().size(), 16, [&](std::size_t begin, std::size_t end) {
    QuadricFitter fitter(cloud, grid, cell_sorted, options.radius_m, options.up);
    for (std::size_t c = begin; c < end; ++c) {
      if (groups.begins[c] == groups.begins[c + 1]) continue;
      fitter.enter(grid.cells()[c]);
      for (std::size_t n = groups.begins[c]; n < groups.begins[c + 1]; ++n)
        results[groups.queries[n]] = fitter.fit(queries[groups.queries[n]]);
    }
  });
  return results;
}

std::vector<std::size_t> checked_queries(const std::optional<std::vector<std::size_t>>& queries,
                                         std::size_t points) {
  std::vector<std::size_t> indices = queries.value_or(std::vector<std::size_t>(points));
  if (!queries) std::iota(indices.begin(), indices.end(), std::size_t{0});
  for (const std::size_t i : indices)
    if (i >= points)
      throw libmap::Error(
          "no such point",
          {.field = "query", .value = std::to_string(i), .bound = "< " + std::to_string(points)});
  return indices;
}

}  // namespace

CurvatureResult estimate_curvature(const libmap::PointCloud& cloud, const CurvatureOptions& options,
                                   const std::optional<std::vector<std::size_t>>& queries) {
  cloud.check();
  if (!(options.radius_m > 0) || std::isinf(options.radius_m))
    throw libmap::Error("out of range", {.field = "radius_m",
                                         .value = libmap::to_text(options.radius_m),
                                         .bound = "> 0 and finite"});
  if (!options.up.allFinite() || !(options.up.norm() > 0))
    throw libmap::Error("has length zero or is not finite", {.field = "up"});
  const std::vector<std::size_t> indices = checked_queries(queries, cloud.size());
  CurvatureResult result;
  result.method = options.method;
  result.radius_m = options.radius_m;
  result.points = options.method == CurvatureMethod::thesis
                      ? estimate_thesis_curvature(cloud, options.radius_m, indices)
                      : fit_quadrics(cloud, options, indices);
  result.valid_count = static_cast<std::size_t>(std::count_if(
      result.points.begin(), result.points.end(), [](const Curvature& c) { return c.valid; }));
  return result;
}

}  // namespace libgtd
