#include "libgtd/shape/cell_surroundings.h"

#include <array>
#include <limits>

namespace libgtd {

void CoordinateRows::make_room(std::size_t count) {
  constexpr std::size_t lanes = NeighborLoops::lanes;
  if (stride_ >= count + lanes) return;
  stride_ = 2 * (count + lanes);
  values_.resize(3 * stride_);
}

std::vector<Eigen::Vector3d> in_order_of(const PointGrid& grid,
                                         const std::vector<Eigen::Vector3d>& points) {
  std::vector<Eigen::Vector3d> in_order;
  in_order.reserve(grid.order().size());
  for (const std::uint32_t i : grid.order()) in_order.push_back(points[i]);
  return in_order;
}

void CellSurroundings::enter(const PointGrid::Cell& cell, std::int64_t reach) {
  grid_.find_near(cell, reach, runs_);
  run_ends_.clear();
  count_ = 0;
  for (const PointGrid::Range& run : runs_) run_ends_.push_back(count_ += run.last - run.first);
  rows_.make_room(count_);
  const NeighborLoops::Places to = rows_.places();
  std::size_t n = 0;
  const auto put = [&](const Eigen::Vector3d& p) {
    to.x[n] = p.x();
    to.y[n] = p.y();
    to.z[n++] = p.z();
  };
  for (const PointGrid::Range& run : runs_)
    for (std::uint32_t k = run.first; k < run.last; ++k) put(in_order_[k]);
  for (std::size_t k = 0; k < NeighborLoops::lanes; ++k)
    put(Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity()));
}

Eigen::Matrix3d covariance_of(const NeighborLoops& loops, const NeighborLoops::Places& neighbors,
                              std::size_t count) {
  std::array<double, NeighborLoops::moments> m;
  loops.sum_moments(neighbors, count, m.data());
  for (double& sum : m) sum /= static_cast<double>(count);
  const Eigen::Vector3d mean(m[0], m[1], m[2]);
  Eigen::Matrix3d second;
  second << m[3], m[4], m[5], m[4], m[6], m[7], m[5], m[7], m[8];
  return second - mean * mean.transpose();
}

}  // namespace libgtd
