// Scoring with the mask tilted to the surface: around each pivot the terrain's points are
// put into voxels of a lattice of its own, whose third axis is the surface's normal.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "libgtd/score/tiling.h"
#include "libgtd/shape/point_grid.h"
#include "libgtd/shape/surface_normal.h"
#include "libmap/core/point_cloud.h"
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

// The pivots of the tiles, ascending, each once.
std::vector<Voxel> pivots_of(const VoxelGrid& grid, const GripperMask& mask,
                             const std::vector<TileBounds>& tiles);

// The surface at the center of each voxel, facing where the normals of the voxel's own points do,
// or +z where they have none.
std::vector<SurfaceNormal> normals_at(const std::vector<Voxel>& voxels,
                                      const libmap::PointCloud& surface,
                                      const VoxelLattice& lattice, double radius_m);

// Scores the pivots `voxels` with the mask along `normals`, along +z where there is none. The
// pivot's tilted voxel has its center where the normal through the voxel's center meets the height
// of the voxel's points along it: the mask's top layer holds a flat surface whole, whichever way it
// faces and wherever it cuts through the terrain's voxels. Without a normal it is the voxel itself,
// so that its counts are those of the upright mask. `surface` are the points that made the voxels.
std::vector<ScoredVoxel> score_on_surface(const std::vector<Voxel>& voxels,
                                          const std::vector<SurfaceNormal>& normals,
                                          const libmap::PointCloud& surface, const VoxelGrid& grid,
                                          const GripperMask& mask,
                                          const std::vector<TileBounds>& tiles,
                                          const ScoringOptions& options,
                                          libmap::Progress& progress = libmap::no_progress());

}  // namespace libgtd
