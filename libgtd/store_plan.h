// Plans a run that scores a terrain into a tile store: compares it with an earlier plan, and finds
// the tiles to keep and the points that the missing tiles depend on.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "libgtd/score/tile_store_io.h"
#include "libgtd/streamed_detection.h"

namespace libgtd {

// Tile width and halo width of a detection, in voxels.
struct StoreTiling {
  // Makes the mask and derives both widths from it and the scenario.
  explicit StoreTiling(const DetectionOptions& detection);

  GripperMask mask;
  int tile_voxels = 0;
  int halo_voxels = 0;
};

// Adds the frame to the plan: lattice, box, plane, and the transform and results of the manifest.
void set_frame(const TerrainFrame& frame, const StoreTiling& tiling, TilePlan& plan);

// Returns the frame of an earlier plan. Throws Error naming `plan_file` if the tiles of the plan
// differ from those of these options.
TerrainFrame frame_of(const TilePlan& plan, const DetectionOptions& detection,
                      const std::filesystem::path& plan_file);

// Throws Error naming `plan_file` if a point is outside the box of the frame.
void require_in_frame(const libmap::PointCloud& terrain, const TerrainFrame& frame,
                      const std::filesystem::path& plan_file);

// Throws Error naming the store unless `plan` is `earlier` with additional files, `append` is set,
// and the options allow tiles far from these files to be kept.
void require_appendable(const TilePlan& earlier, const TilePlan& plan,
                        const DetectionOptions& detection, bool append, const std::string& store);

// Returns the finished tiles that do not depend on any point of the files that are only in `plan`.
std::vector<StoredTile> unaffected_tiles(const std::map<TileNumber, StoredTile>& done,
                                        const TilePlan& earlier, const TilePlan& plan,
                                        const TerrainFrame& frame, const StoreTiling& tiling);

// Returns the rectangle that contains all points on which the tiles depend.
PointsRectangle points_for(const std::vector<TileNumber>& tiles, const TerrainFrame& frame,
                           const StoreTiling& tiling);
// Returns true if a point of the file may be in the rectangle.
bool may_intersect(const TerrainFile& file, const PointsRectangle& wanted, const TerrainFrame& frame);

// Returns the box and counts of the tile, without the fields of its file.
StoredTile stored_tile(const StreamedTile& tile);

}  // namespace libgtd
