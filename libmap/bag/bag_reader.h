// What a bag contains, and its messages as bytes: a bag of ROS 1, or one of ROS 2 in either of its
// storages (bag_storage.h).
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

// How messages are stored as bytes (message_codec.h); other: not one that is read.
enum class MessageEncoding { ros1, cdr, other };

// A type of messages, and the md5sum of its definition in ROS 1.
struct MessageType {
  const char* name = "";  // as ROS 1 has it, e.g. "sensor_msgs/PointCloud2"
  const char* md5sum = "";
};
// "sensor_msgs/PointCloud2" -> "sensor_msgs/msg/PointCloud2".
std::string ros2_name(const MessageType& type);

// All connections of one topic and type.
struct BagTopic {
  std::string name{};
  std::string type{};    // e.g. "sensor_msgs/PointCloud2"; of ROS 2 "sensor_msgs/msg/PointCloud2"
  std::string md5sum{};  // of the type's definition; ROS 1 alone
  bool latching = false;
  MessageEncoding encoding = MessageEncoding::ros1;
  std::size_t messages = 0;

  bool is(const MessageType& other) const;  // by name, whatever the definition
  // By name and, in ROS 1, by definition.
  bool has_definition_of(const MessageType& other) const;
  bool operator==(const BagTopic&) const = default;
};

struct BagListing {
  std::string storage{};  // "bag of ROS 1", "bag of ROS 2 (sqlite3)" or "bag of ROS 2 (mcap)"
  std::vector<BagTopic> topics{};  // those with messages, in the order in which they were recorded
  std::size_t messages = 0;
  double start_s = 0.0;  // when the first and the last message were recorded
  double end_s = 0.0;
};

// *.bag, *.mcap or *.db3.
bool has_bag_extension(const std::filesystem::path& path);
// Whether the path names a bag: by its extension, or a folder with metadata.yaml or files of the
// latter two.
bool is_bag_path(const std::filesystem::path& path);
// The files of a bag that exists: itself, or metadata.yaml and all that it names. Throws Error as
// list_bag, for a folder.
std::vector<std::filesystem::path> files_of_bag(const std::filesystem::path& path);

// Throws Error naming the file: it cannot be read, is no bag, has no index, is broken or encrypted;
// in a build without ROS 1's libraries (failed) for its bags, naming the packages that are missing.
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
// and where its messages are of another type or of another definition of it.
const BagTopic& require_topic(const BagListing& listing, const std::string& name,
                              const MessageType& type);

}  // namespace libmap
