// How the terrain bends at its points: principal curvatures within a radius ("Graspable Target
// Detection for Hexapod Robots", 2023, eq. 3-19).
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "libmap/core/point_cloud.h"

namespace libgtd {

// thesis: PCL's NormalEstimation and PrincipalCurvaturesEstimation, as the author's program: the
// curvatures are eigenvalues of a covariance of projected normals, without unit, never negative, so
// that a bowl and a ball look alike; normals face the frame's origin.
// corrected: a quadric is fitted by least squares to the neighbors in each point's own tangent
// frame; curvatures are signed, in 1/m, and normals face outside.
enum class CurvatureMethod { thesis, corrected };

struct CurvatureOptions {
  CurvatureMethod method = CurvatureMethod::corrected;
  double radius_m = 0.09;  // neighbors lie at most this far off; 0.09 SCAR-E, 0.03 HubRobo
  // The outside where the cloud has no normal of its own for a point. Corrected only.
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
};

// Of one point. Where `valid` is false all numbers are NaN: too few neighbors, neighbors that fix
// no quadric (on a line, on two lines, all in one place), or a surface along `up` with no normal of
// its own, whose outside is not known.
struct Curvature {
  static constexpr float nan = std::numeric_limits<float>::quiet_NaN();

  // k1 >= k2. Corrected: in 1/m, positive where the surface bends away from the outside, so that a
  // ball of radius r has +1/r, +1/r, and a bowl -1/r, -1/r.
  float k1 = nan;
  float k2 = nan;
  Eigen::Vector3f normal = Eigen::Vector3f::Constant(nan);  // of unit length, in the cloud's frame
  bool valid = false;
};

struct CurvatureResult {
  CurvatureMethod method = CurvatureMethod::corrected;
  double radius_m = 0;            // as asked for
  std::vector<Curvature> points;  // one for each query
  std::size_t valid_count = 0;
};

// At all points of the cloud, or at those of the indices `queries`. The value at a point does not
// depend on which others are asked for, nor on the number of threads. Points that are not finite
// are nobody's neighbors. Throws Error for a radius that is not positive, for an `up` of no
// length, and for an index out of range.
CurvatureResult estimate_curvature(
    const libmap::PointCloud& cloud, const CurvatureOptions& options = {},
    const std::optional<std::vector<std::size_t>>& queries = std::nullopt);

// CurvatureMethod::thesis at the points `queries`, whose indices and radius have been checked: to
// the bit what the Point Cloud Library's NormalEstimation and PrincipalCurvaturesEstimation yield
// with its search::KdTree. They compute in single precision, so that the order of sums matters:
// neighbors come by distance, then by index.
std::vector<Curvature> estimate_thesis_curvature(const libmap::PointCloud& cloud, double radius_m,
                                                 const std::vector<std::size_t>& queries);

}  // namespace libgtd
