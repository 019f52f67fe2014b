// A cloud out of a bag.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>

#include "libmap/core/point_cloud.h"

namespace libmap {

struct BagCloudResult {
  std::string topic{};
  std::string frame{};
  double stamp_s = 0.0;  // the header's, or when it was recorded if that is empty
  PointCloud cloud{};
  std::size_t dropped_points = 0;
  std::size_t messages = 0;  // on the topic
};

// One message of a topic of PointCloud2 (cloud_message.h): the one nearest in time to `stamp_s`, or
// the one of most points, of several the first. Without a topic the only one of that type. Throws
// Error: a broken bag or message, no such topic, several where none is named.
BagCloudResult read_bag_cloud(const std::filesystem::path& bag, const std::string& topic = {},
                              const std::optional<double>& stamp_s = std::nullopt);

}  // namespace libmap
