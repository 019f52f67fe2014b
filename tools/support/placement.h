// Poses and boxes as they stand on the command line.
#pragma once

#include <optional>
#include <string>

#include "libmap/core/point_cloud.h"
#include "libmap/core/pose.h"

namespace graspmap_tools {

// "X,Y,Z,ROLL,PITCH,YAW" in meters and degrees about the fixed axes, roll first; or the name of a
// file of four rows of four numbers, as `crop` writes. Empty: the identity. Throws Error.
libmap::Pose parse_transform(const std::string& text, const std::string& field);

// The six numbers that parse_transform reads back as `pose`.
std::string transform_text(const libmap::Pose& pose);

// "XMIN,YMIN,ZMIN,XMAX,YMAX,ZMAX" in meters; nothing where empty. Throws Error.
std::optional<libmap::Bounds3d> parse_box(const std::string& text);

bool is_inside(const std::optional<libmap::Bounds3d>& box, const Eigen::Vector3d& point);

// The points in the box. Throws Error naming `file` if there is none.
libmap::PointCloud part_in_box(const libmap::PointCloud& cloud,
                               const std::optional<libmap::Bounds3d>& box, const std::string& file);

}  // namespace graspmap_tools
