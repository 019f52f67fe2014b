// A cloud out of a bag.
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
  std::size_t dropped_points = 0;  // those with a position that is NaN or infinite
};

// Either byte order, rows with padding, organized clouds row by row. Fields x, y, z; normal_x,
// normal_y, normal_z or nx, ny, nz become normals; rgb or rgba (PCL's packing), or r, g, b or red,
// green, blue of one byte, colors; any other a field, with several numbers a point NAME_0, NAME_1,
// ... Throws Error naming the field: x, y or z missing, one outside its point or twice there, an
// unknown type, more than 1024 numbers per point, data shorter than height and row_step say, rows
// shorter than their points.
CloudMessage decode_cloud(MessageEncoding encoding, std::string_view bytes);

struct BagCloudResult {
  std::string topic{};
  std::string frame{};
  double stamp_s = 0.0;  // the header's, or when it was recorded if that is empty
  PointCloud cloud{};
  std::size_t dropped_points = 0;
  std::size_t messages = 0;  // on the topic
};

// One message of a topic of PointCloud2: the one nearest in time to `stamp_s`, or the one of most
// points, of several the first. Without a topic the only one of that type. Throws Error: a broken
// bag or message, no such topic, several where none is named.
BagCloudResult read_bag_cloud(const std::filesystem::path& bag, const std::string& topic = {},
                              const std::optional<double>& stamp_s = std::nullopt);

}  // namespace libmap
