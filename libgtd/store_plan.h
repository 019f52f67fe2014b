// Plans how `graspmap score` computes a map in a tile store (a folder with one file per tile).
// Finds the tiles of an earlier run that remain valid, and the points that affect other tiles.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "libgtd/score/tile_store_io.h"
#include "libgtd/streamed_detection.h"

namespace libgtd {

// Widths in voxels of a tile and of its halo, the margin in which points affect the tile.
struct StoreTiling {
  // Makes the mask, and derives both widths from the mask and the scenario.
  explicit StoreTiling(const DetectionOptions& detection);

  GripperMask mask;
  int tile_voxels = 0;
  int halo_voxels = 0;
};

// Stores the frame in the plan (lattice, box, plane) and its manifest (transform, results).
void set_frame(const TerrainFrame& frame, const StoreTiling& tiling, TilePlan& plan);

// Returns the frame of an earlier plan. Throws Error naming `plan_file` if its tile width or
// lattice differs from that of `detection`.
TerrainFrame frame_of(const TilePlan& plan, const DetectionOptions& detection,
                      const std::filesystem::path& plan_file);

// Throws Error naming `plan_file` if a point is more than a voxel outside the frame's box.
void require_in_frame(const libmap::PointCloud& terrain, const TerrainFrame& frame,
                      const std::filesystem::path& plan_file);

// Throws Error naming the store unless `append` is set, `plan` has the parameters and files of
// `earlier` and further files, and points affect only tiles near them (PlaneSource::none with
// method corrected or calibrated).
void require_appendable(const TilePlan& earlier, const TilePlan& plan,
                        const DetectionOptions& detection, bool append, const std::string& store);

// Returns the tiles in `done` that no added file (in `plan`, but not in `earlier`) can affect.
std::vector<StoredTile> unaffected_tiles(const std::map<TileNumber, StoredTile>& done,
                                         const TilePlan& earlier, const TilePlan& plan,
                                         const TerrainFrame& frame, const StoreTiling& tiling);

// Returns a rectangle in the terrain frame that contains all points that affect the tiles.
PointsRectangle points_for(const std::vector<TileNumber>& tiles, const TerrainFrame& frame,
                           const StoreTiling& tiling);
// Returns true if a point of the file may be in the rectangle.
bool may_intersect(const TerrainFile& file, const PointsRectangle& wanted,
                   const TerrainFrame& frame);

// Returns the index entry of a scored tile: box and counts, without file name, size and hash.
StoredTile stored_tile(const StreamedTile& tile);

}  // namespace libgtd
