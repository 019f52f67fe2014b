// Reads a mesh that is stored in many files (tiles), each tile with a margin of the surface around
// it. Memory depends on the size of a tile.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <filesystem>
#include <list>
#include <utility>
#include <vector>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

// A tile's mesh, followed by the triangles of the margin around the tile.
struct MeshWithMargin {
  TriangleMesh mesh;          // triangles of the tile, then of the margin
  std::size_t triangles = 0;  // number of triangles before the triangles of the margin
};

// Appends to `mesh` the triangles of `other` with a corner in `box` (x and y, m, borders included).
// A vertex of `other` at exactly the position of a vertex of `mesh` is replaced by it, which joins
// meshes with equal seams. Normals, colors and fields are treated as in append_mesh.
void append_part_within(const TriangleMesh& other, const Eigen::AlignedBox2d& box,
                        TriangleMesh& mesh);

class MeshTileIndex {
 public:
  // Reads each tile once. Throws Error naming the file that cannot be read.
  explicit MeshTileIndex(std::vector<std::filesystem::path> tiles);

  // Number of tiles. A tile's index is that of its path in the constructor's argument.
  std::size_t size() const { return tiles_.size(); }
  const std::filesystem::path& path(std::size_t tile) const { return tiles_[tile].path; }
  // Bounding box of the tile in x and y, m.
  const Eigen::AlignedBox2d& box(std::size_t tile) const { return tiles_[tile].box; }

  // Returns the tile and the triangles of other tiles with a corner within `margin_m` of box(tile).
  // Caches recently used tiles, up to 1 million triangles. Throws Error if a file cannot be read.
  MeshWithMargin with_margin(std::size_t tile, double margin_m);

 private:
  struct Tile {
    std::filesystem::path path;
    Eigen::AlignedBox2d box;
  };
  const TriangleMesh& mesh_of(const Tile& tile);

  std::vector<Tile> tiles_;
  std::list<std::pair<const Tile*, TriangleMesh>> kept_;  // most recently used first
};

}  // namespace libmap
