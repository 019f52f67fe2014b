// Maps in tile stores on disk, in libmap's layout (libmap/tiles/tile_store_io.h):
//
//   NAME.tiles/index.json        facts of the whole map and the list of its tiles; written once all
//                                tiles are done
//   NAME.tiles/tiles/I_J.pcd     tile (I, J): points and fields as of any map, binary
//   NAME.tiles/progress/...      plan and journals
//
// libgtd/score/README.md defines each key of the JSON files.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "libgtd/score/tile_store.h"
#include "libmap/core/point_cloud.h"
#include "libmap/tiles/tile_store_io.h"

namespace libgtd {

// Whether the name ends in ".tiles", with or without a '/' after it.
bool is_tile_store_name(const std::filesystem::path& path);

// Throws Error naming the file: no store, no index (it says how many tiles are done where a run
// has not ended yet), no index of this format and version, or one whose parts do not fit.
TileStoreIndex read_tile_store(const std::filesystem::path& store);

// The same. If all tiles are done and only the index is missing, as after shares that ended at the
// same time, the index is written first.
TileStoreIndex finish_tile_store(const std::filesystem::path& store);

// The tile's file. Throws Error naming it if it is missing or its size differs from the index.
std::filesystem::path tile_path(const std::filesystem::path& store, const StoredTile& tile);

// The same; its SHA-256 must be that of the index, too.
std::filesystem::path checked_tile_path(const std::filesystem::path& store, const StoredTile& tile);

// A file of the terrain. Its size and time identify it without reading it.
struct TerrainFile {
  libmap::ManifestInput input;
  std::int64_t modified_ns = 0;
  std::uint64_t points = 0;
  std::uint64_t dropped_points = 0;
  libmap::Bounds3d box;  // in the input frame
};

struct TilePlan {
  std::string key;                                     // of parameters and inputs: key_of
  TileStoreIndex index;                                // without tiles and their counts
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();  // of the fitted plane
  bool has_plane = false;
  std::vector<TerrainFile> terrain;
  std::vector<StoredTile> kept;  // tiles that are done already
};

class MapTileStore : public libmap::TileStore {
 public:
  using TileStore::TileStore;

  // Nothing if there is none. Throws Error naming the file if it is broken.
  std::optional<TilePlan> plan() const;
  void set_plan(const TilePlan& plan) const;

  // All finished tiles, of any share.
  std::map<TileNumber, StoredTile> done(const TilePlan& plan) const;
  // Those of `tiles` that are not done or whose file has changed since.
  std::vector<TileNumber> missing(const TilePlan& plan, const std::vector<TileNumber>& tiles) const;

  struct Completion {
    std::optional<TileStoreIndex> index;  // if all tiles are done
    std::size_t done = 0;
    std::size_t tiles = 0;
  };
  // Counts the finished tiles of the plan; lists them if all are done.
  Completion complete(const TilePlan& plan) const;
  // Writes the index unless it exists, and before it a manifest beside the store: that of the index
  // with times and threads of `run`.
  void write_index(const TileStoreIndex& index, const libmap::Manifest& run = {}) const;
};

// Lists tiles as done whose files are in place.
void add_tiles(const std::vector<StoredTile>& tiles, const std::string& key,
               libmap::TileJournal& journal);

}  // namespace libgtd
