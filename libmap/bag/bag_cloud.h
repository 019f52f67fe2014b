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
  std::int64_t stamp_ns = 0;
  std::string frame{};
  PointCloud cloud{};
  std::size_t dropped_points = 0;  // points with a NaN or infinite position
};

// Decodes a PointCloud2 in either byte order, with or without padding; organized clouds in
// row-major order. Positions are x, y, z; normals are normal_x, normal_y, normal_z or nx, ny, nz;
// colors are rgb or rgba (PCL's packing), or r, g, b or red, green, blue of one byte. Others become
// scalar fields, with several numbers per point NAME_0, NAME_1, ... Throws Error naming the field
// if x, y or z is missing, a field is a duplicate, outside the point or of unknown type, a point
// has more than 1024 numbers, or rows or data are too short.
CloudMessage decode_cloud(MessageEncoding encoding, std::string_view bytes);

struct BagCloudResult {
  std::string topic{};
  std::string frame{};
  double stamp_s = 0.0;  // stamp of the header; time of recording if that is empty
  PointCloud cloud{};
  std::size_t dropped_points = 0;
  std::size_t messages = 0;  // number of messages on the topic
};

// Reads one message of a topic of PointCloud2: the one nearest in time to `stamp_s`, else the first
// one with the most points. Without `topic`, the bag must have one such topic. Throws Error for a
// damaged bag or message, a missing topic, or several topics without `topic`.
BagCloudResult read_bag_cloud(const std::filesystem::path& bag, const std::string& topic = {},
                              const std::optional<double>& stamp_s = std::nullopt);

}  // namespace libmap
