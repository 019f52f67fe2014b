// Voxel matching with the mask tilted to the surface: around each pivot the terrain's points are
// put into voxels of a lattice of its own, whose third axis is the surface's normal.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "libgtd/score/tiling.h"
#include "libgtd/shape/point_grid.h"
#include "libmap/core/progress.h"

namespace libgtd {

struct TiltedPivot {
  Eigen::Vector3d anchor_m = Eigen::Vector3d::Zero();  // center of the pivot's tilted voxel
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();   // of unit length: the mask's axis, outward
};

// Columns: the axes of the lattice tilted to `normal`, in the terrain frame: the terrain's own,
// turned the shortest way that brings z to the normal (Moeller and Hughes 1999); for a normal
// straight down, half a turn about x.
Eigen::Matrix3d tilted_axes(const Eigen::Vector3d& normal);

// How many voxels from the pivot's voxel the points may lie that decide on its counts and edge.
int tilted_reach_voxels(const GripperMask& mask);

// Points in the terrain frame, sorted for searches.
class TiltedTerrain {
 public:
  // What is given outlives this.
  TiltedTerrain(const std::vector<Eigen::Vector3d>& points, const VoxelLattice& lattice,
                const GripperMask& mask);

  // Counts of each pivot: a tilted voxel is occupied if a point lies in it, so that a surface
  // weighs the same whichever way it faces. They depend on nothing else than the points within
  // reach, not on their order.
  std::vector<VoxelCounts> match(const std::vector<TiltedPivot>& pivots,
                                 libmap::Progress& progress = libmap::no_progress()) const;

  // For each pivot whether the mask leaves the scanned area: a place of its square on the tangent
  // plane has nothing above or below it along the mask's axis (within half the square and the gaps
  // that are closed, and closed over gaps as scanned columns are), and lies over a column that was
  // not scanned. So what is looked past, the air beside a rock, is no edge. `unscanned` holds the
  // columns within tilted_reach_voxels.
  std::vector<std::uint8_t> find_edges(const std::vector<TiltedPivot>& pivots,
                                       const ColumnSums& unscanned) const;

 private:
  class Window;

  const VoxelLattice& lattice_;
  const GripperMask& mask_;
  PointGrid grid_;
  std::vector<Eigen::Vector3d> cells_;  // of the points, in voxels, in the order of the grid
};

}  // namespace libgtd
