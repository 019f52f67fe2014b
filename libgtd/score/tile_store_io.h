// Reads and writes maps in tile stores, in the layout of libmap (libmap/tiles/tile_store_io.h):
//
//   NAME.tiles/index.json        properties of the map and list of its tiles; written after the
//                                last tile
//   NAME.tiles/tiles/I_J.pcd     tile (I, J): points and fields as in any map, binary
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

// Returns true if the name ends with ".tiles" or ".tiles/".
bool is_tile_store_name(const std::filesystem::path& path);

// Reads the index. Throws Error naming the file if there is no store or no index, or if the index
// has another format or version or inconsistent content. For an unfinished run, the message
// contains the number of finished tiles.
TileStoreIndex read_tile_store(const std::filesystem::path& store);

// Reads the index, after writing it if it is missing although all tiles are finished (possible if
// runs that share the tiles end at the same time). Throws like read_tile_store.
TileStoreIndex finish_tile_store(const std::filesystem::path& store);

// Returns the path of a tile file. Throws Error naming a file that is missing or differs in size.
std::filesystem::path tile_path(const std::filesystem::path& store, const StoredTile& tile);

// As tile_path, but also throws Error if the SHA-256 of the file differs from the index.
std::filesystem::path checked_tile_path(const std::filesystem::path& store, const StoredTile& tile);

// Input file of the terrain. Size and modification time identify the file without reading it.
struct TerrainFile {
  libmap::ManifestInput input;
  std::int64_t modified_ns = 0;  // modification time
  std::uint64_t points = 0;
  std::uint64_t dropped_points = 0;  // points with coordinates that are not finite
  libmap::Bounds3d box;              // in the input frame
};

struct TilePlan {
  std::string key;                                     // hash of parameters and inputs
  TileStoreIndex index;                                // without tiles and their counts
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();  // of the fitted plane, m, input frame
  bool has_plane = false;
  std::vector<TerrainFile> terrain;
  std::vector<StoredTile> kept;  // finished tiles of an earlier plan, which remain valid
};

class MapTileStore : public libmap::TileStore {
 public:
  using TileStore::TileStore;

  // Returns nullopt if there is no plan. Throws Error naming the file if it is damaged.
  std::optional<TilePlan> plan() const;
  void set_plan(const TilePlan& plan) const;

  // Returns the finished tiles, also of other runs that share the tiles of the plan.
  std::map<TileNumber, StoredTile> done(const TilePlan& plan) const;
  // Returns the elements of `tiles` that are not finished or have a changed or missing file.
  std::vector<TileNumber> missing(const TilePlan& plan, const std::vector<TileNumber>& tiles) const;

  struct Completion {
    std::optional<TileStoreIndex> index;  // nullopt unless all tiles are done
    std::size_t done = 0;
    std::size_t tiles = 0;
  };
  // Counts the finished tiles of the plan; if all are finished, makes the index.
  Completion complete(const TilePlan& plan) const;
  // Writes the manifest of the map (index.manifest with times and threads of `run`) beside the
  // store, then the index. Does nothing if the index exists.
  void write_index(const TileStoreIndex& index, const libmap::Manifest& run = {}) const;
};

// Adds tiles with existing files to the journal of finished tiles.
void add_tiles(const std::vector<StoredTile>& tiles, const std::string& key,
               libmap::TileJournal& journal);

}  // namespace libgtd
