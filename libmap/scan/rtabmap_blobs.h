// Numbers as an RTAB-Map database holds them, little-endian.
#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <string>
#include <string_view>

#include "libmap/core/pose_graph.h"

namespace libmap {

// RTAB-Map takes shorter blobs for absent (DBDriverSqlite3.cpp).
inline constexpr std::size_t absent_blob_bytes = 4;
inline bool is_absent(std::string_view blob) { return blob.size() <= absent_blob_bytes; }

// 12 float32, the rows of [R|t].
std::string to_blob(const Pose& pose);
std::string null_pose_blob();
// 36 float64, row by row: the symmetric part. g2o rejects a whole graph for one asymmetric bit.
std::string to_blob(const Matrix6d& information);
// 6 float32.
std::string to_blob(const std::array<double, 6>& velocity);
// 6 float64: stamp, longitude, latitude, altitude, error, bearing.
std::string to_blob(const GpsFix& fix);

// Admin.opt_ids and Admin.opt_poses.
struct OptimizedPoseBlobs {
  std::string ids;
  std::string poses;
};
OptimizedPoseBlobs to_blobs(const std::map<int, Pose>& map_from_base);

}  // namespace libmap
