// Curvatures as the author's program computes them, with PCL; for curvature.cc alone.
#pragma once

#include <cstddef>
#include <vector>

#include "libgtd/shape/curvature.h"

namespace libgtd {

// CurvatureMethod::thesis at the points `queries`, whose indices and radius have been checked.
std::vector<Curvature> estimate_pcl_curvature(const libmap::PointCloud& cloud, double radius_m,
                                              const std::vector<std::size_t>& queries);

}  // namespace libgtd
