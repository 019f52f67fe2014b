// Report of `graspmap refine` (--report) on each stage of the refinement, as JSON and as text.
#pragma once

#include <string>

#include "libmap/refine/refinement.h"

namespace graspmap_tools {

std::string refinement_json(const std::string& scan, const libmap::RefinementResult& result);
std::string refinement_text(const std::string& scan, const libmap::RefinementResult& result);

}  // namespace graspmap_tools
