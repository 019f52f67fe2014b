// Tile stores on disk:
//
//   NAME.tiles/index.json        the whole map's facts and the list of its tiles; there once all
//                                tiles are
//   NAME.tiles/tiles/I_J.pcd     tile (I, J): points and fields as of any map, binary
//   NAME.tiles/progress/...      what is needed to go on: tile_progress.h
//
// Each key of index.json stands in libgtd/score/README.md.
#pragma once

#include <filesystem>

#include "libgtd/score/tile_store.h"

namespace libgtd {

// Whether the name ends in ".tiles", with or without a '/' after it.
bool is_tile_store_name(const std::filesystem::path& path);

// Throws Error naming the file: no store, no index (it says how many tiles are there where a run
// has not ended yet), no index of this format and version, or one whose parts do not fit.
TileStoreIndex read_tile_store(const std::filesystem::path& store);

// The same, but where all tiles are there and only the index is missing, as after shares that
// ended at the same time, it is made and written first.
TileStoreIndex finish_tile_store(const std::filesystem::path& store);

// The tile's file. Throws Error naming it if it is missing or its size is another one than the
// index says.
std::filesystem::path tile_path(const std::filesystem::path& store, const StoredTile& tile);

// The same, and its SHA-256 must be that of the index.
std::filesystem::path checked_tile_path(const std::filesystem::path& store, const StoredTile& tile);

}  // namespace libgtd
