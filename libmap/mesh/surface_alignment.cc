#include "libmap/mesh/surface_alignment.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/median.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"
#include "libmap/geometry/least_squares.h"
#include "libmap/geometry/rigid_motion.h"
#include "libmap/geometry/robust.h"
#include "libmap/geometry/symmetric_eigen.h"

namespace libmap {

void bind(ParameterTable& table, SurfaceAlignmentOptions& options) {
  table.add("icp_max_distance_m", options.max_distance_m, positive,
            "maximum distance between the surface and the points that ICP uses, m");
  table.add("icp_min_overlap", options.min_overlap, zero_to_one,
            "minimum share of points that overlap the surface; with fewer, the alignment fails");
  table.add("icp_max_iterations", options.max_iterations, {1.0, 1e6},
            "maximum number of ICP iterations");
  table.add(
      "icp_tolerance_m", options.tolerance_m, positive,
      "root mean square displacement of the points per step below which ICP has converged, m");
  table.add("icp_max_points", options.max_points, {6.0, 1e8},
            "maximum number of points used by ICP");
  table.add("icp_min_curvature", options.min_curvature, zero_to_one,
            "minimum eigenvalue of the ICP information matrix, relative to the largest; ICP does "
            "not move points along eigenvectors with smaller eigenvalues");
}

namespace {

constexpr std::size_t distances_per_chunk = 512;

std::vector<Eigen::Vector3d> downsampled(const std::vector<Eigen::Vector3d>& points, int most) {
  const std::size_t count = std::min(points.size(), static_cast<std::size_t>(most));
  std::vector<Eigen::Vector3d> part;
  part.reserve(count);
  for (std::size_t n = 0; n < count; ++n) part.push_back(points[n * points.size() / count]);
  return part;
}

struct Pair {
  Eigen::Vector3d point;  // moved
  NearestSurfacePoint nearest;
  double weight = 0.0;
};

// Pairs of points that overlap the surface and their nearest points. Throws Error if too few.
std::vector<Pair> pairs_of(const std::vector<Eigen::Vector3d>& points, const Pose& moved,
                           const ReferenceSurface& surface,
                           const SurfaceAlignmentOptions& options) {
  std::vector<Pair> pairs(points.size());
  parallel_each(points.size(), distances_per_chunk, [&](std::size_t n) {
    pairs[n].point = moved * points[n];
    pairs[n].nearest = surface.nearest(pairs[n].point);
  });
  std::erase_if(pairs, [&](const Pair& pair) {
    return pair.nearest.on_border || !(pair.nearest.distance_m <= options.max_distance_m);
  });
  const double fraction = static_cast<double>(pairs.size()) / static_cast<double>(points.size());
  if (pairs.size() < 6 || fraction < options.min_overlap)
    throw Error("too few points are near the surface for an alignment",
                {.field = "share of points within " +
                          to_text(static_cast<float>(options.max_distance_m)) + " m of the surface",
                 .value = to_fixed_text(100.0 * fraction, 1) + " %",
                 .bound = ">= " + to_fixed_text(100.0 * options.min_overlap, 1) +
                          " % and at least 6 points"});
  return pairs;
}

// Sets the weights by Tukey's biweight, with the normalized median absolute deviation as scale.
// Returns the number of pairs with a weight above 0.
std::size_t weigh(std::vector<Pair>& pairs, double floor_m) {
  std::vector<double> distances;
  distances.reserve(pairs.size());
  for (const Pair& pair : pairs) distances.push_back(pair.nearest.distance_m);
  const double reach = std::max(floor_m, tukey_width_of(median(std::move(distances))));
  std::size_t inliers = 0;
  for (Pair& pair : pairs) {
    pair.weight = tukey_weight(pair.nearest.distance_m / reach);
    if (pair.weight > 0.0) ++inliers;
  }
  return inliers;
}

// Normal equations of six motions in meters. A rotation is about `center`, by an angle times
// `radius_m`, which is the distance that it moves the points.
struct CenteredEquations : NormalEquations<6> {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double radius_m = 0.0;
};

CenteredEquations equations_of(const std::vector<Pair>& pairs) {
  CenteredEquations equations;
  double weights = 0.0;
  for (const Pair& pair : pairs) {
    equations.center += pair.weight * pair.point;
    weights += pair.weight;
  }
  equations.center /= weights;
  double squares = 0.0;
  for (const Pair& pair : pairs)
    squares += pair.weight * (pair.point - equations.center).squaredNorm();
  equations.radius_m = std::sqrt(squares / weights);
  if (!(equations.radius_m > 0.0)) equations.radius_m = 1.0;
  for (const Pair& pair : pairs) {
    const Eigen::Vector3d& normal = pair.nearest.normal;
    Vector6d row;
    row << (pair.point - equations.center).cross(normal) / equations.radius_m, normal;
    const double residual = (pair.nearest.position - pair.point).dot(normal);
    equations.matrix += pair.weight / weights * row * row.transpose();
    equations.rhs += pair.weight / weights * residual * row;
  }
  return equations;
}

struct Step {
  Pose motion = Pose::Identity();
  double length_m = 0.0;
  int free_motions = 0;
  double curvature = 1.0;
};

Step solve(const CenteredEquations& equations, double min_curvature) {
  const SymmetricEigen<6> eigen = symmetric_eigen(equations.matrix);
  const double greatest = eigen.values[5];
  Step step;
  Vector6d motion = Vector6d::Zero();
  for (Eigen::Index n = 5; n >= 0; --n) {
    const double curvature = eigen.values[n] / greatest;
    // Rounding produces curvatures of about 1e-16 instead of 0.
    if (!(curvature >= std::max(min_curvature, 1e-13))) {
      ++step.free_motions;
      continue;
    }
    step.curvature = curvature;
    const Vector6d direction = eigen.vectors.col(n);
    motion += direction.dot(equations.rhs) / eigen.values[n] * direction;
  }
  const Eigen::Vector3d turn = motion.head<3>() / equations.radius_m;
  step.length_m = motion.norm();
  if (turn.norm() > 0.0)
    step.motion.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  step.motion.translation() =
      equations.center + motion.tail<3>() - step.motion.linear() * equations.center;
  return step;
}

double rmse_of(const std::vector<Pair>& pairs) {
  double squares = 0.0;
  std::size_t count = 0;
  for (const Pair& pair : pairs) {
    if (pair.weight <= 0.0) continue;
    squares += pair.nearest.distance_m * pair.nearest.distance_m;
    ++count;
  }
  return count == 0 ? 0.0 : std::sqrt(squares / static_cast<double>(count));
}

}  // namespace

SurfaceAlignmentResult align_to_surface(const std::vector<Eigen::Vector3d>& points,
                                        const ReferenceSurface& surface,
                                        const SurfaceAlignmentOptions& options) {
  check_parameters(options);
  if (!surface.is_oriented())
    throw Error("alignment requires them at all points of the cloud", {.field = "normals"});
  if (points.size() < 6)
    throw Error("too few points to align",
                {.field = "points", .value = std::to_string(points.size()), .bound = ">= 6"});
  for (const Eigen::Vector3d& point : points)
    if (!point.allFinite()) throw Error("one is not finite", {.field = "points"});
  const std::vector<Eigen::Vector3d> used = downsampled(points, options.max_points);
  // Smaller distances are rounding errors.
  const double floor_m = 1e-9 * (surface.bounds().max - surface.bounds().min).norm();
  SurfaceAlignmentResult result;
  result.points = used.size();
  std::vector<Pair> pairs;
  const auto find_pairs = [&] {
    pairs = pairs_of(used, result.surface_from_points, surface, options);
    result.overlap = pairs.size();
    result.inliers = weigh(pairs, floor_m);
    result.rmse_m = rmse_of(pairs);
  };
  find_pairs();
  const GaussNewtonSummary summary = gauss_newton(options.max_iterations, [&] {
    const Step step = solve(equations_of(pairs), options.min_curvature);
    result.surface_from_points = step.motion * result.surface_from_points;
    result.surface_from_points.linear() = nearest_rotation(result.surface_from_points.linear());
    result.free_motions = step.free_motions;
    result.curvature = step.curvature;
    find_pairs();
    return step.length_m <= options.tolerance_m ? StepState::converged : StepState::moving;
  });
  result.iterations = summary.iterations;
  result.converged = summary.state == StepState::converged;
  return result;
}

}  // namespace libmap
