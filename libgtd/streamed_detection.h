// The detection of a terrain that does not fit into memory: one look at all points for the frame
// and the box of voxels, then tile by tile with the points nearby. Its voxels are those of detect()
// on the same points, to the bit.
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

// What the whole terrain decides for each of its tiles.
struct TerrainFrame {
  std::optional<RegressionPlane> plane;  // nothing: the points are in the terrain frame
  VoxelLattice lattice;
  Voxel min;  // box of the terrain's voxels
  Voxel max;

  // Normals with random sides are no outside of the surface.
  bool drops_normals() const;
};

// Throws Error naming the option that needs the whole cloud in memory: `method` thesis or envelope
// (their downsampling and lattice), `interpolation`.
void require_streamable(const DetectionOptions& options);

// Throws Error for no points, and what the steps throw.
TerrainFrame frame_terrain(const libmap::PointStream& points, const DetectionOptions& options);
libmap::PointCloud to_terrain(const libmap::PointCloud& block, const TerrainFrame& frame);

// The tiles of the box, ascending, and a share of them. Throws Error naming tile_size_m for more
// than 2^20 tiles in all.
std::vector<TileNumber> tiles_of(const TerrainFrame& frame, int tile_voxels,
                                 const libmap::TileShare& share = {});

struct StreamedTile {
  TileNumber number;
  std::vector<MapVoxel> voxels;  // ascending; none if nothing is scored there
  std::size_t occupied_voxels = 0;
};

struct StreamingOptions {
  // Tiles that lie together are worked on at once while there are not more points than this in
  // them and their halo, and a tile with more is worked on in parts, down to the width of its halo.
  std::size_t max_points = 1'000'000;
};

// Rectangle in meters that holds all points on which the tile depends.
struct PointsRectangle {
  Eigen::Vector2d low;
  Eigen::Vector2d high;
};
PointsRectangle points_for(const TileBounds& columns, const TerrainFrame& frame, int halo_voxels);

// `points` are in the terrain frame. Calls visit for a few of the tiles `wanted` after the other,
// each tile once.
void detect_streamed(const TerrainFrame& frame, const libmap::PointTileStore& points,
                     const std::vector<TileNumber>& wanted, const DetectionOptions& options,
                     const std::function<void(std::vector<StreamedTile> tiles)>& visit,
                     libmap::Progress& progress = libmap::no_progress(),
                     const StreamingOptions& streaming = {});

}  // namespace libgtd
