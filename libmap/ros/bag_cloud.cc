#include "libmap/ros/bag_cloud.h"

#include <cmath>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/ros/bag_reader.h"
#include "libmap/ros/cloud_message.h"
#include "libmap/ros/ros_messages.h"

namespace libmap {

namespace {

using ros_message::PointCloud2;

std::string only_cloud_topic(const BagListing& listing) {
  std::string names;
  std::size_t count = 0;
  for (const BagTopic& topic : listing.topics) {
    if (!topic.is(PointCloud2::type)) continue;
    names += (count++ == 0 ? "" : ", ") + topic.name;
  }
  if (count == 1) return names;
  throw Error(count == 0 ? "no topic contains clouds" : "several topics contain clouds",
              {.field = std::string("topics of ") + PointCloud2::type.name,
               .value = count == 0 ? "none" : names,
               .bound = count == 0 ? "" : "one of them named as the topic"});
}

BagCloudResult read(const std::filesystem::path& bag, const std::string& wanted,
                    const std::optional<double>& stamp_s) {
  const BagListing listing = list_bag(bag);
  const std::string name = wanted.empty() ? only_cloud_topic(listing) : wanted;
  require_topic(listing, name, PointCloud2::type);
  BagCloudResult best;
  std::size_t messages = 0;
  read_bag(bag, {{name}}, [&](const BagMessage& message) {
    CloudMessage cloud = decode_cloud(message.topic.encoding, message.bytes);
    const std::int64_t stamp_ns = cloud.stamp_ns == 0 ? message.recorded_ns : cloud.stamp_ns;
    const double stamp = ros_message::seconds_of(stamp_ns);
    const bool better =
        messages++ == 0 || (stamp_s ? std::abs(stamp - *stamp_s) < std::abs(best.stamp_s - *stamp_s)
                                    : cloud.cloud.size() > best.cloud.size());
    if (better) best = {name, cloud.frame, stamp, std::move(cloud.cloud), cloud.dropped_points, 0};
  });
  best.messages = messages;
  return best;
}

}  // namespace

BagCloudResult read_bag_cloud(const std::filesystem::path& bag, const std::string& topic,
                              const std::optional<double>& stamp_s) {
  try {
    return read(bag, topic, stamp_s);
  } catch (const Error& error) {
    throw error.in_file(bag.string());
  }
}

}  // namespace libmap
