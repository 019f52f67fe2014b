// Downsamples large maps for images. Maps are clouds made by to_cloud. All functions throw Error
// for a map without the fields i, j, k.
#pragma once

#include "libgtd/score/tile_store.h"
#include "libmap/core/point_cloud.h"

namespace libgtd {

// Keeps one point per block of `width` x `width` columns with points: the uppermost point of the
// column nearest to the middle of the block, in ascending order of the blocks. Values are
// unchanged, so that their distributions are about those of all points. Downsampling parts of a map
// and then their union gives the same result as downsampling the whole map.
libmap::PointCloud downsample_map(const libmap::PointCloud& map, int width);

// Keeps one point per cube of `width`^3 voxels with points: the voxel nearest to the middle of the
// cube, the uppermost of equally near ones, in ascending order of the cubes. Keeps steep faces.
libmap::PointCloud voxel_downsample_map(const libmap::PointCloud& map, int width);

// Moves each point horizontally to the middle of its block, so that the points form a lattice.
void snap_to_square_centers(const TileStoreIndex& index, int width, libmap::PointCloud& map);

}  // namespace libgtd
