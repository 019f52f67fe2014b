// Reads a terrain that is stored in one or many cloud files, in blocks. For binary PCD and binary
// PLY without vertex lists, memory is proportional to the size of a block. Files of other encodings
// are read completely, one at a time. Only positions and normals are read. All DEMs (.tif) are in
// the local frame of the first DEM.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <vector>

#include "libmap/core/georeference.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/point_stream.h"
#include "libmap/io/cloud_io.h"

namespace libmap {

// Stream of all points of all files in order, in blocks of PointStream::block_points.
class TileStream : public PointStream {
 public:
  // Reads the headers. Throws Error naming the file if it cannot be read, or if only some files
  // have normals or are DEMs. If the files' viewpoints differ, the viewpoint is the identity
  // (unknown).
  explicit TileStream(std::vector<std::filesystem::path> tiles);

  const std::vector<std::filesystem::path>& tiles() const { return tiles_; }
  bool has_normals() const { return has_normals_; }
  const Pose& viewpoint() const { return viewpoint_; }
  // Georeference of the first DEM; nullopt for other files.
  const std::optional<Georeference>& georeference() const { return georeference_; }
  void for_each_block(Need need, const Visit& visit) const override;

 private:
  std::vector<std::filesystem::path> tiles_;
  bool has_normals_ = false;
  Pose viewpoint_ = Pose::Identity();
  std::optional<Georeference> georeference_;
};

struct TileInfo {
  std::size_t points = 0;  // points with a finite position
  std::size_t dropped_points = 0;
  Bounds3d box;
};
// Reads a file and returns the number and bounding box of the points. `georeference` is the
// TileStream's. Throws Error naming the file if it cannot be read.
TileInfo read_tile_info(const std::filesystem::path& tile,
                        const std::optional<Georeference>& georeference = std::nullopt);

struct TilesReadResult {
  PointCloud cloud;
  std::size_t dropped_points = 0;
};
// Reads all files into memory. Throws as TileStream does.
TilesReadResult read_tiles(const std::vector<std::filesystem::path>& tiles);

}  // namespace libmap
