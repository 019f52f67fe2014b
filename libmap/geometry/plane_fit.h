// Fits planes to weighted points by principal axes; the inner step of robust plane fits.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "libmap/core/parallel.h"

namespace libmap {

// Weighted sums over the offsets of points, m, from an origin near the points.
struct PlaneMoments {
  double weight = 0.0;                               // sum of the weights
  Eigen::Vector3d first = Eigen::Vector3d::Zero();   // sum of weight * offset
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();  // sum of weight * offset * offset^T

  void add(const Eigen::Vector3d& offset, double w) {
    weight += w;
    first += w * offset;
    second += w * offset * offset.transpose();
  }
  PlaneMoments& operator+=(const PlaneMoments& other) {
    weight += other.weight;
    first += other.first;
    second += other.second;
    return *this;
  }
};

// Principal axes of weighted points. The first axis is the plane normal, of either sign.
struct PlaneSpread {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();     // weighted mean, m
  Eigen::Vector3d variances = Eigen::Vector3d::Zero();  // along the axes, m2, ascending
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();   // unit vectors in columns

  // False if all points coincide, or if the second variance is at most `min_ratio` times the
  // largest variance: points on a line have no plane.
  bool is_plane(double min_ratio) const {
    return variances[1] > min_ratio * variances[2] && variances[2] > 0.0;
  }
};

// Returns the principal axes of accumulated moments. If the total weight is 0, the center is
// `origin` and the variances are 0.
PlaneSpread spread_of(const PlaneMoments& moments, const Eigen::Vector3d& origin);

// Returns the principal axes of the points with weights weight(point); points with weights <= 0 are
// skipped. The result does not depend on the number of threads.
template <typename Weight>
PlaneSpread weighted_spread(const std::vector<Eigen::Vector3d>& points,
                            const Eigen::Vector3d& origin, std::size_t points_per_chunk,
                            const Weight& weight) {
  return spread_of(parallel_reduce(
                       points.size(), points_per_chunk, PlaneMoments{},
                       [&](std::size_t begin, std::size_t end) {
                         PlaneMoments part;
                         for (std::size_t n = begin; n < end; ++n) {
                           const double w = weight(points[n]);
                           if (w > 0.0) part.add(points[n] - origin, w);
                         }
                         return part;
                       },
                       [](PlaneMoments a, const PlaneMoments& b) { return a += b; }),
                   origin);
}

}  // namespace libmap
