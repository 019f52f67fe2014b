// Clouds out of messages (sensor_msgs/PointCloud2), from their encoded bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "libmap/core/point_cloud.h"
#include "libmap/ros/bag_reader.h"

namespace libmap {

struct CloudMessage {
  std::int64_t stamp_ns = 0;
  std::string frame{};
  PointCloud cloud{};
  std::size_t dropped_points = 0;  // those with a position that is NaN or infinite
};

// Either byte order, rows with padding, organized clouds row by row. Fields x, y, z; normal_x,
// normal_y, normal_z or nx, ny, nz become normals; rgb or rgba (PCL's packing), or r, g, b or red,
// green, blue of one byte, colors; any other a field, with several numbers a point NAME_0, NAME_1,
// ... Throws Error naming the field: x, y or z missing, one outside its point or twice there, an
// unknown type, more than 1024 numbers per point, data shorter than height and row_step say, rows
// shorter than their points.
CloudMessage decode_cloud(MessageEncoding encoding, std::string_view bytes);

}  // namespace libmap
