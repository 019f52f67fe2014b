// `graspmap grasp --map`: the virtual field test at the candidates among a map's voxels.
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
#include "libmap/mesh/mesh_piece_index.h"
#include "libmap/tiles/tile_share.h"
#include "tools/support/run.h"

namespace graspmap_tools {

// The ground of the virtual field test: a mesh in one file, or in a folder of pieces of which a few
// are in memory.
class GroundPieces {
 public:
  // A piece and the mesh around it, as far as a gripper on the piece may come.
  struct Piece {
    const libmap::TriangleMesh mesh;
    const libgtd::Ground ground;  // of `mesh`
    const libgtd::GripCandidates from_above;
  };
  using MakeGround = std::function<libgtd::Ground(const libmap::TriangleMesh& mesh)>;

  // Throws Error naming the file that cannot be read, or the gripper's missing section.
  GroundPieces(const std::string& mesh, const libgtd::Gripper& gripper, double start_height_m,
               MakeGround make_ground);

  // The piece whose middle is nearest among those at the place, or nearest to it, in x and y.
  // It depends on the pieces alone.
  std::size_t piece_at(const Eigen::Vector3d& place) const;

  // It stays until two others have been asked for.
  const Piece& piece(std::size_t number);

 private:
  struct Kept : Piece {
    Kept(std::size_t of, libmap::TriangleMesh around, const GroundPieces& pieces);
    std::size_t number = 0;
  };

  const libgtd::Gripper& gripper_;
  double start_height_m_ = 0.0;
  double margin_m_ = 0.0;
  MakeGround make_ground_;
  std::vector<std::filesystem::path> files_;
  std::optional<libmap::MeshPieceIndex> index_;  // of several files
  std::list<Kept> kept_;                         // the last used first
};

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
