// The pieces of a mesh in many files, each with the surface around it: memory depends on the size
// of a piece.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <filesystem>
#include <list>
#include <utility>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

// A mesh with what is around it behind its own vertices and triangles.
struct MeshWithMargin {
  TriangleMesh mesh;
  std::size_t triangles = 0;  // the first so many are its own
};

// Appends the triangles of `other` with a corner in `box` (x and y, borders included). Vertices of
// `other` at exactly the position of one that is there become that one, so that meshes with equal
// seams are joined along them. Normals, colors and fields of `other` are kept as append_mesh does.
void append_part_within(const TriangleMesh& other, const Eigen::AlignedBox2d& box,
                        TriangleMesh& mesh);

class MeshPieceIndex {
 public:
  // Reads each piece once. Throws Error naming the file that cannot be read.
  explicit MeshPieceIndex(std::vector<std::filesystem::path> pieces);

  // Pieces are in the order of their paths as given.
  std::size_t size() const { return pieces_.size(); }
  const std::filesystem::path& path(std::size_t piece) const { return pieces_[piece].path; }
  // Of its vertices, x and y.
  const Eigen::AlignedBox2d& box(std::size_t piece) const { return pieces_[piece].box; }

  // The piece, and of the others the triangles with a corner within `margin_m` of its bounding box
  // in x and y. The pieces read last are kept, up to 1 million triangles.
  MeshWithMargin with_margin(std::size_t piece, double margin_m);

 private:
  struct Piece {
    std::filesystem::path path;
    Eigen::AlignedBox2d box;
  };
  const TriangleMesh& mesh_of(const Piece& piece);

  std::vector<Piece> pieces_;
  std::list<std::pair<const Piece*, TriangleMesh>> kept_;  // the last used first
};

}  // namespace libmap
