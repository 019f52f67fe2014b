// Reads a terrain that is stored in one or many cloud files ("tiles"), in blocks or by rectangle.
//
// In blocks, only positions and normals are read. For binary PCD and binary PLY without vertex
// lists, memory is proportional to the size of a block. Files of other encodings are read
// completely, one at a time. All DEMs (.tif) are in the local frame of the first DEM.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <list>
#include <optional>
#include <utility>
#include <vector>

#include "libmap/core/georeference.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/point_stream.h"
#include "libmap/io/cloud_io.h"

namespace libmap {

// Stream of all points of all files in order, in blocks of PointStream::block_points.
class TileStream : public PointStream {
 public:
  // Reads the headers. Throws Error naming the file if it cannot be read, if only some files have
  // normals, or if only some files are DEMs.
  explicit TileStream(std::vector<std::filesystem::path> tiles);

  const std::vector<std::filesystem::path>& tiles() const { return tiles_; }
  bool has_normals() const { return has_normals_; }
  // Viewpoint of all files (cloud_from_sensor); the identity if the files' viewpoints differ.
  const Pose& viewpoint() const { return viewpoint_; }
  // Georeference of the first DEM; nullopt without DEMs.
  const std::optional<Georeference>& georeference() const { return georeference_; }
  void for_each_block(Need need, const Visit& visit) const override;

 private:
  std::vector<std::filesystem::path> tiles_;
  bool has_normals_ = false;
  Pose viewpoint_ = Pose::Identity();
  std::optional<Georeference> georeference_;
};

struct TileInfo {
  std::size_t points = 0;          // points with a finite position
  std::size_t dropped_points = 0;  // CloudReadResult::dropped_points
  Bounds3d box;                    // bounding box of `points`, m; zeros if there are none
};
// Reads a file and returns the number and bounding box of its points. A DEM is read in the local
// frame of `georeference`, by default in its own. Throws Error naming the file if it is unreadable.
TileInfo read_tile_info(const std::filesystem::path& tile,
                        const std::optional<Georeference>& georeference = std::nullopt);

struct TilesReadResult {
  PointCloud cloud;                // positions and normals
  std::size_t dropped_points = 0;  // CloudReadResult::dropped_points, of all files
};
// Reads all files into one cloud. Throws as TileStream does.
TilesReadResult read_tiles(const std::vector<std::filesystem::path>& tiles);

// Reads the points in a rectangle from one or many cloud files, with normals, colors and fields.
// DEMs are read in the local frame of the first DEM. Memory depends on the size of a file.
class TileIndex {
 public:
  // Reads each file once and calls visit(cloud) for each file with points. Throws Error naming the
  // file if it cannot be read, or if only some files have normals.
  using Visit = std::function<void(const PointCloud& tile)>;
  TileIndex(std::vector<std::filesystem::path> tiles, const Visit& visit);

  std::size_t points() const { return points_; }           // finite points of all files
  std::size_t dropped_points() const { return dropped_; }  // sum over files, as CloudReadResult

  // Returns the points with low <= (x, y) < high, m, in the order of the files, with the colors and
  // fields that all files of these points have. Caches recently used files, up to 4 million points.
  PointCloud points_in(const Eigen::Vector2d& low, const Eigen::Vector2d& high);

 private:
  struct Tile {
    std::filesystem::path path;
    Bounds3d box;
  };
  const PointCloud& cloud_of(const Tile& tile);

  std::vector<Tile> tiles_;            // files with points
  std::optional<Georeference> frame_;  // of the first DEM
  bool has_normals_ = false;
  std::size_t points_ = 0;
  std::size_t dropped_ = 0;
  std::list<std::pair<const Tile*, PointCloud>> kept_;  // cache, the most recently used first
};

}  // namespace libmap
