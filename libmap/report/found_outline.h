// The outline of a run's report by what lies in its folder.
#pragma once

#include <filesystem>

#include "libmap/report/outline.h"

namespace libmap {

// The parameters of all maps side by side; a section for each folder that holds something to show,
// in natural order: maps with their looked-up points first, then scenes, pictures, charts, tables
// and texts; and the running times. Throws Error: no such folder, or nothing in it that a report
// could show.
Outline outline_of_folder(const std::filesystem::path& folder);

}  // namespace libmap
