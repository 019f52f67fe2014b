// A graspability map as the 3-D view of a report shows it: the cells of its lattice.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "libmap/core/point_cloud.h"

namespace libmap {

// Where the voxels of a map lie.
struct MapLattice {
  double voxel_size_m = 0.0;
  Eigen::Vector3d origin_in_terrain = Eigen::Vector3d::Zero();  // lower corner of voxel (0, 0, 0)
};

struct MapMarker {
  std::string label{};
  Eigen::Vector3d point_in_terrain = Eigen::Vector3d::Zero();
  std::optional<bool> verdict{};
};

// A cell's byte: its color in the lower half, flags in the upper one.
struct MapCell {
  std::array<std::uint16_t, 3> place{};  // on the lattice of cells, from the lowest one used
  std::uint8_t colors_and_flags = 0;
};

// Colors after the classes of core/score_color.h.
inline constexpr std::uint8_t no_value_class = 7;
inline constexpr std::uint8_t below_plane_class = 8;
inline constexpr std::uint8_t convex_flag = 16;
inline constexpr std::uint8_t graspable_flag = 32;
inline constexpr std::uint8_t obstacle_flag = 64;

// Of a cell: the median of the holding force, its quantiles 0.05 and 0.95 (force_byte), and the
// probability of the map's load in 255ths.
struct CellForce {
  std::uint8_t median = 0;
  std::uint8_t low = 0;
  std::uint8_t high = 0;
  std::uint8_t probability = 0;
};

// Forces from 0.05 N to 1.3 kN in steps of 4 %; 0: no force.
std::uint8_t force_byte(double force_n);

struct MapView {
  double cell_size_m = 0.0;
  Eigen::Vector3d corner_in_terrain = Eigen::Vector3d::Zero();  // lower corner of cell (0, 0, 0)
  std::vector<MapCell> cells;                                   // as the points of the map
  bool has_convex = false;
  bool has_graspable = false;
  bool has_obstacle = false;
  std::vector<CellForce> forces;  // as cells; none: the map has no holding forces
  double load_n = 0.0;            // of their probabilities
  double max_force_n = 0.0;       // quantile 0.995 of the medians
  int voxels_a_cell = 1;          // along an edge
  std::uint64_t voxels = 0;       // of the whole map
  std::vector<MapMarker> markers;
};

struct MapViewOptions {
  int voxels_a_cell = 1;
  std::optional<double> zero_plane_m{};
  std::optional<double> load_n{};       // nothing: no forces are shown
  std::optional<MapLattice> lattice{};  // nothing: from the points
};

// The lattice that the points of a map in the terrain frame lie on, by their fields i, j, k.
// Throws Error: no such fields, or points that lie on no lattice along the axes.
MapLattice lattice_of(const PointCloud& map_in_terrain);

// One cell a point, colored by hold_probability, or by score without this field. Throws Error: a
// field that is missing, a map wider than 65535 cells.
MapView make_map_view(const PointCloud& map_in_terrain, const MapViewOptions& options);

}  // namespace libmap
