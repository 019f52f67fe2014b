// Converts a graspability map to the cells of a report's 3-D view. Positions are in the terrain
// frame, meters.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "libmap/core/point_cloud.h"

namespace libmap {

// Voxel lattice of a map.
struct MapLattice {
  double voxel_size_m = 0.0;
  Eigen::Vector3d origin_in_terrain = Eigen::Vector3d::Zero();  // lowest corner of voxel (0, 0, 0)
};

// Marked location: a row of a table of look-ups.
struct MapMarker {
  std::string label{};
  Eigen::Vector3d point_in_terrain = Eigen::Vector3d::Zero();
  std::optional<bool> verdict{};  // true: graspable according to the table; nullopt: unknown
};

// A cell of the view: a cube of voxels.
struct MapCell {
  std::array<std::uint16_t, 3> index{};  // index of the cube along x, y, z; the lowest is 0
  std::uint8_t colors_and_flags = 0;     // color class in the lower four bits, flags above
};

// Color classes of cells: 0 to 6 are the indices of score_classes (core/score_color.h), then these.
inline constexpr std::uint8_t no_value_class = 7;
inline constexpr std::uint8_t below_plane_class = 8;
// Flags of cells, which are added to the class.
inline constexpr std::uint8_t convex_flag = 16;
inline constexpr std::uint8_t graspable_flag = 32;
inline constexpr std::uint8_t obstacle_flag = 64;

// Holding force of a cell: median, quantiles 0.05 (low) and 0.95 (high), encoded by force_byte; and
// the probability to hold the map's load, in units of 1/255.
struct CellForce {
  std::uint8_t median = 0;
  std::uint8_t low = 0;
  std::uint8_t high = 0;
  std::uint8_t probability = 0;
};

// Encodes a force, N: 1 to 255 for 0.05 N to 1.3 kN, logarithmic in steps of 4 %; 0: no force.
std::uint8_t force_byte(double force_n);

struct MapView {
  double cell_size_m = 0.0;
  Eigen::Vector3d corner_in_terrain = Eigen::Vector3d::Zero();  // lowest corner of cell (0, 0, 0)
  std::vector<MapCell> cells;                                   // one per point of the map
  bool has_convex = false;        // true if the map has the field convex
  bool has_graspable = false;     // true if the map has the field graspable
  bool has_obstacle = false;      // true if the map has the field obstacle
  std::vector<CellForce> forces;  // one per cell; empty: the map has no holding forces
  double load_n = 0.0;            // load for CellForce::probability
  double max_force_n = 0.0;       // quantile 0.995 of the median forces, at least 1 N
  int voxels_per_cell = 1;        // voxels per cell along one axis
  std::uint64_t voxels = 0;       // number of voxels of the map
  std::vector<MapMarker> markers;
};

struct MapViewOptions {
  int voxels_per_cell = 1;               // voxels per cell along one axis
  std::optional<double> zero_plane_m{};  // lower points have below_plane_class; nullopt: none
  std::optional<double> load_n{};        // nullopt: forces are not shown
  std::optional<MapLattice> lattice{};   // nullopt: estimated from the points
};

// Estimates the lattice from positions and fields i, j, k; a map of one point has voxels of 0.01 m.
// Throws Error for a missing field, or points that are not on a lattice along the axes.
MapLattice lattice_of(const PointCloud& map_in_terrain);

// Makes one cell per point, colored by the field hold_probability if it exists, else by score.
// Throws Error for a missing field, more than 65536 cells along an axis, and as lattice_of does.
MapView make_map_view(const PointCloud& map_in_terrain, const MapViewOptions& options);

}  // namespace libmap
