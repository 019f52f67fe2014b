#include "libmap/simulate/ground_heights.h"

#include <cmath>

namespace libmap {

GroundHeights::CellIndex GroundHeights::index_of(const Eigen::Vector2d& position) {
  return {static_cast<std::int64_t>(std::floor(position.x() / cell_m)),
          static_cast<std::int64_t>(std::floor(position.y() / cell_m))};
}

void GroundHeights::add(std::span<const Eigen::Vector3d> points) {
  Cell* cell = nullptr;
  CellIndex last;
  for (const Eigen::Vector3d& point : points) {
    const CellIndex index = index_of(point.head<2>());
    if (cell == nullptr || index != last) cell = &cells_[index];
    last = index;
    ++cell->points;
    cell->sum += point.z();
    cell->box.extend(point);
    box_.extend(Eigen::Vector2d(point.head<2>()));
  }
}

double GroundHeights::height(const Eigen::Vector2d& position) const {
  constexpr std::int64_t reach = 3;
  const auto mean = [](const Cell& cell) { return cell.sum / static_cast<double>(cell.points); };
  double sum = 0.0;
  double weights = 0.0;
  const auto [column, row] = index_of(position);
  for (std::int64_t i = column - reach; i <= column + reach; ++i)
    for (std::int64_t j = row - reach; j <= row + reach; ++j) {
      const auto cell = cells_.find({i, j});
      if (cell == cells_.end()) continue;
      const Eigen::Vector2d apart =
          Eigen::Vector2d(static_cast<double>(i) + 0.5, static_cast<double>(j) + 0.5) -
          position / cell_m;
      const double weight = std::exp(-0.5 * apart.squaredNorm());
      sum += weight * mean(cell->second);
      weights += weight;
    }
  if (weights > 0.0) return sum / weights;
  for (const auto& [index, cell] : cells_) sum += mean(cell);
  return cells_.empty() ? 0.0 : sum / static_cast<double>(cells_.size());
}

double GroundHeights::spacing_m() const {
  double points = 0.0;
  for (const auto& [index, cell] : cells_) points += static_cast<double>(cell.points);
  return points > 0.0 ? cell_m * std::sqrt(static_cast<double>(cells_.size()) / points) : 0.0;
}

Eigen::AlignedBox3d GroundHeights::extent(const Eigen::AlignedBox2d& rectangle) const {
  Eigen::AlignedBox3d extent;
  const CellIndex first = index_of(rectangle.min());
  const CellIndex last = index_of(rectangle.max());
  for (std::int64_t i = first.first; i <= last.first; ++i)
    for (auto cell = cells_.lower_bound({i, first.second});
         cell != cells_.end() && cell->first <= CellIndex(i, last.second); ++cell)
      extent.extend(cell->second.box);
  return extent;
}

}  // namespace libmap
