#include "libgtd/score/tilted_matching.h"

#include <algorithm>
#include <cmath>

#include "libgtd/score/matching_loops.h"
#include "libgtd/score/voxel_matching.h"
#include "libgtd/shape/point_grid.h"
#include "libmap/core/parallel.h"

namespace libgtd {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Distance from the center of the pivot to the farthest corner of a window, in voxels.
double matched_reach(const GripperMask& mask) {
  const double across = 0.5 + std::max(mask.pivot_xy, mask.side - mask.pivot_xy - 1);
  const double along = 0.5 + std::max(mask.pivot_z, mask.layers - mask.pivot_z - 1);
  return std::sqrt(2.0 * across * across + along * along);
}

// Half the side of the cube that find_border_pivots searches, in voxels.
int edge_half_side(const GripperMask& mask) {
  return std::max(mask.pivot_xy, mask.side - mask.pivot_xy - 1) + 2 * scan_gap_voxels;
}
double edge_reach(const GripperMask& mask) { return std::sqrt(3.0) * (edge_half_side(mask) + 0.5); }

double grid_cell_m(const VoxelLattice& lattice, const GripperMask& mask) {
  // A quarter of the reach, slightly enlarged for rounding at the cell borders.
  return lattice.voxel_size_m * matched_reach(mask) * (0.25 + 1e-6);
}

TiltedLattice lattice_of(const TiltedPivot& pivot, const VoxelLattice& terrain) {
  const Vector3d origin = terrain.cell_of(pivot.anchor_m);
  const Matrix3d axes = tilted_axes(pivot.normal);
  TiltedLattice lattice{};
  for (int a = 0; a < 3; ++a) {
    lattice.origin[a] = origin[a];
    for (int b = 0; b < 3; ++b) lattice.axes[a][b] = axes(b, a);
  }
  return lattice;
}

constexpr std::size_t tilted_pivots_per_chunk = 4096;

// Surface data of the points in each voxel.
struct VoxelPoints {
  // Mean of the points in the voxel, meters; center of the voxel without points.
  std::vector<Eigen::Vector3d> centroids;
  // Sum of their unit normals; zero without normals.
  std::vector<Eigen::Vector3f> outsides;
};

// Returns for each point the index of its voxel in `voxels`, or voxels.size() if it is not there.
std::vector<std::size_t> find_voxels(const libmap::PointCloud& terrain, const VoxelLattice& lattice,
                                     const std::vector<Voxel>& voxels) {
  std::vector<std::size_t> voxel_of_point(terrain.size(), voxels.size());
  libmap::parallel_each(terrain.size(), 4096, [&](std::size_t n) {
    if (!terrain.positions[n].allFinite()) return;
    const Voxel voxel = lattice.voxel_of(terrain.positions[n]);
    const auto found = std::lower_bound(voxels.begin(), voxels.end(), voxel);
    if (found != voxels.end() && *found == voxel)
      voxel_of_point[n] = static_cast<std::size_t>(found - voxels.begin());
  });
  return voxel_of_point;
}

// Computes the data of `voxels`, which ascend. They depend only on the points in a voxel and their
// order.
VoxelPoints points_of_voxels(const libmap::PointCloud& terrain, const VoxelLattice& lattice,
                             const std::vector<Voxel>& voxels) {
  const std::vector<std::size_t> voxel_of_point = find_voxels(terrain, lattice, voxels);
  VoxelPoints result;
  result.outsides.assign(voxels.size(), Eigen::Vector3f::Zero());
  std::vector<Eigen::Vector3d> offsets(voxels.size(), Eigen::Vector3d::Zero());
  std::vector<double> counts(voxels.size(), 0.0);
  for (std::size_t n = 0; n < terrain.size(); ++n) {
    const std::size_t at = voxel_of_point[n];
    if (at == voxels.size()) continue;
    // Relative to the voxel, so that precision does not depend on the distance from the origin.
    offsets[at] += terrain.positions[n] - lattice.center_of(voxels[at]);
    counts[at] += 1.0;
    if (!terrain.has_normals()) continue;
    const Eigen::Vector3f& normal = terrain.normals[n];
    if (normal.allFinite() && normal.norm() > 0.0F) result.outsides[at] += normal.normalized();
  }
  result.centroids.reserve(voxels.size());
  for (std::size_t at = 0; at < voxels.size(); ++at)
    result.centroids.push_back(lattice.center_of(voxels[at]) +
                               offsets[at] / std::max(counts[at], 1.0));
  return result;
}

std::vector<TiltedPivot> tilt(const std::vector<Voxel>& voxels,
                              const std::vector<SurfaceNormal>& normals,
                              const libmap::PointCloud& surface, const VoxelLattice& lattice) {
  const VoxelPoints points = points_of_voxels(surface, lattice, voxels);
  std::vector<TiltedPivot> pivots(voxels.size());
  for (std::size_t n = 0; n < voxels.size(); ++n) {
    const Eigen::Vector3d center = lattice.center_of(voxels[n]);
    pivots[n].anchor_m = center;
    if (!normals[n].normal.allFinite()) continue;
    const Eigen::Vector3d normal = normals[n].normal.cast<double>().normalized();
    pivots[n].normal = normal;
    pivots[n].anchor_m += normal * normal.dot(points.centroids[n] - center);
  }
  return pivots;
}

// Calls find_border_pivots tile by tile, because scanned columns are known only near each tile.
std::vector<std::uint8_t> find_tilted_edges(const std::vector<Voxel>& voxels,
                                            const std::vector<TiltedPivot>& pivots,
                                            const TiltedTerrain& terrain, const VoxelGrid& grid,
                                            const GripperMask& mask,
                                            const std::vector<TileBounds>& tiles) {
  std::vector<std::uint8_t> edges(voxels.size(), 0);
  const int reach = tilted_reach_voxels(mask);
  VoxelGrid pivot_grid;  // the pivots, to be split by tiles
  pivot_grid.voxels = voxels;
  libmap::parallel_each(tiles.size(), [&](std::size_t t) {
    std::vector<std::size_t> here;
    std::vector<TiltedPivot> pivots_here;
    visit_columns(pivot_grid, tiles[t], [&](std::size_t n) {
      here.push_back(n);
      pivots_here.push_back(pivots[n]);
    });
    if (here.empty()) return;
    const std::vector<std::uint8_t> found = terrain.find_border_pivots(
        pivots_here, unscanned_columns(grid, expanded(tiles[t], reach, reach)));
    for (std::size_t n = 0; n < here.size(); ++n) edges[here[n]] = found[n];
  });
  return edges;
}

}  // namespace

Matrix3d tilted_axes(const Vector3d& normal) {
  // Rotation about (-y, x, 0) by the angle with cosine z; 1 / (1 + z) = (1 - z) / (x^2 + y^2).
  const double x = normal.x(), y = normal.y(), z = normal.z();
  const double square = x * x + y * y;
  Matrix3d axes;
  if (z < 0.0 && square == 0.0) {
    axes << 1, 0, 0, 0, -1, 0, 0, 0, -1;
    return axes;
  }
  const double h = z > 0.0 ? 1.0 / (1.0 + z) : (1.0 - z) / square;
  axes << 1.0 - h * x * x, -h * x * y, x,  //
      -h * x * y, 1.0 - h * y * y, y,      //
      -x, -y, z;
  return axes;
}

int tilted_reach_voxels(const GripperMask& mask) {
  // The anchor is in the voxel of the pivot, or above or below it on the surface normal.
  return static_cast<int>(std::ceil(std::max(matched_reach(mask), edge_reach(mask)) + 2.0));
}

TiltedTerrain::TiltedTerrain(const std::vector<Vector3d>& points, const VoxelLattice& lattice,
                             const GripperMask& mask)
    : lattice_(lattice), mask_(mask), grid_(points, grid_cell_m(lattice, mask)) {
  cells_.reserve(grid_.order().size());
  for (const std::uint32_t n : grid_.order()) cells_.push_back(lattice.cell_of(points[n]));
}

// Tilted voxels around the pivots of one grid cell after another.
class TiltedTerrain::Window {
 public:
  Window(const TiltedTerrain& terrain, const TiltedBox& box, double reach)
      : lattice_(terrain.lattice_),
        points_(terrain.grid_, terrain.cells_),
        box_(box),
        reach_(static_cast<std::int64_t>(std::ceil(
            reach * lattice_.voxel_size_m / grid_cell_m(lattice_, terrain.mask_) - 1e-9))) {}

  void enter(const PointGrid::Cell& cell) {
    points_.enter(cell, reach_);
    cells_.resize(points_.count() + MatchingLoops::lanes);
    const NeighborLoops::Coordinates coordinates = points_.coordinates();
    runs_.clear();
    std::size_t first = 0;
    for (const std::size_t last : points_.run_ends()) {
      Run run{first, last, {}, {}};
      const double* const axes[3] = {coordinates.x, coordinates.y, coordinates.z};
      for (int a = 0; a < 3; ++a) {
        const auto [low, high] = std::minmax_element(axes[a] + first, axes[a] + last);
        run.center[a] = (*low + *high) / 2;
        run.half[a] = (*high - *low) / 2;
      }
      runs_.push_back(run);
      first = last;
    }
  }

  // Calls visit(number) for the voxel of each point in the box, twice for some points.
  template <typename Visit>
  void visit_cells(const TiltedPivot& pivot, const Visit& visit) {
    const TiltedLattice lattice = lattice_of(pivot, lattice_);
    const NeighborLoops::Coordinates coordinates = points_.coordinates();
    for (const Run& run : runs_) {
      if (!may_touch(run, lattice)) continue;
      const double* const axes[3] = {coordinates.x + run.first, coordinates.y + run.first,
                                     coordinates.z + run.first};
      const std::size_t count =
          loops_.find_cells(axes, run.last - run.first, lattice, box_, cells_.data());
      for (std::size_t n = 0; n < count; ++n) visit(static_cast<std::size_t>(cells_[n]));
    }
  }

 private:
  // Points of one column of grid cells, and their bounding box.
  struct Run {
    std::size_t first;
    std::size_t last;
    double center[3];
    double half[3];
  };

  // Returns false if the box of the run is outside a face of the tilted box (most frequent).
  bool may_touch(const Run& run, const TiltedLattice& lattice) const {
    for (int a = 0; a < 3; ++a) {
      double cell_position = 0.5;
      double half = 1e-6;  // margin for rounding
      for (int b = 0; b < 3; ++b) {
        cell_position += lattice.axes[a][b] * (run.center[b] - lattice.origin[b]);
        half += std::abs(lattice.axes[a][b]) * run.half[b];
      }
      if (cell_position + half < box_.low[a] || cell_position - half > box_.low[a] + box_.size[a])
        return false;
    }
    return true;
  }

  const VoxelLattice& lattice_;
  CellSurroundings points_;
  TiltedBox box_;
  std::int64_t reach_;
  std::vector<Run> runs_;
  const MatchingLoops& loops_ = matching_loops_of(libmap::best_instruction_set());
  std::vector<int> cells_;
};

namespace {

std::vector<Vector3d> anchors_of(const std::vector<TiltedPivot>& pivots) {
  std::vector<Vector3d> anchors;
  anchors.reserve(pivots.size());
  for (const TiltedPivot& pivot : pivots) anchors.push_back(pivot.anchor_m);
  return anchors;
}

// Bits of the occupied voxels in the window of the mask, and the counts of a pivot.
class OccupiedBits {
 public:
  explicit OccupiedBits(const GripperMask& mask)
      : occupied_(mask.counted.size() / 64 + 1), counted_(occupied_), solid_(occupied_) {
    for (std::size_t n = 0; n < mask.counted.size(); ++n) {
      if (mask.counted[n] == 0) continue;
      set(counted_, n);
      if (mask.solid[n] != 0) set(solid_, n);
    }
  }

  void clear() { std::fill(occupied_.begin(), occupied_.end(), 0); }
  void set(std::size_t cell) { set(occupied_, cell); }
  VoxelCounts count() const {
    const auto common = [&](const Words& wanted) {
      return loops_.count_common(occupied_.data(), wanted.data(), wanted.size());
    };
    return {common(counted_), common(solid_)};
  }

 private:
  using Words = std::vector<std::uint64_t>;
  static void set(Words& words, std::size_t bit) {
    words[bit / 64] |= std::uint64_t{1} << (bit % 64);
  }
  Words occupied_;
  Words counted_;
  Words solid_;
  const MatchingLoops& loops_ = matching_loops_of(libmap::best_instruction_set());
};

}  // namespace

std::vector<VoxelCounts> TiltedTerrain::match(const std::vector<TiltedPivot>& pivots,
                                              libmap::Progress& progress) const {
  const TiltedBox box{.low = {-mask_.pivot_xy, -mask_.pivot_xy, -mask_.pivot_z},
                      .size = {mask_.side, mask_.side, mask_.layers},
                      .stride = {mask_.side, 1, mask_.side * mask_.side}};  // GripperMask::index
  const PointGrid groups(anchors_of(pivots), grid_cell_m(lattice_, mask_));
  std::vector<VoxelCounts> counts(pivots.size());
  progress.begin("voxel matching", groups.cells().size());
  libmap::parallel_for(groups.cells().size(), 16, [&](std::size_t begin, std::size_t end) {
    Window window(*this, box, matched_reach(mask_));
    OccupiedBits bits(mask_);
    for (std::size_t c = begin; c < end; ++c) {
      window.enter(groups.cells()[c]);
      for (std::uint32_t n = groups.ranges()[c].first; n < groups.ranges()[c].last; ++n) {
        bits.clear();
        window.visit_cells(pivots[groups.order()[n]], [&](std::size_t cell) { bits.set(cell); });
        counts[groups.order()[n]] = bits.count();
      }
      progress.advance(1);
    }
  });
  progress.end();
  return counts;
}

namespace {

// Searches the square of the mask on the tangent plane, position by position.
class EdgeSearch {
 public:
  EdgeSearch(const GripperMask& mask, const VoxelLattice& lattice, const ColumnSums& unscanned)
      : lattice_(lattice),
        unscanned_(unscanned),
        square_{-mask.pivot_xy, mask.side - mask.pivot_xy, -mask.pivot_xy,
                mask.side - mask.pivot_xy},
        half_(edge_half_side(mask)) {}

  // Columns of a cube.
  TiltedBox box() const {
    const int side = 2 * half_ + 1;
    return {.low = {-half_, -half_, -half_}, .size = {side, side, side}, .stride = {side, 1, 0}};
  }

  // Returns true if a column below the square was not scanned, which is false for most pivots.
  bool may_be_edge(const TiltedPivot& pivot) const {
    const Matrix3d axes = tilted_axes(pivot.normal);
    const Vector3d origin = lattice_.cell_of(pivot.anchor_m);
    const double half = 0.5 + std::max(-square_.i_begin, square_.i_end - 1);
    TileBounds below{};
    const auto span = [&](int a, int& begin, int& end) {
      const double reach = half * (std::abs(axes(a, 0)) + std::abs(axes(a, 1)));
      begin = floor_to<int>(origin[a] - reach);
      end = floor_to<int>(origin[a] + reach) + 1;
    };
    span(0, below.i_begin, below.i_end);
    span(1, below.j_begin, below.j_end);
    return unscanned_.count(below) != 0;
  }

  // Requires `window` to contain box().
  template <typename Window>
  bool is_edge(const TiltedPivot& pivot, Window& window) const {
    ColumnSums occupied({-half_, half_ + 1, -half_, half_ + 1});
    const std::size_t side = 2 * static_cast<std::size_t>(half_) + 1;
    window.visit_cells(pivot, [&](std::size_t column) {
      occupied.set(static_cast<int>(column / side) - half_,
                   static_cast<int>(column % side) - half_);
    });
    occupied.accumulate();
    const ColumnSums empty = unscanned_columns(occupied, square_);
    if (empty.count(square_) == 0) return false;
    const Matrix3d axes = tilted_axes(pivot.normal);
    const Vector3d origin = lattice_.cell_of(pivot.anchor_m);
    for (int i = square_.i_begin; i < square_.i_end; ++i)
      for (int j = square_.j_begin; j < square_.j_end; ++j) {
        if (empty.count(columns_around(i, j, 0, 0)) == 0) continue;
        const Vector3d foot = origin + axes * Vector3d(i, j, 0);
        if (unscanned_.count(
                columns_around(floor_to<int>(foot.x()), floor_to<int>(foot.y()), 0, 0)) != 0)
          return true;
      }
    return false;
  }

 private:
  const VoxelLattice& lattice_;
  const ColumnSums& unscanned_;
  TileBounds square_;
  int half_;
};

}  // namespace

std::vector<std::uint8_t> TiltedTerrain::find_border_pivots(const std::vector<TiltedPivot>& pivots,
                                                            const ColumnSums& unscanned) const {
  const EdgeSearch search(mask_, lattice_, unscanned);
  std::vector<std::uint8_t> edges(pivots.size(), 0);
  std::vector<std::size_t> doubtful;
  std::vector<Vector3d> anchors;
  for (std::size_t n = 0; n < pivots.size(); ++n)
    if (search.may_be_edge(pivots[n])) {
      doubtful.push_back(n);
      anchors.push_back(pivots[n].anchor_m);
    }
  const PointGrid groups(anchors, grid_cell_m(lattice_, mask_));
  libmap::parallel_for(groups.cells().size(), 16, [&](std::size_t begin, std::size_t end) {
    Window window(*this, search.box(), edge_reach(mask_));
    for (std::size_t c = begin; c < end; ++c) {
      window.enter(groups.cells()[c]);
      for (std::uint32_t k = groups.ranges()[c].first; k < groups.ranges()[c].last; ++k) {
        const std::size_t n = doubtful[groups.order()[k]];
        edges[n] = search.is_edge(pivots[n], window) ? 1 : 0;
      }
    }
  });
  return edges;
}

std::vector<Voxel> pivots_of(const VoxelGrid& grid, const GripperMask& mask,
                             const std::vector<TileBounds>& tiles) {
  std::vector<std::uint8_t> is_pivot(grid.voxels.size(), 0);
  for (const TileBounds& tile : tiles)
    for (const std::size_t at : pivots_in(grid, mask, tile)) is_pivot[at] = 1;
  std::vector<Voxel> voxels;
  for (std::size_t at = 0; at < is_pivot.size(); ++at)
    if (is_pivot[at] != 0) voxels.push_back(grid.voxels[at]);
  return voxels;
}

std::vector<SurfaceNormal> normals_at(const std::vector<Voxel>& voxels,
                                      const libmap::PointCloud& surface,
                                      const VoxelLattice& lattice, double radius_m) {
  std::vector<Eigen::Vector3d> centers;
  centers.reserve(voxels.size());
  for (const Voxel& voxel : voxels) centers.push_back(lattice.center_of(voxel));
  std::vector<Eigen::Vector3f> outsides;
  if (surface.has_normals()) outsides = points_of_voxels(surface, lattice, voxels).outsides;
  return fit_surface_normals(surface, centers, outsides, {.radius_m = radius_m});
}

std::vector<ScoredVoxel> score_on_surface(const std::vector<Voxel>& voxels,
                                          const std::vector<SurfaceNormal>& normals,
                                          const libmap::PointCloud& surface, const VoxelGrid& grid,
                                          const GripperMask& mask,
                                          const std::vector<TileBounds>& tiles,
                                          const ScoringOptions& options,
                                          libmap::Progress& progress) {
  const std::vector<TiltedPivot> pivots = tilt(voxels, normals, surface, grid.lattice);
  const TiltedTerrain terrain(surface.positions, grid.lattice, mask);
  const std::vector<VoxelCounts> counts = terrain.match(pivots, progress);
  std::vector<std::uint8_t> edges(voxels.size(), 0);
  // The other methods do not score the border.
  if (mask.method == Method::corrected)
    edges = find_tilted_edges(voxels, pivots, terrain, grid, mask, tiles);
  std::vector<ScoredVoxel> scored(voxels.size());
  libmap::parallel_for(
      voxels.size(), tilted_pivots_per_chunk, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n)
          scored[n] = {
              .voxel = voxels[n],
              .counts = counts[n],
              .score = score_percent(counts[n], mask.method, options.solid_voxel_threshold) / 100.0,
              .border = edges[n] != 0};
      });
  return scored;
}

}  // namespace libgtd
