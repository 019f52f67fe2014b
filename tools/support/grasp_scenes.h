// `graspmap grasp --scenes FOLDER`: pictures that explain the verdicts.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "libgtd/grasp/grasp_trials.h"
#include "libmap/core/table.h"
#include "tools/support/run.h"

namespace graspmap_tools {

struct GraspScenesOptions {
  std::string folder;               // empty: no pictures
  std::vector<std::string> places;  // none: all
};

// Before the work. Throws Error: a folder that is no output of this command, or places without it.
void claim_scenes(const GraspScenesOptions& options, Run& run);

struct GraspScene {
  std::size_t row = 0;  // of the locations
  std::string file;     // PLACE.ply
};

// Throws Error: a place that is not in the table, two with one name, or too many without a list.
std::vector<GraspScene> scenes_of(const libmap::Table& locations,
                                  const GraspScenesOptions& options);

struct GraspScenesInput {
  const libmap::TriangleMesh& mesh;
  const libgtd::Ground& ground;
  const libgtd::Gripper& gripper;
  const libgtd::GraspOptions& options;
  const std::vector<libgtd::LocationResult>& results;
};

// Also a result of the run for each: FILE, what its location and the trial that it shows came to.
void write_scenes(const GraspScenesOptions& options, const std::vector<GraspScene>& scenes,
                  const GraspScenesInput& input, Run& run);

}  // namespace graspmap_tools
