#include "libgtd/shape/point_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libgtd {

PointGrid::PointGrid(const std::vector<Eigen::Vector3d>& points, double cell_size_m)
    : cell_size_m_(cell_size_m) {
  if (!(cell_size_m > 0) || std::isinf(cell_size_m))
    throw libmap::Error("not a length",
                        {.value = libmap::to_text(cell_size_m), .bound = "> 0 and finite"});
  if (points.size() > std::numeric_limits<std::uint32_t>::max())
    throw libmap::Error("too many points for one search grid");
  far_ = Eigen::Vector3d::Constant(-std::numeric_limits<double>::infinity());
  origin_ = -far_;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite()) continue;
    order_.push_back(static_cast<std::uint32_t>(i));
    origin_ = origin_.cwiseMin(points[i]);
    far_ = far_.cwiseMax(points[i]);
  }
  if (order_.empty()) return;
  const double extent = (far_ - origin_).maxCoeff();
  if (!(extent / cell_size_m <= 0x1.0p40))
    throw libmap::Error("the points lie too far apart for a search radius this small",
                        {.value = libmap::to_text(cell_size_m) + " m cells over " +
                                  libmap::to_text(extent) + " m"});

  std::vector<Cell> cell_of_point(points.size());
  for (const std::uint32_t i : order_) cell_of_point[i] = cell_of(points[i]);
  std::sort(order_.begin(), order_.end(), [&](std::uint32_t a, std::uint32_t b) {
    return cell_of_point[a] != cell_of_point[b] ? cell_of_point[a] < cell_of_point[b] : a < b;
  });
  for (std::uint32_t k = 0; k < order_.size(); ++k) {
    const Cell& cell = cell_of_point[order_[k]];
    if (cells_.empty() || cells_.back() != cell) {
      cells_.push_back(cell);
      ranges_.push_back({k, k});
    }
    ++ranges_.back().last;
  }
  range_of_.reserve(2 * cells_.size());
  for (std::size_t c = 0; c < cells_.size(); ++c) range_of_.emplace(cells_[c], ranges_[c]);
}

bool PointGrid::reaches(const Eigen::Vector3d& place) const {
  return (place.array() >= origin_.array() - cell_size_m_).all() &&
         (place.array() <= far_.array() + cell_size_m_).all();
}

PointGrid::Cell PointGrid::cell_of(const Eigen::Vector3d& place) const {
  Cell cell;
  for (int a = 0; a < 3; ++a)
    cell[static_cast<std::size_t>(a)] =
        static_cast<std::int64_t>(std::floor((place[a] - origin_[a]) / cell_size_m_));
  return cell;
}

PointGrid::Range PointGrid::range_of(const Cell& cell) const {
  const auto found = range_of_.find(cell);
  return found == range_of_.end() ? Range{} : found->second;
}

std::size_t PointGrid::Hash::operator()(const Cell& cell) const {
  std::uint64_t hash = 0;
  for (const std::int64_t c : cell) {
    hash = (hash ^ static_cast<std::uint64_t>(c)) * 0x9e3779b97f4a7c15u;
    hash ^= hash >> 29;
  }
  return static_cast<std::size_t>(hash);
}

}  // namespace libgtd
