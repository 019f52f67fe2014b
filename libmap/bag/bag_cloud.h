// Reads point clouds (sensor_msgs/PointCloud2) from ROS bags.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "libmap/bag/bag_reader.h"
#include "libmap/core/point_cloud.h"

namespace libmap {

struct CloudMessage {
  std::int64_t stamp_ns = 0;  // stamp of the message's header; 0: none
  std::string frame{};        // frame of the message's header
  PointCloud cloud{};
  std::size_t dropped_points = 0;  // points with a NaN or infinite position
};

// Decodes a PointCloud2 in either byte order, with or without padding. The points of an organized
// cloud are in row-major order. Fields by name:
//   - x, y, z: positions; normal_x, normal_y, normal_z or nx, ny, nz: normals.
//   - rgb or rgba (PCL: 8 bits per channel in one number), r, g, b or red, green, blue: colors.
//   - all other names: scalar fields NAME, or NAME_0, NAME_1, ... for several numbers per point.
// Throws Error naming the field if x, y or z is missing, or a field is a duplicate, has an unknown
// type or exceeds the point. Throws Error for over 1024 numbers per point, and short rows or data.
CloudMessage decode_cloud(MessageEncoding encoding, std::string_view bytes);

struct BagCloudResult {
  std::string topic{};
  std::string frame{};   // frame of the message's header
  double stamp_s = 0.0;  // stamp of the header, s; recording time if the header has no stamp
  PointCloud cloud{};
  std::size_t dropped_points = 0;  // points with a NaN or infinite position
  std::size_t messages = 0;        // number of messages on the topic
};

// Reads the message of a topic that is nearest in time to `stamp_s`; without `stamp_s`, the message
// with the most points (the first of equal ones). If `topic` is empty, the bag must have exactly
// one topic of PointCloud2. Throws Error for a damaged bag or message, or a missing topic.
BagCloudResult read_bag_cloud(const std::filesystem::path& bag, const std::string& topic = {},
                              const std::optional<double>& stamp_s = std::nullopt);

}  // namespace libmap
