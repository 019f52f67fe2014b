// The ground of the virtual field test: a mesh in one file, or in a folder of pieces of which a few
// are in memory.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <list>
#include <optional>
#include <string>
#include <vector>

#include "libgtd/grasp/grip_candidates.h"
#include "libgtd/grasp/ground.h"
#include "libmap/mesh/mesh_piece_index.h"

namespace graspmap_tools {

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

}  // namespace graspmap_tools
