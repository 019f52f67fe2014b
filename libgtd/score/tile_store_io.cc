#include "libgtd/score/tile_store_io.h"

#include "libgtd/score/tile_progress_io.h"
#include "libgtd/score/tile_store_json.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"

namespace libgtd {

namespace fs = std::filesystem;

namespace {

constexpr std::uint64_t max_index_bytes = std::uint64_t{1} << 33;

fs::path require_store(const fs::path& store) {
  if (!fs::exists(store)) throw libmap::Error("no such tile store", {.file = store.string()});
  if (!fs::is_directory(store))
    throw libmap::Error("is a file, not a tile store", {.file = store.string()});
  return store / "index.json";
}

// Where a run has not ended: how far it is.
libmap::Error not_complete(const fs::path& store) {
  const TileProgress progress(store);
  const auto plan = progress.plan();
  if (!plan)
    return libmap::Error("is no tile store: it has no index.json", {.file = store.string()});
  const TileProgress::Completion completion = progress.complete(*plan);
  if (completion.index)
    return libmap::Error("has all its tiles but no index.json yet: scoring again writes it",
                         {.file = store.string()});
  return libmap::Error("is not complete: " + std::to_string(completion.done) + " of " +
                           std::to_string(completion.tiles) +
                           " tiles are there; scoring again adds the others",
                       {.file = store.string()});
}

// A plan knows tiles without voxels, an index does not: they have no file to be read.
TileStoreIndex listed(TileStoreIndex index) {
  for (const StoredTile& tile : index.tiles)
    if (tile.voxels == 0)
      throw libmap::Error(
          "lists a tile without voxels",
          {.field = "tiles",
           .value = std::to_string(tile.number.i) + ", " + std::to_string(tile.number.j)});
  return index;
}

}  // namespace

bool is_tile_store_name(const fs::path& path) {
  const fs::path name = path.has_filename() ? path.filename() : path.parent_path().filename();
  return name.extension() == ".tiles";
}

TileStoreIndex read_tile_store(const fs::path& store) {
  const fs::path path = require_store(store);
  if (!fs::exists(path)) throw not_complete(store);
  const std::string text = libmap::read_whole_file(path, max_index_bytes);
  return read_json(text, path.string(), "index of a tile store",
                   [&](const Json& json) { return listed(index_from(json, path.string())); });
}

TileStoreIndex finish_tile_store(const fs::path& store) {
  const fs::path path = require_store(store);
  if (fs::exists(path)) return read_tile_store(store);
  const TileProgress progress(store);
  if (!progress.plan()) throw not_complete(store);
  const libmap::FileLock lock = progress.lock();
  const auto plan = progress.plan();
  if (plan && !fs::exists(path)) {
    const TileProgress::Completion completion = progress.complete(*plan);
    if (completion.index) progress.write_index(*completion.index, completion.index->manifest);
  }
  return read_tile_store(store);
}

fs::path tile_path(const fs::path& store, const StoredTile& tile) {
  fs::path path = store / tile.file;
  libmap::require_readable_file(path);
  const std::uint64_t bytes = fs::file_size(path);
  if (bytes != tile.bytes)
    throw libmap::Error("is not the tile that the index lists: scoring once more makes it again",
                        {.file = path.string(),
                         .field = "size",
                         .value = std::to_string(bytes) + " bytes",
                         .bound = std::to_string(tile.bytes)});
  return path;
}

fs::path checked_tile_path(const fs::path& store, const StoredTile& tile) {
  fs::path path = tile_path(store, tile);
  if (libmap::sha256_of_file(path) != tile.sha256)
    throw libmap::Error("is not the tile that the index lists: scoring once more makes it again",
                        {.file = path.string(), .field = "SHA-256"});
  return path;
}

}  // namespace libgtd
