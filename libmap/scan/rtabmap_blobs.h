// Encodes and decodes the little-endian blobs of an RTAB-Map database, and reads its nodes, links
// and optimized poses.
#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/core/pose_graph.h"
#include "libmap/scan/rtabmap_schema.h"

namespace libmap {

// RTAB-Map treats blobs of at most this size as absent (DBDriverSqlite3.cpp).
inline constexpr std::size_t absent_blob_bytes = 4;
inline bool is_absent(std::string_view blob) { return blob.size() <= absent_blob_bytes; }

// A pose is encoded as 12 float32, the rows of [R|t]. The null pose, all zeros, is an unknown pose.
inline constexpr std::size_t pose_bytes = 48;
std::string to_blob(const Pose& pose);
std::string null_pose_blob();
// Encodes the symmetric part of a matrix as 36 float64 in row-major order, because g2o rejects a
// whole graph for one asymmetric bit.
std::string to_blob(const Matrix6d& information);
// Encodes a velocity as 6 float32.
std::string to_blob(const std::array<double, 6>& velocity);
// Encodes a fix as 6 float64: stamp, longitude, latitude, altitude, error, bearing.
std::string to_blob(const GpsFix& fix);

// Decodes a pose with the nearest proper rotation; nullopt for the null pose. Throws Error if the
// length is not 48 bytes, a number is not finite, the position is more than 1e8 m from the origin
// along an axis, or the matrix is not nearly a rotation.
std::optional<Pose> decode_pose(std::string_view bytes);
// Decodes 36 float64. Throws Error if the length is not 288 bytes or a magnitude exceeds 1e300.
Matrix6d decode_information(std::string_view bytes);
// Decodes 6 float32; nullopt if the velocity is unknown (all zeros or not finite). Throws Error if
// the length is not 24 bytes.
std::optional<std::array<double, 6>> decode_velocity(std::string_view bytes);
// Decodes 6 float64; nullopt for all zeros. Throws Error unless `bytes` has 6 finite numbers.
std::optional<GpsFix> decode_gps(std::string_view bytes);

// Contents of the columns opt_ids and opt_poses of table Admin.
struct OptimizedPoseBlobs {
  std::string ids;
  std::string poses;
};
OptimizedPoseBlobs to_blobs(const std::map<int, Pose>& map_from_base);
// Throws Error unless Admin.opt_ids and Admin.opt_poses are matrices of int32 and of 12 float32 per
// id. Checks the headers of the blobs without inflating them.
void require_optimized_poses(const std::string& ids_blob, const std::string& poses_blob);

class SqliteFile;

struct RtabmapGraph {
  PoseGraph graph;
  // Dropped nodes, links and poses with the reason: at most 100, then the number of the others.
  std::vector<std::string> warnings;
};

// Reads the graph. If both directions of a link are stored, the graph contains the one from the
// lower node id. Throws Error naming the file if a table cannot be read.
RtabmapGraph read_rtabmap_graph(const SqliteFile& file, const RtabmapColumns& columns);

}  // namespace libmap
