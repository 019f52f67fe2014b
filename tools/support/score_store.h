// graspmap score into a tile store.
#pragma once

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

// Says what decided which side of the plane is up, unless it was given; warns where that was the
// frame's z axis and the relief says otherwise, as of a cloud in a camera's frame, whose z axis
// points into the ground.
void report_plane(const libgtd::RegressionPlane& plane, const std::string& terrain, Run& run);

// Throws Error if no point is left, warns of those that were dropped.
void require_points(std::size_t points, std::size_t dropped, const std::string& terrain, Run& run);

// Scores those tiles of the share that are missing in the store, which is made if there is none.
void score_into_store(const ScoreStoreOptions& options, Run& run);

}  // namespace graspmap_tools
