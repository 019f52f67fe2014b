// A terrain in one or many cloud files, read block by block: memory goes with a block, not with a
// file, for binary PCD and for PLY that is binary without lists at its vertices. Files of other
// encodings are read whole, one at a time. Positions and normals alone are read. DEMs (.tif) are
// all in the local frame of the first one.
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

// All points of all pieces, one after the other, in blocks of PointStream::block_points.
class PieceStream : public PointStream {
 public:
  // Throws Error naming the file: it cannot be read, or only some pieces have normals or are DEMs.
  // Where the pieces' viewpoints differ, that of the whole is not known.
  explicit PieceStream(std::vector<std::filesystem::path> pieces);

  const std::vector<std::filesystem::path>& pieces() const { return pieces_; }
  bool has_normals() const { return has_normals_; }
  const Pose& viewpoint() const { return viewpoint_; }
  // Of pieces that are DEMs.
  const std::optional<Georeference>& georeference() const { return georeference_; }
  void for_each_block(Need need, const Visit& visit) const override;

 private:
  std::vector<std::filesystem::path> pieces_;
  bool has_normals_ = false;
  Pose viewpoint_ = Pose::Identity();
  std::optional<Georeference> georeference_;
};

struct TileInfo {
  std::size_t points = 0;  // with a position
  std::size_t dropped_points = 0;
  Bounds3d box;
};
// Reads the whole piece once; `georeference` is that of its PieceStream. Throws Error naming it if
// it cannot be read.
TileInfo survey_tile(const std::filesystem::path& piece,
                     const std::optional<Georeference>& georeference = std::nullopt);

struct PiecesReadResult {
  PointCloud cloud;
  std::size_t dropped_points = 0;
};
// All of it in memory.
PiecesReadResult read_pieces(const std::vector<std::filesystem::path>& pieces);

}  // namespace libmap
