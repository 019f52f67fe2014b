// A terrain in one or many cloud files, read block by block: memory goes with a block, not with a
// file, for binary PCD and for PLY that is binary without lists at its vertices. Files of other
// encodings are read whole, one at a time. Positions and normals alone are read.
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/core/point_stream.h"

namespace libmap {

// The file itself, or the cloud files of a folder in the order of their names; hidden files are
// passed over. Throws Error: nothing there, or a folder without a cloud file.
std::vector<std::filesystem::path> cloud_pieces(const std::filesystem::path& file_or_folder);

// All points of all pieces, one after the other, in blocks of PointStream::block_points.
class PieceStream : public PointStream {
 public:
  // Throws Error naming the file: it cannot be read, or only some pieces have normals. Where the
  // pieces' viewpoints differ, that of the whole is not known.
  explicit PieceStream(std::vector<std::filesystem::path> pieces);

  const std::vector<std::filesystem::path>& pieces() const { return pieces_; }
  bool has_normals() const { return has_normals_; }
  const Pose& viewpoint() const { return viewpoint_; }
  void for_each_block(Need need, const Visit& visit) const override;

 private:
  std::vector<std::filesystem::path> pieces_;
  bool has_normals_ = false;
  Pose viewpoint_ = Pose::Identity();
};

struct PieceFacts {
  std::size_t points = 0;  // with a position
  std::size_t dropped_points = 0;
  Bounds3d box;
};
// Reads the whole piece once. Throws Error naming it if it cannot be read.
PieceFacts survey_piece(const std::filesystem::path& piece);

struct PiecesReadResult {
  PointCloud cloud;
  std::size_t dropped_points = 0;
};
// All of it in memory.
PiecesReadResult read_pieces(const std::vector<std::filesystem::path>& pieces);

}  // namespace libmap
