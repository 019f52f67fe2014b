#include "libmap/geometry/plane_fit.h"

#include "libmap/geometry/symmetric_eigen.h"

namespace libmap {

PlaneSpread spread_of(const PlaneMoments& moments, const Eigen::Vector3d& origin) {
  PlaneSpread spread;
  spread.center = origin;
  if (!(moments.weight > 0.0)) return spread;
  const Eigen::Vector3d mean = moments.first / moments.weight;
  const Eigen::Matrix3d covariance = moments.second / moments.weight - mean * mean.transpose();
  const SymmetricEigen<3> eigen = symmetric_eigen(covariance);
  spread.center += mean;
  spread.variances = eigen.values;
  spread.axes = eigen.vectors;
  return spread;
}

}  // namespace libmap
