// `graspmap grasp --map`: the virtual field test at the candidates among a map's voxels.
#pragma once

#include <string>
#include <vector>

#include "libgtd/grasp/grasp_trials.h"
#include "libmap/core/triangle_mesh.h"
#include "tools/support/run.h"

namespace graspmap_tools {

struct GraspMapInput {
  std::string mesh_file;
  std::string map_file;
  std::string output;
  std::string parameters_hash;  // of gripper and options
};

// The fields that the output has more than the map.
const std::vector<std::string>& grasp_fields();

// Writes the map with the fields. Squares of 1 m are done one after the other and kept in the
// folder OUTPUT.progress until the output is there: a run that was killed is taken up again. Throws
// Error: the map is empty or has one of the fields, or none of its voxels is on the mesh.
void grasp_map(const GraspMapInput& input, const libmap::TriangleMesh& mesh,
               const libgtd::Gripper& gripper, const libgtd::GraspOptions& options, Run& run);

}  // namespace graspmap_tools
