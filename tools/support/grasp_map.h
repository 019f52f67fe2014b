// Virtual field test at the candidate voxels of a map, for `graspmap grasp --map`.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <list>
#include <optional>
#include <string>
#include <vector>

#include "libgtd/grasp/grasp_trials.h"
#include "libgtd/grasp/grip_candidates.h"
#include "libgtd/grasp/ground.h"
#include "libmap/mesh/mesh_tile_index.h"
#include "libmap/tiles/tile_share.h"
#include "tools/support/run.h"

namespace graspmap_tools {

// Ground of the virtual field test: a mesh in one file, or in a folder of tiles, of which at most
// three are in memory.
class GroundTiles {
 public:
  // Mesh of one tile and of the surroundings within reach of a gripper.
  struct MeshTile {
    const libmap::TriangleMesh mesh;
    const libgtd::Ground ground;              // `mesh` as ground
    const libgtd::GripCandidates from_above;  // prefilter for approach from above
  };
  using MakeGround = std::function<libgtd::Ground(const libmap::TriangleMesh& mesh)>;

  // `mesh`: a file or a folder of tiles. `start_height_m`: height above a location at which the
  // approach starts. `gripper` must outlive the object. Throws Error naming an unreadable file.
  GroundTiles(const std::string& mesh, const libgtd::Gripper& gripper, double start_height_m,
              MakeGround make_ground);

  // Returns the index of the tile that contains the position's x and y (m, mesh frame): of several
  // tiles, the tile with the nearest center; if there is none, the nearest tile.
  std::size_t tile_at(const Eigen::Vector3d& position) const;

  // Returns the tile with this index; the reference is valid until three other tiles are requested.
  const MeshTile& mesh_tile(std::size_t number);

 private:
  struct Kept : MeshTile {
    Kept(std::size_t of, libmap::TriangleMesh around, const GroundTiles& ground_tiles);
    std::size_t number = 0;
  };

  const libgtd::Gripper& gripper_;
  double start_height_m_ = 0.0;
  double margin_m_ = 0.0;
  MakeGround make_ground_;
  std::vector<std::filesystem::path> files_;
  std::optional<libmap::MeshTileIndex> index_;  // only for several files
  std::list<Kept> kept_;                        // last used first
};

struct GraspMapInput {
  std::string mesh_file;
  std::string map_file;         // map in one file, or a tile store
  std::string output;           // map in one file, or a tile store
  libmap::TileShare share;      // tiles that this run processes
  std::string parameters_hash;  // hash of gripper and options
};

// Names of the fields that are added to the map.
const std::vector<std::string>& grasp_fields();

// Checks the output, and claims an output that is one file. Throws Error if the output cannot be
// used, or if a share is combined with --force or with an output that is one file.
void require_map_output(const GraspMapInput& input, Run& run);

// Writes the map with the added fields. Tiles are processed in a tile store, so that a killed run
// can be resumed. The store is the output, or OUTPUT.progress for a map in one file, which is
// removed at the end. The run's manifest must have the inputs. Throws Error if the map is empty or
// has the field grasp_trials, no voxel is on the mesh, or the output has tiles of other inputs.
void grasp_map(const GraspMapInput& input, GroundTiles& ground, const libgtd::Gripper& gripper,
               const libgtd::GraspOptions& options, Run& run);

}  // namespace graspmap_tools
