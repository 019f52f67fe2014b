// Reads and writes encoded messages in the storages of bags:
//   ros1     http://wiki.ros.org/Bags/Format/2.0, by librosbag
//   sqlite3  rosbag2's default up to ROS 2 Humble: .db3 files and metadata.yaml in a folder
//            (https://github.com/ros2/rosbag2: sqlite_storage.cpp, rosbag2_storage/yaml.hpp)
//   mcap     rosbag2's default since Iron: https://mcap.dev/spec
// Private to bag_reader and bag_writer.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "libmap/bag/bag_reader.h"
#include "libmap/bag/bag_writer.h"

namespace libmap {

// Topics of a bag, accumulated over all files.
struct RecordedTopics {
  std::vector<BagTopic> topics{};
  std::int64_t first_ns = std::numeric_limits<std::int64_t>::max();
  std::int64_t last_ns = std::numeric_limits<std::int64_t>::min();

  // Returns the index of the topic with equal name, type, md5sum and encoding; appends a new topic.
  std::size_t index_of(const BagTopic& topic);
  // Adds a number of messages with recording times from `first` to `last`, in ns, to a topic.
  void add(std::size_t index, std::size_t messages, std::int64_t first, std::int64_t last);

  std::map<std::tuple<std::string, std::string, std::string, MessageEncoding>, std::size_t> known{};
};

using TakeMessage = std::function<void(const BagMessage&)>;

// `list` adds the topics of a file, `read` reads a file as read_bag does. Both throw Error naming
// the file; for ROS 1, builds without its libraries throw Error (failed) with the missing packages.
struct BagStorage {
  const char* name = "";
  void (*list)(const std::filesystem::path& file, RecordedTopics& topics) = nullptr;
  void (*read)(const std::filesystem::path& file, const std::vector<BagRequest>& requests,
               const TakeMessage& take) = nullptr;
};
extern const BagStorage ros1_storage;
extern const BagStorage sqlite_storage;
extern const BagStorage mcap_storage;

// metadata.yaml of a rosbag2 folder (https://github.com/ros2/rosbag2:
// rosbag2_storage/include/rosbag2_storage/yaml.hpp).
inline constexpr const char* rosbag2_metadata_name = "metadata.yaml";

// Returns the names of the bag's files, which versions 1 to 9 of metadata.yaml store alike. Throws
// Error for a missing or invalid metadata.yaml, a missing name, and compressed bags.
std::vector<std::string> read_rosbag2_metadata(const std::filesystem::path& path);

// Returns metadata.yaml for a single file, in version 5 (Humble), which later versions read too.
std::string rosbag2_metadata(const RecordedTopics& topics, const std::string& storage,
                             const std::string& file);

// Returns the quality of service (rmw's enumerations in Humble's format) of a latched topic, whose
// last message is sent to late subscribers; "" for other topics.
std::string quality_of_service(bool latching);
// True if a recorded quality of service is that of a latched topic.
bool is_latching(std::string_view quality_of_service);

// A message to write.
struct StoredMessage {
  std::string topic{};
  MessageType type{};
  std::string (*definition)() = nullptr;  // definition_of<Message>
  std::int64_t stamp_ns = 0;
  bool latching = false;
  std::string bytes{};
};

// Writer of a bag. Its functions throw Error (failed) if a write fails.
class BagSink {
 public:
  virtual ~BagSink() = default;
  // Appends a message. Stamps need not ascend.
  virtual void write(const StoredMessage& message) = 0;
  // Completes the bag; without this call, the file is not a valid bag.
  virtual void close() = 0;
};
std::unique_ptr<BagSink> new_ros1_bag(const std::filesystem::path& path,
                                      BagCompression compression);
std::unique_ptr<BagSink> new_sqlite_bag(const std::filesystem::path& folder);  // folder exists
std::unique_ptr<BagSink> new_mcap(const std::filesystem::path& path, BagCompression compression);

// Compressed chunks of MCAP (https://mcap.dev/spec/registry#well-known-compression-formats): frames
// of LZ4 and Zstandard, by the official libraries; "": no compression. `size` is the declared
// decompressed size; memory is proportional to the actual size. Throws Error for an unknown
// compression, damaged data, a wrong size, or more than 1 GiB.
std::string decompress_chunk(const std::string& compression, std::string_view bytes,
                             std::uint64_t size);
std::string compress_chunk(const std::string& compression, const std::string& bytes);

}  // namespace libmap
