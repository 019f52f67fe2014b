// Points that a user lists, carried into the frame of a map.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/pose.h"
#include "libmap/core/table.h"
#include "tools/run.h"

namespace graspmap_tools {

// Which frame listed points are in: that of the cloud that was scored, the terrain frame, or that
// of the map that `graspmap crop` made the site from.
enum class PointFrame { input, terrain, map };
const std::vector<std::pair<std::string, PointFrame>>& point_frame_names();

// The columns x, y, z, in metres. Throws Error naming the file, the row and the column.
std::vector<Eigen::Vector3d> positions_of(const libmap::Table& table);

// The name of the transform that `crop` makes and that others carry on. It always leads from the
// map as it was before the first crop.
inline constexpr const char* site_from_map_name = "site_from_map";

// From the map before it was cropped to the points in `file`, as the file's manifest says; nothing
// if it was not cropped.
std::optional<libmap::Pose> site_from_map_of(const std::string& file);

// For an output in the frame of `input`: its manifest gets the input's site_from_map, if it has
// one.
void carry_site_transform(const std::string& input, Run& run);

// From the frame of listed points to that of the points in `map`, as its manifest says; the
// identity, with a warning, if it has none. Throws Error if points are in the frame of a map that
// was not cropped.
libmap::Pose map_from_points(const std::string& map, PointFrame points_frame, Run& run);

// "X,Y,Z". Throws Error naming `field`.
Eigen::Vector3d parse_vector(const std::string& text, const std::string& field);

}  // namespace graspmap_tools
