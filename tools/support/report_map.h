// A graspability map with looked-up points as a report shows it.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>

#include "libmap/report/map_view.h"
#include "tools/support/run.h"

namespace graspmap_tools {

// Reads a map or tile store, downsampled to at most `max_cells` cells, in its terrain frame. With
// `lookup`, a CSV file as `lookup` writes it, the view has a marker for each of its rows. Throws
// Error: the map or its points cannot be read.
libmap::MapView load_map_view(const std::filesystem::path& map,
                              const std::optional<std::filesystem::path>& lookup,
                              std::size_t max_cells, Run& run);

}  // namespace graspmap_tools
