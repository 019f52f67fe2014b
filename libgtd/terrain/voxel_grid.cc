#include "libgtd/terrain/voxel_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>

#include "libmap/core/error.h"
#include "libmap/core/text.h"

namespace libgtd {

namespace {

void require_voxel_size(double voxel_size_m) {
  if (voxel_size_m > 0.0 && std::isfinite(voxel_size_m)) return;
  throw libmap::Error(
      "out of range",
      {.field = "voxel_size_m", .value = libmap::to_text(voxel_size_m), .bound = "> 0"});
}

// Indices must leave room for windows around them, and their differences must fit an int.
template <typename Vector>
void require_room(const Vector& extent_in_voxels, double voxel_size_m) {
  const Eigen::Vector3d extent = extent_in_voxels.template cast<double>();
  if (extent.cwiseAbs().maxCoeff() < 0x1p29) return;
  const double gigabytes = (extent.cwiseAbs().array() + 1.0).prod() / 8.0 / 0x1p30;
  throw libmap::Error("too small for this cloud: the grid would take " +
                          libmap::to_text(static_cast<float>(gigabytes)) + " GiB at a bit a voxel",
                      {.field = "voxel_size_m", .value = libmap::to_text(voxel_size_m)});
}

template <typename Vector>
std::pair<Vector, Vector> bounds_of(const std::vector<Vector>& points) {
  std::pair<Vector, Vector> bounds{points.front(), points.front()};
  for (const Vector& point : points) {
    bounds.first = bounds.first.cwiseMin(point);
    bounds.second = bounds.second.cwiseMax(point);
  }
  return bounds;
}

void sort_and_unite(std::vector<Voxel>& voxels) {
  std::sort(voxels.begin(), voxels.end());
  voxels.erase(std::unique(voxels.begin(), voxels.end()), voxels.end());
}

}  // namespace

double VoxelGrid::cells_in_box() const {
  return (1.0 + max.i - min.i) * (1.0 + max.j - min.j) * (1.0 + max.k - min.k);
}

VoxelGrid voxelize(const std::vector<Eigen::Vector3d>& points_in_terrain, double voxel_size_m) {
  require_voxel_size(voxel_size_m);
  VoxelGrid grid;
  grid.lattice.voxel_size_m = voxel_size_m;
  if (points_in_terrain.empty()) return grid;
  const auto [low, high] = bounds_of(points_in_terrain);
  require_room(Eigen::Vector3d(low / voxel_size_m), voxel_size_m);
  require_room(Eigen::Vector3d(high / voxel_size_m), voxel_size_m);
  grid.voxels.reserve(points_in_terrain.size());
  for (const Eigen::Vector3d& point : points_in_terrain)
    grid.voxels.push_back(grid.lattice.voxel_of(point));
  sort_and_unite(grid.voxels);
  grid.min = grid.lattice.voxel_of(low);
  grid.max = grid.lattice.voxel_of(high);
  return grid;
}

std::vector<Eigen::Vector3f> thin_to_centroids(const std::vector<Eigen::Vector3f>& points,
                                               double leaf_m) {
  require_voxel_size(leaf_m);
  if (points.empty()) return {};
  const float inverse_leaf = 1.0F / static_cast<float>(leaf_m);
  const auto [low, high] = bounds_of(points);
  require_room(Eigen::Vector3f(low * inverse_leaf), leaf_m);
  require_room(Eigen::Vector3f(high * inverse_leaf), leaf_m);
  using Cell = std::array<int, 3>;  // z, y, x
  std::vector<Cell> cells;
  cells.reserve(points.size());
  for (const Eigen::Vector3f& point : points)
    cells.push_back({static_cast<int>(std::floor(point.z() * inverse_leaf)),
                     static_cast<int>(std::floor(point.y() * inverse_leaf)),
                     static_cast<int>(std::floor(point.x() * inverse_leaf))});
  std::vector<std::uint32_t> order(points.size());
  std::iota(order.begin(), order.end(), 0U);
  // Stable: points of a cell are added up in the order of the cloud.
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return cells[a] < cells[b]; });
  std::vector<Eigen::Vector3f> centroids;
  for (std::size_t first = 0; first < order.size();) {
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    std::size_t last = first;
    for (; last < order.size() && cells[order[last]] == cells[order[first]]; ++last)
      sum += points[order[last]];
    centroids.push_back(sum / static_cast<float>(last - first));
    first = last;
  }
  return centroids;
}

VoxelGrid voxelize_thesis(const std::vector<Eigen::Vector3f>& points_in_terrain,
                          double voxel_size_m) {
  const std::vector<Eigen::Vector3f> centroids = thin_to_centroids(points_in_terrain, voxel_size_m);
  VoxelGrid grid;
  grid.lattice.voxel_size_m = voxel_size_m;
  if (centroids.empty()) return grid;
  const auto [low, high] = bounds_of(points_in_terrain);
  const ThesisLattice lattice{low, static_cast<float>(voxel_size_m)};
  require_room(Eigen::Vector3f((high - low) / lattice.voxel_size_m), voxel_size_m);
  for (const Eigen::Vector3f& centroid : centroids)
    grid.voxels.push_back(lattice.voxel_of(centroid));
  sort_and_unite(grid.voxels);
  grid.lattice = lattice.lattice();
  const Voxel size = lattice.size_to(high);
  grid.max = {size.i - 1, size.j - 1, size.k - 1};
  return grid;
}

}  // namespace libgtd
