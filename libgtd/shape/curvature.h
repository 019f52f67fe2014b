// Principal curvatures at the points of a terrain, estimated within a radius ("Graspable Target
// Detection for Hexapod Robots", 2023, eq. 3-19).
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "libmap/core/point_cloud.h"

namespace libgtd {

// thesis: PCL's NormalEstimation and PrincipalCurvaturesEstimation, as in the author's program.
// Curvatures are eigenvalues of a covariance of projected normals: without unit and never negative,
// so that a bowl equals a ball. Normals face the origin of the frame.
// corrected: a quadric is fitted by least squares to the neighbors in the tangent frame of each
// point. Curvatures are signed, in 1/m, and normals face outside.
enum class CurvatureMethod { thesis, corrected };

struct CurvatureOptions {
  CurvatureMethod method = CurvatureMethod::corrected;
  double radius_m = 0.09;  // maximum distance of neighbors; for SCAR-E 0.09, HubRobo 0.03
  // Direction of the outside at points that have no normal in the cloud. Corrected only.
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
};

// Curvature at one point. If `valid` is false, all numbers are NaN: there are too few neighbors,
// the neighbors do not determine a quadric (on one or two lines, coincident), or the cloud has no
// normal at the point and the surface is parallel to `up`.
struct Curvature {
  static constexpr float nan = std::numeric_limits<float>::quiet_NaN();

  // k1 >= k2. Corrected: in 1/m, positive if the surface bends away from the outside: a ball of
  // radius r has +1/r, +1/r, a bowl -1/r, -1/r.
  float k1 = nan;
  float k2 = nan;
  Eigen::Vector3f normal = Eigen::Vector3f::Constant(nan);  // unit length, in the cloud's frame
  bool valid = false;
};

struct CurvatureResult {
  CurvatureMethod method = CurvatureMethod::corrected;
  double radius_m = 0;            // radius of the estimate
  std::vector<Curvature> points;  // one per query, in their order
  std::size_t valid_count = 0;    // number of points with `valid`
};

// Estimates the curvature at all points of the cloud, or at the points with indices `queries`. A
// result does not depend on the other queries or the number of threads. Points that are not finite
// are not used as neighbors. Throws Error for a radius that is not positive, an `up` of length
// zero, and an index out of range.
CurvatureResult estimate_curvature(
    const libmap::PointCloud& cloud, const CurvatureOptions& options = {},
    const std::optional<std::vector<std::size_t>>& queries = std::nullopt);

// CurvatureMethod::thesis at the points `queries`, without checks of indices and radius. Equal to
// the bit to the Point Cloud Library's NormalEstimation and PrincipalCurvaturesEstimation with
// search::KdTree. These compute in single precision, so that the order of sums matters: neighbors
// are ordered by distance, then by index.
std::vector<Curvature> estimate_thesis_curvature(const libmap::PointCloud& cloud, double radius_m,
                                                 const std::vector<std::size_t>& queries);

}  // namespace libgtd
