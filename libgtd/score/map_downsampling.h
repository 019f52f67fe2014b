// Fewer points of a map for pictures of large ones.
#pragma once

#include "libgtd/score/tile_store.h"
#include "libmap/core/point_cloud.h"

namespace libgtd {

// One point for each square of `width` x `width` columns of the lattice that holds any: the
// uppermost of the column nearest to the square's middle, with its own values, so that each value
// is about as frequent as among all points. Ascending by square. Downsampling parts and then their
// union gives what downsampling the union at once gives. `map` is made by to_cloud.
libmap::PointCloud downsample_map(const libmap::PointCloud& map, int width);

// One point for each cube of `width`^3 voxels of the lattice that holds any: that of the voxel
// nearest to the cube's middle, of several as near the uppermost. Steep faces keep their points.
// Ascending by cube. `map` is made by to_cloud.
libmap::PointCloud thin_map_in_cubes(const libmap::PointCloud& map, int width);

// Moves each point, level, to the middle of its square: to a lattice again.
void center_in_squares(const TileStoreIndex& index, int width, libmap::PointCloud& map);

}  // namespace libgtd
