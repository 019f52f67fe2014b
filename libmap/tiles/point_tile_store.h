// Temporary store of a large terrain's points on disk, sorted into tiles (xy_tile.h), so that the
// points in a rectangle can be read without reading the other tiles.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <utility>
#include <vector>

#include "libmap/core/file_output.h"
#include "libmap/core/point_cloud.h"
#include "libmap/tiles/xy_tile.h"

namespace libmap {

struct PointTileStoreOptions {
  double tile_m = 1.0;                                // > 0: side of a tile
  bool has_normals = false;                           // true to store the points' normals
  std::size_t buffer_bytes = std::size_t{64} << 20U;  // buffered bytes before a write to disk
};

class PointTileStore {
 public:
  // Uses 32 bytes of disk per point, 44 with normals, in a TempFile in `folder`. All functions
  // throw Error (failed) if the file cannot be created, written or read.
  PointTileStore(const std::filesystem::path& folder, const PointTileStoreOptions& options);

  // Adds points (with normals if has_normals), finite and less than 2^40 tiles from the origin.
  void add(const PointCloud& cloud);
  // Writes the buffered points. Call it after the last add(), to release memory.
  void finish() { flush(); }

  // Returns the points (positions and normals) with low <= (x, y) <= high, m, in the order of
  // add(). Reads the tiles that intersect the rectangle.
  PointCloud points_in(const Eigen::Vector2d& low, const Eigen::Vector2d& high) const;
  // Returns the number of points of all tiles that intersect the rectangle, an upper bound of the
  // number of points in the rectangle.
  std::size_t count_in(const Eigen::Vector2d& low, const Eigen::Vector2d& high) const;
  std::size_t size() const { return size_; }  // number of points

 private:
  struct Extent {
    std::uint64_t begin = 0;
    std::size_t bytes = 0;
  };
  struct Records {
    std::vector<char> buffer;  // not yet written
    std::vector<Extent> written;
    std::size_t count = 0;
  };
  void flush();
  void read_tile(const Records& records, std::vector<char>& bytes) const;
  template <typename Visit>
  void for_tiles_in(const Eigen::Vector2d& low, const Eigen::Vector2d& high,
                    const Visit& visit) const;

  TempFile file_;
  PointTileStoreOptions options_;
  std::size_t record_bytes_ = 0;
  std::size_t buffered_ = 0;
  std::size_t size_ = 0;
  std::map<XyTile, Records> tiles_;
};

}  // namespace libmap
