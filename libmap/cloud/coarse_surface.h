// The coarse surface of fusion: planes through the pixels of depth images, averaged in voxels.
// Inner part of depth_fusion.
#pragma once

#include "libmap/cloud/depth_planes.h"
#include "libmap/cloud/depth_projection.h"
#include "libmap/cloud/plan_cells.h"
#include "libmap/cloud/surface_voxels.h"
#include "libmap/core/image.h"
#include "libmap/core/pose.h"

namespace libmap {

// Fits planes to the pixels of one depth image (m) and adds those in `cells` to the voxels of the
// grid, each weighted by its cosine, its support and the noise of its depth. What became of the
// pixels; with downsampled cells the counts say nothing.
DepthPixelCounts add_depth_planes(const DepthImage& depth, const PixelRays& rays,
                                  const Pose& grid_from_camera, const DepthPlaneOptions& options,
                                  double voxel_size_m, const PlanCells& cells,
                                  SurfaceVoxels& voxels);

}  // namespace libmap
