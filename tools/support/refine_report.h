// Makes the report of `graspmap refine` (--report) on each stage of the refinement.
#pragma once

#include <string>

#include "libmap/refine/refinement.h"

namespace graspmap_tools {

// `scan` is the scan's path, as the user named it.
std::string refinement_json(const std::string& scan, const libmap::RefinementResult& result);
std::string refinement_text(const std::string& scan, const libmap::RefinementResult& result);

}  // namespace graspmap_tools
