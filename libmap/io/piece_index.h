// Points near a place, of a terrain in one or many cloud files, with their normals, colors and
// fields: memory depends on the size of a piece and of what is asked for.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <list>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/point_cloud.h"

namespace libmap {

class PieceIndex {
 public:
  // Reads each piece once and calls visit(cloud) with it. Throws Error naming the file: it cannot
  // be read, or only some pieces have normals.
  using Visit = std::function<void(const PointCloud& piece)>;
  PieceIndex(std::vector<std::filesystem::path> pieces, const Visit& visit);

  std::size_t points() const { return points_; }
  std::size_t dropped_points() const { return dropped_; }  // whose position is not finite

  // The points with low <= (x, y) < high, piece by piece in their order, with the colors and fields
  // that all pieces there have. The pieces read last are kept, up to 4 million points.
  PointCloud points_in(const Eigen::Vector2d& low, const Eigen::Vector2d& high);

 private:
  struct Piece {
    std::filesystem::path path;
    Bounds3d box;
  };
  const PointCloud& cloud_of(const Piece& piece);

  std::vector<Piece> pieces_;  // that have points
  bool has_normals_ = false;
  std::size_t points_ = 0;
  std::size_t dropped_ = 0;
  std::list<std::pair<const Piece*, PointCloud>> kept_;  // the last used first
};

}  // namespace libmap
