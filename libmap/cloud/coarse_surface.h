// The coarse surface of fusion: planes through the pixels of depth images, averaged in voxels.
// Inner part of depth_fusion.
#pragma once

#include "libmap/cloud/depth_planes.h"
#include "libmap/cloud/depth_projection.h"
#include "libmap/cloud/surface_voxels.h"
#include "libmap/cloud/tile_mask.h"
#include "libmap/core/image.h"
#include "libmap/core/pose.h"

namespace libmap {

// Which pixels planes are fitted to: all, and the counts are those of the image; or those that may
// be in the cells, and the counts say nothing.
enum class FittedPixels { all, in_cells };

// Fits planes to the pixels of one depth image (m) and adds those in `cells` to the voxels of the
// grid, each weighted by its cosine, its support and the noise of its depth. Both kinds of fitted
// pixels give the same voxels; but of downsampled cells the edges are fitted roughly. What became
// of the pixels.
DepthPixelCounts add_depth_planes(const DepthImage& depth, const PixelRays& rays,
                                  const Pose& grid_from_camera, const DepthPlaneOptions& options,
                                  double voxel_size_m, const TileMask& cells, FittedPixels fitted,
                                  SurfaceVoxels& voxels);

}  // namespace libmap
