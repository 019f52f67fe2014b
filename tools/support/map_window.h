// The part of a tile store that a picture shows.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>

#include "libmap/core/point_cloud.h"
#include "tools/support/map_tiles.h"

namespace graspmap_tools {

// "X0,Y0,X1,Y1" in meters, or nothing for an empty text. Throws Error naming --box.
std::optional<Eigen::AlignedBox2d> parse_rectangle(const std::string& text);

// The points within the box, level, in the cloud's own frame.
libmap::PointCloud points_in_box(const libmap::PointCloud& cloud, const Eigen::AlignedBox2d& box);

struct MapWindow {
  libmap::PointCloud cloud;
  int columns_per_point = 1;  // width of the squares of columns that became one point
};

// Loads the tiles that the box touches, a few at a time. Where they hold more than about
// `max_points`, squares of columns become one point each (downsample_map). Throws Error if nothing
// is in the box.
MapWindow read_window(const MapTiles& tiles, const std::optional<Eigen::AlignedBox2d>& box,
                      std::uint64_t max_points);

}  // namespace graspmap_tools
