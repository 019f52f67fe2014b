// What `graspmap fuse` keeps of a fusion in tiles, for other shares and for a run after a kill. All
// numbers come back bit for bit.
#pragma once

#include <nlohmann/json.hpp>

#include "libmap/cloud/depth_fusion.h"

namespace graspmap_tools {

nlohmann::json facts_of(const libmap::FusionSurvey& survey);
libmap::FusionSurvey fusion_survey_of(const nlohmann::json& facts);

nlohmann::json facts_of(const libmap::FusionCounts& counts);
libmap::FusionCounts fusion_counts_of(const nlohmann::json& facts);

}  // namespace graspmap_tools
