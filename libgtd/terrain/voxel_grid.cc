#include "libgtd/terrain/voxel_grid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "libgtd/terrain/radix_sort.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/geometry/spatial_index.h"

namespace libgtd {

namespace {

void require_voxel_size(double voxel_size_m) {
  if (voxel_size_m > 0.0 && std::isfinite(voxel_size_m)) return;
  throw libmap::Error(
      "out of range",
      {.field = "voxel_size_m", .value = libmap::to_text(voxel_size_m), .bound = "> 0"});
}

// Checks that windows around indices and differences of indices fit an int.
template <typename Vector>
void require_room(const Vector& extent_in_voxels, double voxel_size_m) {
  const Eigen::Vector3d extent = extent_in_voxels.template cast<double>();
  if ((extent.cwiseAbs().array() < max_voxel_index).all()) return;
  const double gigabytes = (extent.cwiseAbs().array() + 1.0).prod() / 8.0 / 0x1p30;
  throw libmap::Error("too small for this cloud: the grid would take " +
                          libmap::to_text(static_cast<float>(gigabytes)) +
                          " GiB at one bit per voxel",
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

using Cell = std::array<int, 3>;
using Key = BoxKey<int>;

template <typename Range, typename CellOf>
Key box_key(const Range& items, const CellOf& cell_of) {
  Cell low = cell_of(items.front());
  Cell high = low;
  for (const auto& item : items) {
    const Cell cell = cell_of(item);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], cell[axis]);
      high[axis] = std::max(high[axis], cell[axis]);
    }
  }
  return {low, high};
}

void sort_and_unite(std::vector<Voxel>& voxels) {
  if (voxels.empty()) return;
  const auto cell_of = [](const Voxel& voxel) { return Cell{voxel.i, voxel.j, voxel.k}; };
  const Key key = box_key(voxels, cell_of);
  if (!key.fits()) {
    std::sort(voxels.begin(), voxels.end());
    voxels.erase(std::unique(voxels.begin(), voxels.end()), voxels.end());
    return;
  }
  std::vector<std::uint64_t> keys;
  keys.reserve(voxels.size());
  for (const Voxel& voxel : voxels) keys.push_back(key.of(cell_of(voxel)));
  radix_sort(keys, key.bits(), [](std::uint64_t one) { return one; });
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  voxels.resize(keys.size());
  for (std::size_t n = 0; n < keys.size(); ++n) {
    const Cell cell = key.cell(keys[n]);
    voxels[n] = {cell[0], cell[1], cell[2]};
  }
}

// Points sorted by cell, cells ascending, points within a cell in their original order.
struct SortedCells {
  std::vector<std::uint32_t> order;
  std::vector<std::size_t> begins;  // first entry of each cell in `order`, and the end
};

SortedCells sort_by_cell(const std::vector<Cell>& cells) {
  struct Item {
    std::uint64_t key;
    std::uint32_t index;
  };
  SortedCells sorted;
  const Key key = box_key(cells, [](const Cell& cell) { return cell; });
  std::vector<Item> items;
  items.reserve(cells.size());
  for (const Cell& cell : cells)
    items.push_back({key.of(cell), static_cast<std::uint32_t>(items.size())});
  const auto is_same = [&](std::uint32_t a, std::uint32_t b) { return cells[a] == cells[b]; };
  if (key.fits())
    radix_sort(items, key.bits(), [](const Item& item) { return item.key; });
  else
    std::stable_sort(items.begin(), items.end(),
                     [&](const Item& a, const Item& b) { return cells[a.index] < cells[b.index]; });
  for (const Item& item : items) {
    if (sorted.order.empty() || !is_same(sorted.order.back(), item.index))
      sorted.begins.push_back(sorted.order.size());
    sorted.order.push_back(item.index);
  }
  sorted.begins.push_back(sorted.order.size());
  return sorted;
}

constexpr std::array<const char*, 3> names = {"i", "j", "k"};

}  // namespace

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

libmap::PointCloud voxel_means(const libmap::PointCloud& terrain, double voxel_size_m) {
  libmap::PointCloud means;
  means.viewpoint = terrain.viewpoint;
  if (terrain.empty()) return means;
  require_voxel_size(voxel_size_m);
  const auto [low, high] = bounds_of(terrain.positions);
  require_room(Eigen::Vector3d(low / voxel_size_m), voxel_size_m);
  require_room(Eigen::Vector3d(high / voxel_size_m), voxel_size_m);
  const VoxelLattice lattice{.voxel_size_m = voxel_size_m};
  std::vector<Cell> cells;
  cells.reserve(terrain.size());
  for (const Eigen::Vector3d& position : terrain.positions) {
    const Voxel voxel = lattice.voxel_of(position);
    cells.push_back({voxel.i, voxel.j, voxel.k});
  }
  const SortedCells sorted = sort_by_cell(cells);
  for (std::size_t c = 0; c + 1 < sorted.begins.size(); ++c) {
    const std::size_t first = sorted.begins[c];
    const std::size_t last = sorted.begins[c + 1];
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    for (std::size_t n = first; n < last; ++n) {
      sum += terrain.positions[sorted.order[n]];
      if (terrain.has_normals()) normal += terrain.normals[sorted.order[n]];
    }
    means.positions.emplace_back(sum / static_cast<double>(last - first));
    if (terrain.has_normals()) means.normals.push_back(normal);
  }
  return means;
}

std::vector<Eigen::Vector3f> voxel_centroids(const std::vector<Eigen::Vector3f>& points,
                                             double leaf_m) {
  require_voxel_size(leaf_m);
  if (points.empty()) return {};
  const float inverse_leaf = 1.0F / static_cast<float>(leaf_m);
  const auto [low, high] = bounds_of(points);
  require_room(Eigen::Vector3f(low * inverse_leaf), leaf_m);
  require_room(Eigen::Vector3f(high * inverse_leaf), leaf_m);
  std::vector<Cell> cells;  // z, y, x
  cells.reserve(points.size());
  for (const Eigen::Vector3f& point : points)
    cells.push_back({floor_to<int>(point.z() * inverse_leaf),
                     floor_to<int>(point.y() * inverse_leaf),
                     floor_to<int>(point.x() * inverse_leaf)});
  const SortedCells sorted = sort_by_cell(cells);
  std::vector<Eigen::Vector3f> centroids;
  centroids.reserve(sorted.begins.size());
  for (std::size_t c = 0; c + 1 < sorted.begins.size(); ++c) {
    const std::size_t first = sorted.begins[c];
    const std::size_t last = sorted.begins[c + 1];
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    for (std::size_t n = first; n < last; ++n) sum += points[sorted.order[n]];
    centroids.push_back(sum / static_cast<float>(last - first));
  }
  return centroids;
}

VoxelGrid voxelize_thesis(const std::vector<Eigen::Vector3f>& points_in_terrain,
                          double voxel_size_m) {
  const std::vector<Eigen::Vector3f> centroids = voxel_centroids(points_in_terrain, voxel_size_m);
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

const std::vector<double>& values_of(const libmap::PointCloud& map, const char* name) {
  if (const libmap::ScalarField* field = map.find_field(name)) return field->values;
  throw libmap::Error("the map has no such field", {.field = name});
}

VoxelFields::VoxelFields(const libmap::PointCloud& map) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const libmap::ScalarField* field = map.find_field(names[axis]);
    if (field == nullptr)
      throw libmap::Error("no such field; a graspability map is required", {.field = names[axis]});
    values_[axis] = &field->values;
  }
}

int VoxelFields::index(std::size_t axis, std::size_t n) const {
  const double value = (*values_[axis])[n];
  if (!(std::abs(value) <= max_voxel_index) || value != std::floor(value))
    throw libmap::Error("not a voxel index", {.field = names[axis],
                                              .value = libmap::to_text(value),
                                              .bound = "an integer within +-2^29"});
  return static_cast<int>(value);
}

Voxel VoxelFields::at(std::size_t n) const { return {index(0, n), index(1, n), index(2, n)}; }

std::vector<Voxel> VoxelFields::all() const {
  std::vector<Voxel> voxels(values_[0]->size());
  for (std::size_t n = 0; n < voxels.size(); ++n) voxels[n] = at(n);
  return voxels;
}

std::size_t count_isolated(const std::vector<Voxel>& voxels) {
  std::vector<char> has_neighbor(voxels.size(), 0);
  visit_pairs(voxels, 1,
              [&](std::size_t n, std::size_t m) { has_neighbor[n] = has_neighbor[m] = 1; });
  return static_cast<std::size_t>(std::count(has_neighbor.begin(), has_neighbor.end(), 0));
}

void require_dense(std::size_t isolated, std::size_t voxels, double voxel_size_m,
                   const std::vector<Eigen::Vector3d>& points) {
  constexpr std::size_t min_voxels = 10;
  if (voxels < min_voxels || 5 * isolated <= 3 * voxels) return;
  throw libmap::Error(
      "the points are too sparse for this voxel size: interpolate (--interpolation), use larger "
      "voxels (--voxel-size), or sample the surface of a mesh (graspmap resample)",
      {.field = "share of voxels without a neighbor",
       .value = libmap::to_fixed_text(
                    100.0 * static_cast<double>(isolated) / static_cast<double>(voxels), 1) +
                " % (voxels of " + libmap::to_text(voxel_size_m) + " m, median point spacing " +
                libmap::to_fixed_text(1000.0 * libmap::median_spacing(points), 1) + " mm)",
       .bound = "<= 60 %"});
}

}  // namespace libgtd
