// The index of a tile store and its tiles as JSON. Inner part of libgtd/score, for its .cc files.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "libgtd/score/tile_store.h"
#include "libmap/core/error.h"
#include "libmap/core/json_input.h"

namespace libgtd {

using Json = nlohmann::ordered_json;

Json json_of(const StoredTile& tile);
Json json_of(const TileStoreIndex& index);  // ends in "tiles"

// Throw nlohmann's exceptions for keys that are missing or of another type, and Error for values
// that cannot be. `index` tells the tiles' width and the map's box.
StoredTile tile_from(const Json& json, const TileStoreIndex& index);
// `file` is named in Errors; with its tiles, if `json` has any.
TileStoreIndex index_from(const Json& json, const std::string& file);

Json json_of(const Voxel& voxel);
Json json_of(const Eigen::Vector3d& vector);
Eigen::Vector3d vector_from(const Json& json);

// Parses `text` and calls read(json); whatever goes wrong is an Error naming `file`.
template <typename Read>
auto read_json(const std::string& text, const std::string& file, const char* what,
               const Read& read) {
  try {
    return read(libmap::parse_json<Json>(text));
  } catch (const nlohmann::json::exception& error) {
    // "[json.exception.KIND.NUMBER] REASON"
    const std::string reason = error.what();
    throw libmap::Error(std::string("is no ") + what + ": " + reason.substr(reason.find("] ") + 2),
                        {.file = file});
  } catch (const libmap::Error& error) {
    throw error.in_file(file);
  }
}

}  // namespace libgtd
