// Reads a point cloud from a ROS bag.
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
  std::int64_t stamp_ns = 0;  // stamp and frame of the header
  std::string frame{};
  PointCloud cloud{};
  std::size_t dropped_points = 0;  // points with a NaN or infinite position
};

// Decodes a PointCloud2 in either byte order, with or without padding; organized clouds in
// row-major order. Positions are x, y, z; normals are normal_x, normal_y, normal_z or nx, ny, nz;
// colors are rgb or rgba (PCL's packing), or r, g, b or red, green, blue of one byte. Other fields
// become scalar fields: NAME, or NAME_0, NAME_1, ... for several numbers per point. Throws Error
// naming the field if x, y or z is missing, a field is a duplicate, outside the point or of unknown
// type, a point has more than 1024 numbers, or rows or data are too short.
CloudMessage decode_cloud(MessageEncoding encoding, std::string_view bytes);

struct BagCloudResult {
  std::string topic{};
  std::string frame{};
  double stamp_s = 0.0;  // stamp of the header; time of recording if the header has none
  PointCloud cloud{};
  std::size_t dropped_points = 0;  // points with a NaN or infinite position
  std::size_t messages = 0;        // number of messages on the topic
};

// Reads one message of a topic of PointCloud2: the message nearest in time to `stamp_s`; without
// `stamp_s`, the first message with the most points. If `topic` is empty, the bag must have exactly
// one topic of PointCloud2. Throws Error for a damaged bag or message, or a missing topic.
BagCloudResult read_bag_cloud(const std::filesystem::path& bag, const std::string& topic = {},
                              const std::optional<double>& stamp_s = std::nullopt);

}  // namespace libmap
