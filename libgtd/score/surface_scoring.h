// A terrain's voxels scored with the mask tilted to the surface at each of them.
#pragma once

#include <vector>

#include "libgtd/score/tiling.h"
#include "libgtd/shape/surface_normal.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/progress.h"

namespace libgtd {

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
