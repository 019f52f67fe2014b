// What `graspmap info` says of a tile store.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "libmap/core/progress.h"

namespace graspmap_tools {

struct TilesInfo {
  nlohmann::ordered_json json;
  std::vector<std::string> faults;  // found with `verify`: one line per tile that is broken
};
TilesInfo tiles_info(const std::string& store, bool verify, libmap::Progress& progress);

}  // namespace graspmap_tools
