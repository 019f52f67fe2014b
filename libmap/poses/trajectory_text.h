// Trajectories and pose graphs as the text formats of the field. Numbers are written with as many
// digits as bring the same number back, whatever the locale; lines that begin with '#' are
// comments.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "libmap/core/pose_graph.h"

namespace libmap {

// A text that reads back as the same stamp, to 1e-9 s where that would take more decimals. Without
// an exponent, which not every reader knows.
std::string stamp_text(double stamp_s);

// TUM RGB-D benchmark: "stamp x y z qx qy qz qw", s and m, RTAB-Map's formats 1 and 10; with
// `nodes` the node's id as a ninth column, its format 11. Reading takes either, and commas for
// spaces. The parsers throw Error naming `file` and the line: another number of columns, no finite
// number, a rotation that is none, a position beyond 1e8 m, a node that is a duplicate.
Trajectory parse_tum(std::string_view text, const std::string& file);
std::string to_tum(const Trajectory& trajectory, bool nodes = false);

// KITTI odometry benchmark: the 12 numbers of [R|t] row by row, RTAB-Map's formats 0 and 2; neither
// stamps nor nodes.
Trajectory parse_kitti(std::string_view text, const std::string& file);
std::string to_kitti(const Trajectory& trajectory);

// Open3D's trajectory log: a line of three integers, then the 4 x 4 matrix of a camera's pose
// (optical frame); neither stamps nor nodes.
Trajectory parse_open3d(std::string_view text, const std::string& file);

// Ground truth of EuRoC MAV: "timestamp [ns], x, y, z, qw, qx, qy, qz, ..."; of the body.
Trajectory parse_euroc(std::string_view text, const std::string& file);

// transforms.json of nerfstudio (instant-ngp, Blender): cameras with y up and z backward.
std::vector<ImagePose> parse_nerfstudio(std::string_view text, const std::string& file);

struct PoseGraphText {
  Trajectory poses;  // without stamps
  std::vector<PoseLink> links;
};

// g2o (Kuemmerle et al. 2011): "VERTEX_SE3:QUAT id x y z qx qy qz qw" and "EDGE_SE3:QUAT from to
// x y z qx qy qz qw" with the upper triangle of the information matrix, row by row, in the order
// x y z qx qy qz.
//
// The rotation's error is there the vector part of a quaternion, half the rotation vector: for
// small angles q = (roll, pitch, yaw) / 2. A PoseLink's information is of the angles, so rows and
// columns of the rotation are multiplied by 2 in the file (its 3 x 3 block by 4) and divided by 2
// when read. (RTAB-Map writes its matrix unchanged: what it exports reads as less certain of its
// rotations than it is.)
//
// g2o knows no types of links. They stand in comments, "# graspmap:type 1 global closure", for the
// edges below; without them edges to the next vertex are neighbors, others global closures. Links
// that are no edges between two poses (priors, gravity, landmarks) stand in comments whole, as
// "# graspmap:edge from to ...". Records of other kinds are passed over; planar ones are an Error.
PoseGraphText parse_g2o(std::string_view text, const std::string& file);
std::string to_g2o(const Trajectory& poses, const std::vector<PoseLink>& links);

// TORO (Grisetti et al. 2007), RTAB-Map's format 3: "VERTEX3 id x y z roll pitch yaw" and "EDGE3
// from to x y z roll pitch yaw" with the upper triangle of the information matrix in that order;
// angles in radians, R = Rz(yaw) Ry(pitch) Rx(roll). Types of links are guessed as those of g2o
// without comments: RTAB-Map's reader takes no comments, so none are written, and links that are no
// edges between two poses are left out. (That reader takes at most 400 characters a line, and the
// translation's information for the rotation's.)
PoseGraphText parse_toro(std::string_view text, const std::string& file);
std::string to_toro(const Trajectory& poses, const std::vector<PoseLink>& links);

// Axes of a file's poses. RTAB-Map turns those of its formats 1 and 2; nothing in the file says so.
enum class PoseAxes {
  map,            // as the scan's: x forward, z up
  optical,        // format 2: z forward, x right, y down, of the world and of what moves
  motion_capture  // format 1: what moves has optical axes, and the world others
};
Pose from_axes(PoseAxes axes, const Pose& pose_in_file);
Pose to_axes(PoseAxes axes, const Pose& world_from_base);

// Which of the formats above a text is, by its first line that is no comment: by its tag or its
// number of columns; as its extension, ".tum", ".kitti", ".toro", ".g2o", ".log" (Open3D), ".json"
// (nerfstudio) or ".euroc". Throws Error if it is none of them.
std::string recognize_poses(std::string_view text, const std::string& file);

}  // namespace libmap
