#include "libgtd/shape/point_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "libgtd/terrain/radix_sort.h"
#include "libgtd/terrain/voxel_lattice.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libgtd {

PointGrid::PointGrid(const std::vector<Eigen::Vector3d>& points, double cell_size_m)
    : cell_size_m_(cell_size_m) {
  if (!(cell_size_m > 0) || std::isinf(cell_size_m))
    throw libmap::Error("out of range", {.field = "cell size, m",
                                         .value = libmap::to_text(cell_size_m),
                                         .bound = "> 0 and finite"});
  if (points.size() > std::numeric_limits<std::uint32_t>::max())
    throw libmap::Error("the cloud has too many points (limit: 2^32)");
  high_ = Eigen::Vector3d::Constant(-std::numeric_limits<double>::infinity());
  low_ = -high_;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite()) continue;
    order_.push_back(static_cast<std::uint32_t>(i));
    low_ = low_.cwiseMin(points[i]);
    high_ = high_.cwiseMax(points[i]);
  }
  if (order_.empty()) return;
  const double extent = low_.cwiseAbs().cwiseMax(high_.cwiseAbs()).maxCoeff();
  if (!(extent / cell_size_m <= 0x1.0p40))
    throw libmap::Error(
        "too small for points up to " + libmap::to_text(extent) + " m from the origin",
        {.field = "cell size, m", .value = libmap::to_text(cell_size_m)});

  sort_by_cell(points);
}

void PointGrid::sort_by_cell(const std::vector<Eigen::Vector3d>& points) {
  struct Item {
    std::uint64_t key;
    std::uint32_t index;
  };
  std::vector<Cell> cell_of_point(points.size());
  for (const std::uint32_t i : order_) cell_of_point[i] = cell_of(points[i]);
  const BoxKey<std::int64_t> key(cell_of(low_), cell_of(high_));
  if (key.fits()) {
    std::vector<Item> items;
    items.reserve(order_.size());
    for (const std::uint32_t i : order_) items.push_back({key.of(cell_of_point[i]), i});
    radix_sort(items, key.bits(), [](const Item& item) { return item.key; });
    for (std::size_t k = 0; k < items.size(); ++k) order_[k] = items[k].index;
  } else {
    std::stable_sort(order_.begin(), order_.end(), [&](std::uint32_t a, std::uint32_t b) {
      return cell_of_point[a] < cell_of_point[b];
    });
  }
  for (std::uint32_t k = 0; k < order_.size(); ++k) {
    const Cell& cell = cell_of_point[order_[k]];
    const bool is_first = cells_.empty();
    const bool is_row = is_first || cells_.back()[0] != cell[0];
    const bool is_column = is_row || cells_.back()[1] != cell[1];
    if (is_row) rows_.push_back({cell[0], columns_.size()});
    if (is_column) columns_.push_back({cell[1], cells_.size()});
    if (is_column || cells_.back()[2] != cell[2]) {
      cells_.push_back(cell);
      ranges_.push_back({k, k});
    }
    ++ranges_.back().last;
  }
  rows_.push_back({0, columns_.size()});
  columns_.push_back({0, cells_.size()});
}

bool PointGrid::reaches(const Eigen::Vector3d& position) const {
  return (position.array() >= low_.array() - cell_size_m_).all() &&
         (position.array() <= high_.array() + cell_size_m_).all();
}

PointGrid::Cell PointGrid::cell_of(const Eigen::Vector3d& position) const {
  Cell cell;
  for (int a = 0; a < 3; ++a)
    cell[static_cast<std::size_t>(a)] = floor_to<std::int64_t>(position[a] / cell_size_m_);
  return cell;
}

void PointGrid::find_near(const Cell& cell, std::int64_t reach, std::vector<Range>& runs) const {
  runs.clear();
  if (cells_.empty()) return;
  const auto last_row = rows_.end() - 1;
  auto row = std::lower_bound(rows_.begin(), last_row, cell[0] - reach,
                              [](const Row& one, std::int64_t x) { return one.x < x; });
  for (; row != last_row && row->x <= cell[0] + reach; ++row) {
    const auto at = [&](std::size_t n) {
      return columns_.begin() + static_cast<std::ptrdiff_t>(n);
    };
    const auto last_column = at((row + 1)->first_column);
    auto column = std::lower_bound(at(row->first_column), last_column, cell[1] - reach,
                                   [](const Column& one, std::int64_t y) { return one.y < y; });
    for (; column != last_column && column->y <= cell[1] + reach; ++column) {
      // First of the cells of a column from z on.
      const auto first_from = [&](std::int64_t z) {
        const auto begin = cells_.begin();
        return static_cast<std::size_t>(
            std::lower_bound(begin + static_cast<std::ptrdiff_t>(column->first_cell),
                             begin + static_cast<std::ptrdiff_t>((column + 1)->first_cell), z,
                             [](const Cell& one, std::int64_t low) { return one[2] < low; }) -
            begin);
      };
      const std::size_t first = first_from(cell[2] - reach);
      const std::size_t last = first_from(cell[2] + reach + 1);
      if (first < last) runs.push_back({ranges_[first].first, ranges_[last - 1].last});
    }
  }
}

void CoordinateRows::make_room(std::size_t count) {
  constexpr std::size_t lanes = NeighborLoops::lanes;
  if (stride_ >= count + lanes) return;
  stride_ = 2 * (count + lanes);
  values_.resize(3 * stride_);
}

std::vector<Eigen::Vector3d> sorted_by_cell(const PointGrid& grid,
                                            const std::vector<Eigen::Vector3d>& points) {
  std::vector<Eigen::Vector3d> cell_sorted;
  cell_sorted.reserve(grid.order().size());
  for (const std::uint32_t i : grid.order()) cell_sorted.push_back(points[i]);
  return cell_sorted;
}

void CellSurroundings::enter(const PointGrid::Cell& cell, std::int64_t reach) {
  grid_.find_near(cell, reach, runs_);
  run_ends_.clear();
  count_ = 0;
  for (const PointGrid::Range& run : runs_) run_ends_.push_back(count_ += run.last - run.first);
  rows_.make_room(count_);
  const NeighborLoops::Coordinates to = rows_.coordinates();
  std::size_t n = 0;
  const auto put = [&](const Eigen::Vector3d& p) {
    to.x[n] = p.x();
    to.y[n] = p.y();
    to.z[n++] = p.z();
  };
  for (const PointGrid::Range& run : runs_)
    for (std::uint32_t k = run.first; k < run.last; ++k) put(cell_sorted_[k]);
  for (std::size_t k = 0; k < NeighborLoops::lanes; ++k)
    put(Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity()));
}

Eigen::Matrix3d covariance_of(const NeighborLoops& loops,
                              const NeighborLoops::Coordinates& neighbors, std::size_t count) {
  std::array<double, NeighborLoops::moments> m;
  loops.sum_moments(neighbors, count, m.data());
  for (double& sum : m) sum /= static_cast<double>(count);
  const Eigen::Vector3d mean(m[0], m[1], m[2]);
  Eigen::Matrix3d second;
  second << m[3], m[4], m[5], m[4], m[6], m[7], m[5], m[7], m[8];
  return second - mean * mean.transpose();
}

}  // namespace libgtd
