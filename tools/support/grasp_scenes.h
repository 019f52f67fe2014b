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
  std::size_t row = 0;  // row of the location, from 0
  std::string file;     // name of the scene file, NAME.ply
};

struct GraspScenesInput {
  const libmap::TriangleMesh& mesh;
  const libgtd::Ground& ground;
  const libgtd::Gripper& gripper;
  const libgtd::GraspOptions& options;
  const std::vector<libgtd::LocationResult>& results;
};

// Returns the names of the locations: the column `place`, else the numbers of the rows, from 1.
std::vector<std::string> names_of(const libmap::Table& locations);

// Claims the folder. Throws Error if another command wrote it, or for locations without a folder.
void claim_scenes(const GraspScenesOptions& options, Run& run);

// Returns the scenes to write; none without a folder. Throws Error for a location that is not in
// the table, two equal file names, or more than 100 scenes without a list of locations.
std::vector<GraspScene> scenes_of(const libmap::Table& locations,
                                  const GraspScenesOptions& options);

// Writes the scenes. Adds a description of each scene's trial to the manifest as a result.
void write_scenes(const GraspScenesOptions& options, const std::vector<GraspScene>& scenes,
                  const GraspScenesInput& input, Run& run);

}  // namespace graspmap_tools
