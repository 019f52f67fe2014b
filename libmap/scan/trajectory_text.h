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

// TUM RGB-D benchmark: "stamp x y z qx qy qz qw", s and m; with `nodes` the node's id as a ninth
// column, as RTAB-Map's format 11 has it. Reading takes either, and commas for spaces. The parsers
// throw Error naming `file` and the line: another number of columns, no finite number, a rotation
// that is none.
Trajectory parse_tum(std::string_view text, const std::string& file);
std::string to_tum(const Trajectory& trajectory, bool nodes = false);

// KITTI odometry benchmark: the 12 numbers of [R|t] row by row; neither stamps nor nodes.
Trajectory parse_kitti(std::string_view text, const std::string& file);
std::string to_kitti(const Trajectory& trajectory);

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

}  // namespace libmap
