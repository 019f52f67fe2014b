// Parses and writes text formats of trajectories and pose graphs. Numbers are written with the
// fewest digits that parse to the same number, in any locale. Lines that begin with '#' are
// comments. The parsers throw Error naming `file` and line for a wrong number of columns, numbers
// that are not finite, invalid rotations, positions beyond 1e8 m and duplicate nodes.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "libmap/core/pose_graph.h"

namespace libmap {

// Returns text that parses to the same stamp, or to within 1e-9 s if more than 9 decimals are
// needed. The text has no exponent, because not all readers support exponents.
std::string stamp_text(double stamp_s);

// TUM RGB-D benchmark: "stamp x y z qx qy qz qw", s and m (RTAB-Map's formats 1 and 10). With
// `nodes`, the node id is a ninth column (format 11). The parser accepts 8 or 9 columns and commas.
Trajectory parse_tum(std::string_view text, const std::string& file);
std::string to_tum(const Trajectory& trajectory, bool nodes = false);

// KITTI odometry benchmark: the 12 numbers of [R|t] in row-major order, RTAB-Map's formats 0 and 2,
// without stamps and nodes.
Trajectory parse_kitti(std::string_view text, const std::string& file);
std::string to_kitti(const Trajectory& trajectory);

// Open3D's trajectory log: per pose, a line of three integers, then the 4 x 4 matrix of a camera's
// pose (optical frame). It has no stamps and nodes.
Trajectory parse_open3d(std::string_view text, const std::string& file);

// Ground truth of EuRoC MAV: "timestamp [ns], x, y, z, qw, qx, qy, qz, ...", poses of the body.
Trajectory parse_euroc(std::string_view text, const std::string& file);

// transforms.json of nerfstudio: cameras with y up, z backward. Returns poses of optical frames.
std::vector<ImagePose> parse_nerfstudio(std::string_view text, const std::string& file);

struct PoseGraphText {
  Trajectory poses;  // with nodes, without stamps
  std::vector<PoseLink> links;
};

// g2o (Kuemmerle et al. 2011): "VERTEX_SE3:QUAT id x y z qx qy qz qw" and "EDGE_SE3:QUAT from to
// x y z qx qy qz qw" with the upper triangle of the information matrix, row by row, in the order
// x y z qx qy qz.
//
// In g2o, the rotation error is the vector part of a quaternion, half the rotation vector: for
// small angles q = (roll, pitch, yaw) / 2. A PoseLink's information refers to the angles, so rows
// and columns of the rotation are multiplied by 2 in the file (the 3 x 3 block by 4) and divided by
// 2 on reading. (RTAB-Map writes the matrix unchanged, so its files underestimate the information
// of rotations.)
//
// g2o has no types of links. Types are written as comments, "# graspmap:type 1 global closure",
// that apply to the following edges. Without these comments, edges to the next vertex are read as
// neighbors, other edges as global closures. Links other than edges between two poses (priors,
// gravity, landmarks) are written as comments "# graspmap:edge from to ...". Records of planar
// graphs are an Error; other records are ignored.
PoseGraphText parse_g2o(std::string_view text, const std::string& file);
std::string to_g2o(const Trajectory& poses, const std::vector<PoseLink>& links);

// TORO (Grisetti et al. 2007), RTAB-Map's format 3: "VERTEX3 id x y z roll pitch yaw" and "EDGE3
// from to x y z roll pitch yaw" with the upper triangle of the information matrix in that order;
// angles in radians, R = Rz(yaw) Ry(pitch) Rx(roll). Types of links are read as for g2o without
// comments. RTAB-Map's reader does not support comments, so no comments are written, and links
// other than edges between two poses are dropped. (RTAB-Map's reader also limits lines to 400
// characters, and uses the translation's information for the rotation.)
PoseGraphText parse_toro(std::string_view text, const std::string& file);
std::string to_toro(const Trajectory& poses, const std::vector<PoseLink>& links);

// Axes of a file's poses. RTAB-Map rotates the axes in formats 1 and 2; files do not indicate this.
enum class PoseAxes {
  map,            // axes of the scan: x forward, z up
  optical,        // format 2: z forward, x right, y down, for the world and the moving body
  motion_capture  // format 1: optical axes for the moving body, other axes for the world
};
Pose from_axes(PoseAxes axes, const Pose& pose_in_file);   // returns world_from_base
Pose to_axes(PoseAxes axes, const Pose& world_from_base);  // inverse of from_axes

// Recognizes the format of a text by the tag or the number of columns of the first line that is not
// a comment. Returns the extension of the format: ".tum", ".kitti", ".toro", ".g2o", ".log"
// (Open3D), ".json" (nerfstudio) or ".euroc". Throws Error for other formats.
std::string recognize_poses(std::string_view text, const std::string& file);

}  // namespace libmap
