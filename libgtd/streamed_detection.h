// Detection of graspable targets for terrains larger than memory, in tiles. A first pass over all
// points determines the terrain frame and the box of voxels. Each tile is scored from the points in
// the tile and a margin (the halo). The voxels are identical to the voxels of detect().
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "libgtd/detect.h"
#include "libgtd/score/tile_store.h"
#include "libmap/core/point_stream.h"
#include "libmap/tiles/point_tile_store.h"
#include "libmap/tiles/tile_share.h"

namespace libgtd {

// Terrain frame and box of voxels, common to all tiles of a terrain.
struct TerrainFrame {
  std::optional<RegressionPlane> plane;  // nullopt: the points are in the terrain frame
  VoxelLattice lattice;
  Voxel min;  // box of the terrain's voxels
  Voxel max;

  // Returns true if the normals are on random sides of the surface and are not used.
  bool drops_normals() const;
};

// Throws Error naming the option that needs the whole terrain in memory: `method` thesis or
// envelope (downsampling and lattice), `interpolation`, or `obstacle_height_m`.
void require_streamable(const DetectionOptions& options);

// Computes the frame and the box in passes over `points`. Throws Error if there are no points, and
// all errors of the plane fit and the voxel lattice.
TerrainFrame frame_terrain(const libmap::PointStream& points, const DetectionOptions& options);
// Transforms points into the terrain frame; removes the normals if drops_normals() is true.
libmap::PointCloud to_terrain(const libmap::PointCloud& block, const TerrainFrame& frame);

// Returns the tiles of the box, ascending. If several runs divide the tiles, `share` selects the
// tiles of one run. Throws Error naming tile_size_m if the box has more than 2^20 tiles.
std::vector<TileNumber> tiles_of(const TerrainFrame& frame, int tile_voxels,
                                 const libmap::TileShare& share = {});

struct StreamedTile {
  TileNumber number;
  std::vector<MapVoxel> voxels;     // ascending; empty if no voxel is scored
  std::size_t occupied_voxels = 0;  // voxels with points, scored or not
};

struct StreamingOptions {
  // Maximum number of points processed at once. Neighboring tiles with fewer points are processed
  // together; a tile with more points is divided, down to the width of the halo.
  std::size_t max_points = 1'000'000;
};

// Rectangle in the x-y plane of the terrain frame, meters.
struct PointsRectangle {
  Eigen::Vector2d low;
  Eigen::Vector2d high;
};
// Returns the rectangle of all points that affect the result in `columns`.
PointsRectangle points_for(const TileBounds& columns, const TerrainFrame& frame, int halo_voxels);

// Scores the tiles `wanted` from `points` in the terrain frame, including the halo. Calls `visit`
// with a few tiles at a time, each tile once, from one thread. Throws like require_streamable, and
// Error if the points are too sparse for the voxel size (voxel_grid.h).
void detect_streamed(const TerrainFrame& frame, const libmap::PointTileStore& points,
                     const std::vector<TileNumber>& wanted, const DetectionOptions& options,
                     const std::function<void(std::vector<StreamedTile> tiles)>& visit,
                     libmap::Progress& progress = libmap::no_progress(),
                     const StreamingOptions& streaming = {});

}  // namespace libgtd
