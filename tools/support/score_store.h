// graspmap score into a tile store.
#pragma once

#include <filesystem>
#include <string>

#include "libgtd/detect.h"
#include "libgtd/score/graspability_map.h"
#include "tools/support/run.h"

namespace graspmap_tools {

struct ScoreStoreOptions {
  std::string terrain;  // a cloud file or a folder of such
  std::string store;
  std::filesystem::path gripper_file;
  libgtd::MapFrame frame = libgtd::MapFrame::terrain;
  bool append = false;
  std::size_t points_at_once = 1'000'000;
  libgtd::DetectionOptions detection;  // with the share
};

// Scores those tiles of the share that are missing in the store, which is made if there is none.
void score_into_store(const ScoreStoreOptions& options, Run& run);

}  // namespace graspmap_tools
