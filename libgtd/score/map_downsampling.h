// Downsamples large maps for images. Maps are clouds made by to_cloud. All functions throw Error
// for a map without the fields i, j, k.
#pragma once

#include "libgtd/score/tile_store.h"
#include "libmap/core/point_cloud.h"

namespace libgtd {

// Keeps one point per block of `width` x `width` columns with points: the uppermost point of the
// column nearest to the middle of the block. Values are unchanged, so that the distribution of each
// value is about the distribution over all points. Ascending by block. Downsampling parts and then
// their union gives the same result as downsampling the union.
libmap::PointCloud downsample_map(const libmap::PointCloud& map, int width);

// Keeps one point per cube of `width`^3 voxels with points: the voxel nearest to the middle of the
// cube, and the uppermost of equally near voxels. Steep faces keep their points. Ascending by cube.
libmap::PointCloud voxel_downsample_map(const libmap::PointCloud& map, int width);

// Moves each point horizontally to the middle of the block, so that the points form a lattice.
void snap_to_square_centers(const TileStoreIndex& index, int width, libmap::PointCloud& map);

}  // namespace libgtd
