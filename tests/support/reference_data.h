// Readers of the exact outputs of the thesis author's program in the folder GRASPMAP_REFERENCE. All
// throw std::runtime_error naming a file that cannot be read.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace graspmap_test {

// Returns the decompressed content of a .gz file.
std::string read_gz(const std::filesystem::path& path);

// NAME.transformed.f32.gz, NAME.interpolated.f32.gz: float32 x y z, little-endian.
std::vector<Eigen::Vector3f> read_points_f32_gz(const std::filesystem::path& path);

// NAME.scores.csv.gz: one row per pivot, in the program's order.
struct ReferenceScores {
  std::vector<std::array<int, 5>> rows;  // i, j, k, ssv, gsv
  std::vector<double> score_percent;
};
ReferenceScores read_scores_gz(const std::filesystem::path& path);

// NAME.voxels.csv.gz: the occupied voxels.
struct ReferenceVoxels {
  std::array<int, 3> dims{};
  std::vector<std::array<int, 3>> voxels;  // i, j, k
};
ReferenceVoxels read_voxels_gz(const std::filesystem::path& path);

// mask.METHOD.GRIPPER.SIZE.txt; the layer z = 0 is the lowest.
struct ReferenceMask {
  std::array<int, 3> dims{};
  std::vector<std::uint8_t> cells;  // z outermost, then x, then y: 0 or 1

  std::uint8_t at(int x, int y, int z) const {
    const int cell = (z * dims[0] + x) * dims[1] + y;
    return cells[static_cast<std::size_t>(cell)];
  }
};
ReferenceMask read_mask(const std::filesystem::path& path);

// NAME.frame.txt: terrain frame, p' = rotation^T (p - centroid), and numbers of points.
struct ReferenceFrame {
  int points_in = 0;
  int downsampled = 0;
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d min_of_voxelized = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3f> transformed;  // the first points
  // 0 and empty if the points were not interpolated.
  double grid_spacing = 0;
  double x_width = 0;
  double y_width = 0;
  int interpolated_count = 0;
  std::vector<Eigen::Vector3f> interpolated;  // the first points
};
ReferenceFrame read_frame(const std::filesystem::path& path);

}  // namespace graspmap_test
