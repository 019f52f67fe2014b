// Access to the points of a terrain in one or many cloud files by rectangle, with normals, colors
// and fields. Memory depends on the size of a file and of the result.
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

class TileIndex {
 public:
  // Reads each file once and calls visit(cloud). Throws Error naming the file if it cannot be read,
  // or if only some files have normals.
  using Visit = std::function<void(const PointCloud& tile)>;
  TileIndex(std::vector<std::filesystem::path> tiles, const Visit& visit);

  std::size_t points() const { return points_; }
  std::size_t dropped_points() const { return dropped_; }  // points that are not finite

  // Returns the points with low <= (x, y) < high in the order of the files, with the colors and
  // fields that all files in the rectangle have. Caches the last files, up to 4 million points.
  PointCloud points_in(const Eigen::Vector2d& low, const Eigen::Vector2d& high);

 private:
  struct Tile {
    std::filesystem::path path;
    Bounds3d box;
  };
  const PointCloud& cloud_of(const Tile& tile);

  std::vector<Tile> tiles_;  // files with points
  bool has_normals_ = false;
  std::size_t points_ = 0;
  std::size_t dropped_ = 0;
  std::list<std::pair<const Tile*, PointCloud>> kept_;  // cache, the most recently used first
};

}  // namespace libmap
