// Makes the report of `graspmap refine` (--report) on each stage of the refinement.
#pragma once

#include <string>

#include "libmap/refine/refinement.h"

namespace graspmap_tools {

// Return the report as JSON and as text. `scan` is the path of the scan on the command line.
std::string refinement_json(const std::string& scan, const libmap::RefinementResult& result);
std::string refinement_text(const std::string& scan, const libmap::RefinementResult& result);

}  // namespace graspmap_tools
