// Numbers as an RTAB-Map database holds them, little-endian.
#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "libmap/core/pose_graph.h"

namespace libmap {

// RTAB-Map takes shorter blobs for absent (DBDriverSqlite3.cpp).
inline constexpr std::size_t absent_blob_bytes = 4;
inline bool is_absent(std::string_view blob) { return blob.size() <= absent_blob_bytes; }

// 12 float32, the rows of [R|t].
inline constexpr std::size_t pose_bytes = 48;
std::string to_blob(const Pose& pose);
std::string null_pose_blob();
// 36 float64, row by row: the symmetric part. g2o rejects a whole graph for one asymmetric bit.
std::string to_blob(const Matrix6d& information);
// 6 float32.
std::string to_blob(const std::array<double, 6>& velocity);
// 6 float64: stamp, longitude, latitude, altitude, error, bearing.
std::string to_blob(const GpsFix& fix);

// 48 bytes of float32, rows of [R|t]; nothing for all zeros, RTAB-Map's null. The rotation becomes
// the nearest proper one. Throws Error: another length, not finite, no rotation at all.
std::optional<Pose> decode_pose(std::string_view bytes);
// 288 bytes of float64. Throws Error: another length, not finite.
Matrix6d decode_information(std::string_view bytes);
// 24 bytes of float32; nothing if it is not known (all zeros or not finite).
std::optional<std::array<double, 6>> decode_velocity(std::string_view bytes);
// 48 bytes of float64; nothing for all zeros.
std::optional<GpsFix> decode_gps(std::string_view bytes);

// Admin.opt_ids and Admin.opt_poses.
struct OptimizedPoseBlobs {
  std::string ids;
  std::string poses;
};
OptimizedPoseBlobs to_blobs(const std::map<int, Pose>& map_from_base);
// Throws Error unless Admin.opt_ids and Admin.opt_poses are matrices of int32 and of 12 float32 for
// each of them. Goes by what the blobs say of themselves: neither is inflated.
void require_optimized_poses(const std::string& ids_blob, const std::string& poses_blob);

}  // namespace libmap
