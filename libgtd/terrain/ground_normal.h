// The normal of the ground under rocks, which a least-squares plane tilts toward.
#pragma once

#include <Eigen/Core>

#include "libmap/core/point_stream.h"

namespace libgtd {

// A plane through `centroid`, such as the least-squares plane of the points.
struct FittedPlane {
  Eigen::Vector3d centroid;  // m
  Eigen::Matrix3d axes;      // columns: unit normal, then two unit vectors in the plane
  double extent_m = 0.0;     // > 0: standard deviation of the points along the last axis
};

// Unit normal of the plane that most of the surface follows, on the side of the first column of
// `start.axes`, at most 45 degrees from it. The points are replaced by one mean per cube of
// extent_m / 70 (about 1/250 of the terrain's width), so that parts of the surface that were
// scanned more densely have no more weight. The least median of squares of 500 planes (Rousseeuw
// 1984) is refined by reweighted least squares with Tukey's biweight (Beaton and Tukey 1974)
// of 4.685 standard deviations. Equals the start's normal if its median distance is not at least
// twice that of the plane found: such a terrain has no level ground. Points that are not finite are
// skipped. The same for points in one or in many blocks, to the bit.
Eigen::Vector3d ground_normal(const libmap::PointStream& points, const FittedPlane& start);

}  // namespace libgtd
