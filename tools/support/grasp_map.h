// `graspmap grasp --map`: the virtual field test at the candidates among a map's voxels.
#pragma once

#include <string>
#include <vector>

#include "libgtd/grasp/grasp_trials.h"
#include "libmap/tiles/tile_share.h"
#include "tools/support/ground_pieces.h"
#include "tools/support/run.h"

namespace graspmap_tools {

struct GraspMapInput {
  std::string mesh_file;
  std::string map_file;  // or a tile store
  std::string output;    // or a tile store
  libmap::TileShare share;
  std::string parameters_hash;  // of gripper and options
};

// The fields that the output has more than the map.
const std::vector<std::string>& grasp_fields();

// Before any work. Throws Error: the output is no map's file or tile store, or cannot be written.
void require_map_output(const GraspMapInput& input, Run& run);

// Writes the map with the fields. Tiles are done one after the other in a tile store, the output or
// OUTPUT.progress, which goes when the map in one file is there: a run that was killed is resumed.
// The run's manifest has the inputs. Throws Error: the map is empty or has one of the fields, or
// none of its voxels is on the mesh, or the store is of something else.
void grasp_map(const GraspMapInput& input, GroundPieces& ground, const libgtd::Gripper& gripper,
               const libgtd::GraspOptions& options, Run& run);

}  // namespace graspmap_tools
