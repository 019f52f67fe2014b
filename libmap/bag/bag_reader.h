// Lists the topics of bags of ROS 1 and ROS 2 (sqlite3 and mcap, see bag_storage.h), and reads the
// messages as bytes.
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

// Encoding of messages (message_codec.h); other: not supported.
enum class MessageEncoding { ros1, cdr, other };

// Type of messages.
struct MessageType {
  const char* name = "";    // name in ROS 1, e.g. "sensor_msgs/PointCloud2"
  const char* md5sum = "";  // md5sum of the definition in ROS 1
};
// Returns the name in ROS 2: "sensor_msgs/PointCloud2" -> "sensor_msgs/msg/PointCloud2".
std::string ros2_name(const MessageType& type);

// A topic with messages of one type, from all its connections.
struct BagTopic {
  std::string name{};
  std::string type{};     // e.g. "sensor_msgs/PointCloud2"; ROS 2: "sensor_msgs/msg/PointCloud2"
  std::string md5sum{};   // md5sum of the type's definition; ROS 1 only
  bool latching = false;  // true if late subscribers receive the last message
  MessageEncoding encoding = MessageEncoding::ros1;
  std::size_t messages = 0;  // number of messages

  bool is(const MessageType& other) const;  // compares the names only
  // Compares the names and, in ROS 1, the definitions.
  bool has_definition_of(const MessageType& other) const;
  bool operator==(const BagTopic&) const = default;
};

struct BagListing {
  std::string storage{};  // "bag of ROS 1", "bag of ROS 2 (sqlite3)" or "bag of ROS 2 (mcap)"
  std::vector<BagTopic> topics{};  // topics with messages, in the order of recording
  std::size_t messages = 0;
  double start_s = 0.0;  // recording time of the first message; 0 without messages
  double end_s = 0.0;    // recording time of the last message
};

// True for *.bag, *.mcap and *.db3.
bool has_bag_extension(const std::filesystem::path& path);
// True if the path has the extension of a bag, or is a folder with metadata.yaml, .mcap or .db3.
bool is_bag_path(const std::filesystem::path& path);
// Returns the files of an existing bag: the file itself, or metadata.yaml and the files listed in
// it. For folders, throws as list_bag does.
std::vector<std::filesystem::path> files_of_bag(const std::filesystem::path& path);

// Lists the topics of a bag. Throws Error naming the file if it cannot be read, is not a bag, has
// no index, or is damaged or encrypted. For bags of ROS 1, builds without ROS 1's libraries throw
// Error (failed) naming the missing packages.
BagListing list_bag(const std::filesystem::path& path);

struct BagRequest {
  std::string topic{};
  // Longer messages are cut to this number of bytes.
  std::size_t max_bytes = std::numeric_limits<std::size_t>::max();
};

struct BagMessage {
  const BagTopic& topic;
  std::int64_t recorded_ns = 0;  // time of recording
  std::string_view bytes{};      // encoded message; valid during the call only
};

// Calls take(message) for each message of the requested topics, in the order of recording. Throws
// as list_bag does, and the exceptions of `take`.
void read_bag(const std::filesystem::path& path, const std::vector<BagRequest>& requests,
              const std::function<void(const BagMessage&)>& take);

// Returns the topic `name`. Throws Error if it does not exist (with the nearest name and all topics
// of `type`), or if the messages have another type or definition.
const BagTopic& require_topic(const BagListing& listing, const std::string& name,
                              const MessageType& type);

}  // namespace libmap
