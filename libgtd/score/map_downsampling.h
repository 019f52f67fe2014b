// Downsamples large maps for images. Maps are clouds made by to_cloud. All functions throw Error
// for a map without the fields i, j, k.
#pragma once

#include "libgtd/score/tile_store.h"
#include "libmap/core/point_cloud.h"

namespace libgtd {

// Divides the map into blocks of `width` x `width` columns. Keeps one point per block that contains
// points: the uppermost point of the column nearest to the middle of the block. Ascends by block.
// Values are unchanged, so that their distributions remain about the same. Downsampling parts of a
// map and then their union gives the result of the whole map.
libmap::PointCloud downsample_map(const libmap::PointCloud& map, int width);

// Divides the map into cubes of `width`^3 voxels. Keeps one point per cube that contains points:
// the voxel nearest to the middle (the uppermost of several). Ascends by cube. Keeps steep faces.
libmap::PointCloud voxel_downsample_map(const libmap::PointCloud& map, int width);

// Moves each point of downsample_map along i and j to the middle of its block.
void snap_to_square_centers(const TileStoreIndex& index, int width, libmap::PointCloud& map);

}  // namespace libgtd
