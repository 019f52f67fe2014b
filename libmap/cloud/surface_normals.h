// Normals of a cloud whose points lie close to a surface.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "libmap/core/point_cloud.h"

namespace libmap {

// Replaces each normal of `cloud`, of unit length, by that of the plane of weighted total least
// squares through the points within `radius_m` whose normals look the same way (within 45 degrees;
// Hoppe et al. 1992). `deviations_m` are the points' own standard deviations, one each; sides are
// kept. A point whose neighbors span no plane keeps its normal.
void fit_normals(PointCloud& cloud, double radius_m, const std::vector<double>& deviations_m);

}  // namespace libmap
