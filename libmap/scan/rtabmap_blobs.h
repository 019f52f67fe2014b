// Encodes and decodes the little-endian blobs of an RTAB-Map database, and reads its pose graph.
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

// RTAB-Map regards blobs of at most this size as missing (DBDriverSqlite3.cpp).
inline constexpr std::size_t absent_blob_bytes = 4;
inline bool is_absent(std::string_view blob) { return blob.size() <= absent_blob_bytes; }

// Encodes a pose as 12 float32, the rows of [R|t].
inline constexpr std::size_t pose_bytes = 48;
std::string to_blob(const Pose& pose);
// Encodes the null pose, which means an unknown pose: 12 zeros.
std::string null_pose_blob();
// Encodes the symmetric part of a matrix as 36 float64 in row-major order, because g2o rejects a
// whole graph for one asymmetric bit.
std::string to_blob(const Matrix6d& information);
// Encodes a velocity (3 linear, 3 angular components) as 6 float32.
std::string to_blob(const std::array<double, 6>& velocity);
// Encodes a GPS fix as 6 float64: stamp, longitude, latitude, altitude, error, bearing.
std::string to_blob(const GpsFix& fix);

// Decodes a pose with the nearest proper rotation; nullopt for the null pose. Throws Error if the
// length is not 48 bytes, a number is not finite, a coordinate exceeds 1e8 m, or the matrix is not
// nearly a rotation.
std::optional<Pose> decode_pose(std::string_view bytes);
// Decodes an information matrix. Throws Error for a wrong length or a magnitude above 1e300.
Matrix6d decode_information(std::string_view bytes);
// Decodes a velocity; nullopt for zeros or a non-finite number. Throws Error for a wrong length.
std::optional<std::array<double, 6>> decode_velocity(std::string_view bytes);
// Decodes a GPS fix; nullopt for all zeros. Throws Error unless `bytes` has 6 finite numbers.
std::optional<GpsFix> decode_gps(std::string_view bytes);

// Columns opt_ids and opt_poses of table Admin: matrices (matrix_codec.h) of node ids and poses.
struct OptimizedPoseBlobs {
  std::string ids;    // int32, one per node
  std::string poses;  // 12 float32 per node
};
OptimizedPoseBlobs to_blobs(const std::map<int, Pose>& map_from_base);
// Throws Error if Admin.opt_ids is not a matrix of int32, or Admin.opt_poses is not a matrix of 12
// float32 per id. Only reads the headers of the blobs.
void require_optimized_poses(const std::string& ids_blob, const std::string& poses_blob);

class SqliteFile;

struct RtabmapGraph {
  PoseGraph graph;
  // Reasons for dropped nodes, links and poses: at most 100, then the number of the others.
  std::vector<std::string> warnings;
};

// Reads the pose graph. Of a link that is stored in both directions, the graph contains the
// direction from the lower node id. Throws Error naming the file if a table cannot be read.
RtabmapGraph read_rtabmap_graph(const SqliteFile& file, const RtabmapColumns& columns);

}  // namespace libmap
