// Curvatures as the author's program computes them; for curvature.cc alone.
#pragma once

#include <cstddef>
#include <vector>

#include "libgtd/shape/curvature.h"

namespace libgtd {

// CurvatureMethod::thesis at the points `queries`, whose indices and radius have been checked: to
// the bit what the Point Cloud Library's NormalEstimation and PrincipalCurvaturesEstimation yield
// with its search::KdTree. They compute in single precision, so that the order of sums matters:
// neighbors come by distance, then by index.
std::vector<Curvature> estimate_thesis_curvature(const libmap::PointCloud& cloud, double radius_m,
                                                 const std::vector<std::size_t>& queries);

}  // namespace libgtd
