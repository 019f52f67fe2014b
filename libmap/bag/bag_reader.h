// Lists the topics of bags of ROS 1 and ROS 2 (.db3 and .mcap), and reads the encoded messages.
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

// Encoding of messages. ros1: ROS 1; cdr: ROS 2 (Common Data Representation); other: unsupported.
enum class MessageEncoding { ros1, cdr, other };

// Type of messages, such as sensor_msgs/PointCloud2.
struct MessageType {
  const char* name = "";    // name in ROS 1, e.g. "sensor_msgs/PointCloud2"
  const char* md5sum = "";  // md5sum of the definition in ROS 1
};
// Returns the name in ROS 2: "sensor_msgs/PointCloud2" -> "sensor_msgs/msg/PointCloud2".
std::string ros2_name(const MessageType& type);

// A topic with messages of one type, sent by any number of publishers.
struct BagTopic {
  std::string name{};
  std::string type{};     // e.g. "sensor_msgs/PointCloud2"; ROS 2: "sensor_msgs/msg/PointCloud2"
  std::string md5sum{};   // md5sum of the type's definition; ROS 1 only
  bool latching = false;  // true if late subscribers receive the last message
  MessageEncoding encoding = MessageEncoding::ros1;  // encoding of the messages
  std::size_t messages = 0;                          // number of messages

  // True if messages are of the type `other`, by the name in ROS 1 or ROS 2.
  bool is(const MessageType& other) const;
  // True if is(other) and, in ROS 1, the md5sum of the definition is also equal.
  bool has_definition_of(const MessageType& other) const;
  bool operator==(const BagTopic&) const = default;
};

struct BagListing {
  std::string storage{};  // "bag of ROS 1", "bag of ROS 2 (sqlite3)" or "bag of ROS 2 (mcap)"
  std::vector<BagTopic> topics{};  // topics with messages, in the order of recording
  std::size_t messages = 0;        // number of messages of all topics
  double start_s = 0.0;  // recording time of the first message, s since 1970; 0 without messages
  double end_s = 0.0;    // recording time of the last message, s since 1970; 0 without messages
};

// True for *.bag, *.mcap and *.db3.
bool has_bag_extension(const std::filesystem::path& path);
// True if the path has the extension of a bag, or is a folder with metadata.yaml, .mcap or .db3.
bool is_bag_path(const std::filesystem::path& path);
// Returns the files of a bag: `path` itself or, for a folder, metadata.yaml and the files that it
// lists. Throws Error if metadata.yaml is missing or invalid, or its files are compressed.
std::vector<std::filesystem::path> files_of_bag(const std::filesystem::path& path);

// Lists the topics of a bag. Throws Error naming the file if it cannot be read, is not a bag, is
// damaged or encrypted, or has no index because the recording was not ended. For bags of ROS 1,
// builds without ROS 1's libraries throw Error (failed) naming the missing packages.
BagListing list_bag(const std::filesystem::path& path);

struct BagRequest {
  std::string topic{};  // ignored if the bag has no such topic
  // Maximum number of bytes of a message; longer messages are cut.
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

// Returns the topic `name` of a bag. Throws Error if there is no such topic, naming the nearest one
// and all topics of `type`; also if the topic's messages have another type or definition.
const BagTopic& require_topic(const BagListing& listing, const std::string& name,
                              const MessageType& type);

}  // namespace libmap
