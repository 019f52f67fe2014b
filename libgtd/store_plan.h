// Planning of a run that scores a terrain into a tile store: whether an earlier plan fits, which of
// its tiles stay, and which points the missing tiles depend on.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "libgtd/score/tile_store_io.h"
#include "libgtd/streamed_detection.h"

namespace libgtd {

// Tiles and halo of a detection with these options.
struct StoreTiling {
  // Makes the mask and derives both sizes from it and the scenario.
  explicit StoreTiling(const DetectionOptions& detection);

  GripperMask mask;
  int tile_voxels = 0;
  int halo_voxels = 0;
};

// Adds the frame to the plan: lattice, box, plane, and the manifest's transform and results.
void set_frame(const TerrainFrame& frame, const StoreTiling& tiling, TilePlan& plan);

// The frame of an earlier plan. Throws Error naming its file `plan_file` if the plan has other
// tiles than these options.
TerrainFrame frame_of(const TilePlan& plan, const DetectionOptions& detection,
                      const std::filesystem::path& plan_file);

// Throws Error naming `plan_file` if a point is outside the frame's box.
void require_in_frame(const libmap::PointCloud& terrain, const TerrainFrame& frame,
                      const std::filesystem::path& plan_file);

// Throws Error naming the store unless `plan` is `earlier` with more files, and --append and the
// options keep the tiles far from these files.
void require_appendable(const TilePlan& earlier, const TilePlan& plan,
                        const DetectionOptions& detection, bool append, const std::string& store);

// The finished tiles that no point of a file that only `plan` has can change.
std::vector<StoredTile> untouched_tiles(const std::map<TileNumber, StoredTile>& done,
                                        const TilePlan& earlier, const TilePlan& plan,
                                        const TerrainFrame& frame, const StoreTiling& tiling);

// Rectangle that contains all points on which the tiles depend.
PointsRectangle points_for(const std::vector<TileNumber>& tiles, const TerrainFrame& frame,
                           const StoreTiling& tiling);
// Whether a point of the file may be in the rectangle.
bool touches(const TerrainFile& file, const PointsRectangle& wanted, const TerrainFrame& frame);

// The tile's box and counts, without those of its file.
StoredTile stored_tile(const StreamedTile& tile);

}  // namespace libgtd
