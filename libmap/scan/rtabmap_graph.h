// Nodes, links and optimized poses of an RTAB-Map database.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/core/pose_graph.h"
#include "libmap/scan/rtabmap_columns.h"

namespace libmap {

class SqliteFile;

// 48 bytes of float32, rows of [R|t]; nothing for all zeros, RTAB-Map's null. The rotation becomes
// the nearest proper one. Throws Error: another length, not finite, no rotation at all.
std::optional<Pose> decode_pose(std::string_view bytes);
// 288 bytes of float64. Throws Error: another length, not finite.
Matrix6d decode_information(std::string_view bytes);
// 24 bytes of float32; nothing if it is not known (all zeros or not finite).
std::optional<std::array<double, 6>> decode_velocity(std::string_view bytes);
// 48 bytes of float64; nothing for all zeros.
std::optional<GpsFix> decode_gps(std::string_view bytes);
// Throws Error unless Admin.opt_ids and Admin.opt_poses are matrices of int32 and of 12 float32 for
// each of them. Goes by what the blobs say of themselves: neither is inflated.
void require_optimized_poses(const std::string& ids_blob, const std::string& poses_blob);

struct RtabmapGraph {
  PoseGraph graph;
  // What was left out, and why: nodes and links that cannot be used, poses that are broken. At most
  // 100, then how many more.
  std::vector<std::string> warnings;
};

// Each link once: where both directions are stored, the one from the lower node; where one is, that
// one. Throws Error naming the file.
RtabmapGraph read_rtabmap_graph(const SqliteFile& file, const RtabmapColumns& columns);

}  // namespace libmap
