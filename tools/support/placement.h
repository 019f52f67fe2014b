// Parses transforms and boxes that are given on the command line.
#pragma once

#include <optional>
#include <string>

#include "libmap/core/point_cloud.h"
#include "libmap/core/pose.h"

namespace graspmap_tools {

// Parses "X,Y,Z,ROLL,PITCH,YAW" in meters and degrees (rotations about the fixed axes x, then y,
// then z), or reads a file of four rows of four numbers, as `crop` writes. Returns the identity for
// an empty text. Throws Error naming the field or file.
libmap::Pose parse_transform(const std::string& text, const std::string& field);

// Returns the six numbers that parse_transform converts back to `pose`.
std::string transform_text(const libmap::Pose& pose);

// Parses "XMIN,YMIN,ZMIN,XMAX,YMAX,ZMAX" in meters; returns nullopt for an empty text. Throws Error
// if a minimum is above its maximum or the text has another form.
std::optional<libmap::Bounds3d> parse_box(const std::string& text);

// Returns true if the point is inside the box or on it, or if there is no box.
bool is_inside(const std::optional<libmap::Bounds3d>& box, const Eigen::Vector3d& point);

// Returns the points for which is_inside is true. Throws Error naming `file` if there are none.
libmap::PointCloud part_in_box(const libmap::PointCloud& cloud,
                               const std::optional<libmap::Bounds3d>& box, const std::string& file);

}  // namespace graspmap_tools
