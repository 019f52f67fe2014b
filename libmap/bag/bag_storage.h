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
  std::int64_t first_ns = std::numeric_limits<std::int64_t>::max();  // first recording time
  std::int64_t last_ns = std::numeric_limits<std::int64_t>::min();   // last recording time

  // Index of the topic with equal name, type, md5sum and encoding; appends `topic` if it is new.
  std::size_t index_of(const BagTopic& topic);
  // Counts messages of the topic `index` with recording times from `first` to `last`, ns.
  void add(std::size_t index, std::size_t messages, std::int64_t first, std::int64_t last);

  // Index in `topics` by name, type, md5sum and encoding.
  std::map<std::tuple<std::string, std::string, std::string, MessageEncoding>, std::size_t> known{};
};

using TakeMessage = std::function<void(const BagMessage&)>;

// Functions of one storage. `list` adds the topics of a file; `read` reads a file as read_bag does.
// Both throw Error naming the file, or Error (failed) if the build does not support ROS 1.
struct BagStorage {
  const char* name = "";  // as BagListing::storage
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

// Returns the names of the bag's files, relative to the folder of metadata.yaml (format 1 to 9).
// Throws Error for a missing or invalid metadata.yaml, no file name, and compressed bags.
std::vector<std::string> read_rosbag2_metadata(const std::filesystem::path& path);

// Returns metadata.yaml for a single file, in version 5 (Humble); later versions of ROS read it.
std::string rosbag2_metadata(const RecordedTopics& topics, const std::string& storage,
                             const std::string& file);

// Returns the text in which rosbag2 stores the quality of service of a latched topic, whose last
// message is sent to late subscribers; "" for other topics.
std::string quality_of_service(bool latching);
// True if a recorded quality of service is that of a latched topic.
bool is_latching(std::string_view quality_of_service);

// A message to write, with its topic.
struct StoredMessage {
  std::string topic{};
  MessageType type{};
  std::string (*definition)() = nullptr;  // ros_message::definition_of<Message> (message_codec.h)
  std::int64_t stamp_ns = 0;              // recording time
  bool latching = false;                  // true if late subscribers receive the last message
  std::string bytes{};                    // encoded message
};

// Writer of a bag. Its functions throw Error (failed) if a write fails.
class BagSink {
 public:
  virtual ~BagSink() = default;
  // Appends a message. Stamps can be in any order.
  virtual void write(const StoredMessage& message) = 0;
  // Completes the bag; without this call, the file is not a valid bag.
  virtual void close() = 0;
};
std::unique_ptr<BagSink> new_ros1_bag(const std::filesystem::path& path,
                                      BagCompression compression);
std::unique_ptr<BagSink> new_sqlite_bag(const std::filesystem::path& folder);  // must exist
std::unique_ptr<BagSink> new_mcap(const std::filesystem::path& path, BagCompression compression);

// Decompress and compress chunks of MCAP files
// (https://mcap.dev/spec/registry#well-known-compression-formats). `compression` is "lz4", "zstd"
// or "" (none). `size` is the declared decompressed size; memory is proportional to the actual
// size. Throw Error for an unknown compression, damaged data, a wrong size, or more than 1 GiB.
std::string decompress_chunk(const std::string& compression, std::string_view bytes,
                             std::uint64_t size);
std::string compress_chunk(const std::string& compression, const std::string& bytes);

}  // namespace libmap
