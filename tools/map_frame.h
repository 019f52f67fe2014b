// Points that a user lists, carried into the frame of a map.
#pragma once

#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/pose.h"
#include "libmap/core/table.h"
#include "tools/run.h"

namespace graspmap_tools {

// Which frame listed points are in: that of the cloud that was scored, or the terrain frame.
enum class PointFrame { input, terrain };
const std::vector<std::pair<std::string, PointFrame>>& point_frame_names();

// The columns x, y, z, in metres. Throws Error naming the file, the row and the column.
std::vector<Eigen::Vector3d> positions_of(const libmap::Table& table);

// From the frame of listed points to that of the points in `map`, as its manifest says; the
// identity, with a warning, if it has none.
libmap::Pose map_from_points(const std::string& map, PointFrame points_frame, Run& run);

// "X,Y,Z". Throws Error naming `field`.
Eigen::Vector3d parse_vector(const std::string& text, const std::string& field);

}  // namespace graspmap_tools
