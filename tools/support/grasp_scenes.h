// `graspmap grasp --scenes`: meshes that show a gripper in a trial at a location.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "libgtd/grasp/grasp_trials.h"
#include "libmap/core/table.h"
#include "tools/support/run.h"

namespace graspmap_tools {

struct GraspScenesOptions {
  std::string folder;                  // empty: no scenes
  std::vector<std::string> locations;  // empty: all locations
};

struct GraspScene {
  std::size_t row = 0;  // row of the location
  std::string file;     // name of the scene, PLACE.ply
};

struct GraspScenesInput {
  const libmap::TriangleMesh& mesh;
  const libgtd::Ground& ground;
  const libgtd::Gripper& gripper;
  const libgtd::GraspOptions& options;
  const std::vector<libgtd::LocationResult>& results;
};

// Returns the names of the locations: the column `place`, or the numbers of the rows, from 1.
std::vector<std::string> names_of(const libmap::Table& locations);

// Claims the folder. Throws Error if another command wrote it, or for locations without a folder.
void claim_scenes(const GraspScenesOptions& options, Run& run);

// Returns the scenes to write. Throws Error for a location that is not in the table, two with the
// same file name, or too many without a list.
std::vector<GraspScene> scenes_of(const libmap::Table& locations,
                                  const GraspScenesOptions& options);

// Writes the scenes and adds one result per scene to the manifest, the text of its trial.
void write_scenes(const GraspScenesOptions& options, const std::vector<GraspScene>& scenes,
                  const GraspScenesInput& input, Run& run);

}  // namespace graspmap_tools
