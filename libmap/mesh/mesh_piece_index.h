// Access to a mesh in many files: each piece with the surface around it. Memory depends on the size
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

// A mesh followed by the surface around it.
struct MeshWithMargin {
  TriangleMesh mesh;
  std::size_t triangles = 0;  // number of triangles before those of the margin
};

// Appends the triangles of `other` with a corner in `box` (x and y, borders included). Vertices of
// `other` at exactly the position of an existing vertex are replaced by it, which joins meshes with
// equal seams. Normals, colors and fields are treated as in append_mesh.
void append_part_within(const TriangleMesh& other, const Eigen::AlignedBox2d& box,
                        TriangleMesh& mesh);

class MeshPieceIndex {
 public:
  // Reads each piece once. Throws Error naming the file that cannot be read.
  explicit MeshPieceIndex(std::vector<std::filesystem::path> pieces);

  // Number of pieces; indices are those of the given paths.
  std::size_t size() const { return pieces_.size(); }
  const std::filesystem::path& path(std::size_t piece) const { return pieces_[piece].path; }
  // Bounding box in x and y.
  const Eigen::AlignedBox2d& box(std::size_t piece) const { return pieces_[piece].box; }

  // Returns the piece, and the triangles of other pieces with a corner within `margin_m` of its
  // box. Caches recently used pieces, up to 1 million triangles. Throws Error if a file cannot be
  // read.
  MeshWithMargin with_margin(std::size_t piece, double margin_m);

 private:
  struct Piece {
    std::filesystem::path path;
    Eigen::AlignedBox2d box;
  };
  const TriangleMesh& mesh_of(const Piece& piece);

  std::vector<Piece> pieces_;
  std::list<std::pair<const Piece*, TriangleMesh>> kept_;  // most recently used first
};

}  // namespace libmap
