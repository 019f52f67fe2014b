// What a ROS 1 bag holds, and its messages as bytes (http://wiki.ros.org/Bags/Format/2.0).
//
// A bag's own bytes say where its messages lie, and librosbag follows them without looking whether
// they lead outside. So it runs in a process of its own, with 3 GiB of memory at most, and what it
// finds comes through a pipe: a bag that makes it fall is an Error here.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

namespace libmap {

// Throws Error (failed) in a build without ROS's libraries, naming the packages that are missing.
// So do all functions of this folder that read or write bags.
void require_ros();

// All connections of one topic and type.
struct BagTopic {
  std::string name{};
  std::string type{};    // e.g. "sensor_msgs/PointCloud2"
  std::string md5sum{};  // of the type's definition
  bool latching = false;
  std::size_t messages = 0;

  bool operator==(const BagTopic&) const = default;
};

struct BagListing {
  std::vector<BagTopic> topics{};  // those with messages, in the order in which they were recorded
  std::size_t messages = 0;
  double start_s = 0.0;  // when the first and the last message were recorded
  double end_s = 0.0;
};

// Throws Error naming the file: it cannot be read, is no bag, has no index, is broken or encrypted.
BagListing list_bag(const std::filesystem::path& path);

struct BagRequest {
  std::string topic{};
  // No more than so many of a message's first bytes are wanted.
  std::size_t max_bytes = std::numeric_limits<std::size_t>::max();
};

struct BagMessage {
  const BagTopic& topic;
  std::int64_t recorded_ns = 0;
  std::string_view bytes{};  // valid during the call alone
};

// Calls take(message) for each message of the topics, in the order of recording. Throws as
// list_bag, and what `take` throws.
void read_bag(const std::filesystem::path& path, const std::vector<BagRequest>& requests,
              const std::function<void(const BagMessage&)>& take);

// The topic of that name. Throws Error naming the nearest known one, or all that are of `type`,
// and where its messages are of another type or of another definition of it than `md5sum`.
const BagTopic& require_topic(const BagListing& listing, const std::string& name,
                              const std::string& type, const std::string& md5sum);

}  // namespace libmap
