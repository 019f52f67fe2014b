// Scores voxels with the gripper mask tilted to the surface normal (orientation `surface`), for
// walls. Around each pivot voxel, the points of the terrain are voxelized on a separate lattice
// with the surface normal as third axis.
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
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();   // axis of the mask: unit length, outward
};

// Returns the axes of the tilted lattice as columns, in the terrain frame: the terrain axes,
// rotated by the shortest rotation of z to the normal (Moeller and Hughes 1999). For a normal of
// -z, half a turn about x.
Eigen::Matrix3d tilted_axes(const Eigen::Vector3d& normal);

// Returns the maximum distance, in voxels, of points that affect counts and border of a pivot.
int tilted_reach_voxels(const GripperMask& mask);

// Points in the terrain frame, sorted for searches.
class TiltedTerrain {
 public:
  // All arguments must outlive this object.
  TiltedTerrain(const std::vector<Eigen::Vector3d>& points, const VoxelLattice& lattice,
                const GripperMask& mask);

  // Returns the counts of each pivot. A tilted voxel is occupied if it contains a point; the counts
  // of a surface thus do not depend on its orientation. Counts depend only on the points within
  // tilted_reach_voxels, not on their order.
  std::vector<VoxelCounts> match(const std::vector<TiltedPivot>& pivots,
                                 libmap::Progress& progress = libmap::no_progress()) const;

  // Returns 1 for each pivot with a mask that extends beyond the scanned area, else 0. The mask's
  // footprint is a square of tilted voxels on the tangent plane. A pivot has 1 if one of these
  // - is in an unscanned column of the terrain (scanned_area.h), and
  // - is in a tilted column (along the mask's axis) without points, outside closed gaps between
  //   tilted columns with points. A tilted column is 4 scan_gap_voxels longer than the square.
  // Empty space beside a rock is therefore no border. `unscanned` must contain the columns within
  // tilted_reach_voxels.
  std::vector<std::uint8_t> find_border_pivots(const std::vector<TiltedPivot>& pivots,
                                               const ColumnSums& unscanned) const;

 private:
  class Window;

  const VoxelLattice& lattice_;
  const GripperMask& mask_;
  PointGrid grid_;
  std::vector<Eigen::Vector3d> cells_;  // points in voxels, in the order of the grid
};

// Returns the pivots of the tiles, ascending, each once.
std::vector<Voxel> pivots_of(const VoxelGrid& grid, const GripperMask& mask,
                             const std::vector<TileBounds>& tiles);

// Returns the surface normal at the center of each voxel. The normal is on the side of the normals
// of the points in the voxel, or of +z if they have none; NaN as in SurfaceNormal.
std::vector<SurfaceNormal> normals_at(const std::vector<Voxel>& voxels,
                                      const libmap::PointCloud& surface,
                                      const VoxelLattice& lattice, double radius_m);

// Scores the pivots `voxels` with the mask along `normals`. The center of a pivot's tilted voxel is
// on the normal through the center of the voxel, at the mean height of the voxel's points along the
// normal. The top layer of the mask thus contains a flat surface completely, in any orientation and
// position relative to the voxels. For a voxel without a normal, the mask is along +z and the pivot
// is the voxel itself. `surface` contains the points from which the voxels were made.
std::vector<ScoredVoxel> score_on_surface(const std::vector<Voxel>& voxels,
                                          const std::vector<SurfaceNormal>& normals,
                                          const libmap::PointCloud& surface, const VoxelGrid& grid,
                                          const GripperMask& mask,
                                          const std::vector<TileBounds>& tiles,
                                          const ScoringOptions& options,
                                          libmap::Progress& progress = libmap::no_progress());

}  // namespace libgtd
