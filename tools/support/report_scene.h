// A trial of the virtual field test as a report shows it.
#pragma once

#include <filesystem>

#include "libmap/report/report_content.h"

namespace graspmap_tools {

// Takes what the scene needs in the page off `bytes_left`. Throws Error: it cannot be read, or
// needs more than is left.
libmap::ReportScene load_report_scene(const std::filesystem::path& path, double& bytes_left);

}  // namespace graspmap_tools
