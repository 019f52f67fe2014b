// The storages of bags, each of which reads and writes encoded messages:
//   ros1     http://wiki.ros.org/Bags/Format/2.0, by librosbag
//   sqlite3  rosbag2's default up to ROS 2 Humble: .db3 files and metadata.yaml in a folder
//            (https://github.com/ros2/rosbag2: sqlite_storage.cpp, rosbag2_storage/yaml.hpp)
//   mcap     rosbag2's default since Iron: https://mcap.dev/spec
// Inner part of bag_reader and bag_writer.
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

// What a bag's files contain, file by file.
struct RecordedTopics {
  std::vector<BagTopic> topics{};
  std::int64_t first_ns = std::numeric_limits<std::int64_t>::max();
  std::int64_t last_ns = std::numeric_limits<std::int64_t>::min();

  // Index of the topic of that name, type, definition and encoding, which is appended if it is new.
  std::size_t index_of(const BagTopic& topic);
  void add(std::size_t index, std::size_t messages, std::int64_t first, std::int64_t last);

  std::map<std::tuple<std::string, std::string, std::string, MessageEncoding>, std::size_t> known{};
};

using TakeMessage = std::function<void(const BagMessage&)>;

// Both throw Error naming the file. Of ROS 1: in a build without its libraries (failed), naming the
// packages that are missing.
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

// The names of the bag's files. Of any version: those from 1 to 9 have them alike; what else the
// text says is in the files too. Throws Error: no such file, no YAML, a name missing, compressed
// files or messages.
std::vector<std::string> read_rosbag2_metadata(const std::filesystem::path& path);

// The text of version 5, that of Humble, which later ones read too, of one file of `storage`.
std::string rosbag2_metadata(const RecordedTopics& topics, const std::string& storage,
                             const std::string& file);

// Quality of service (rmw's enumerations, as Humble writes them) of a latched topic, which is kept
// for those that subscribe later; "" otherwise. And whether a recorded one is of that kind.
std::string quality_of_service(bool latching);
bool is_latching(std::string_view quality_of_service);

// A message to be written.
struct StoredMessage {
  std::string topic{};
  MessageType type{};
  std::string (*definition)() = nullptr;  // definition_of<Message>
  std::int64_t stamp_ns = 0;
  bool latching = false;
  std::string bytes{};
};

// A bag in the making. Both throw Error (failed) where the disk does.
class BagSink {
 public:
  virtual ~BagSink() = default;
  // Appends it. Stamps need not ascend.
  virtual void write(const StoredMessage& message) = 0;
  // Ends the bag; without it the file is of no use.
  virtual void close() = 0;
};
std::unique_ptr<BagSink> new_ros1_bag(const std::filesystem::path& path,
                                      BagCompression compression);
// `folder` exists.
std::unique_ptr<BagSink> new_sqlite_bag(const std::filesystem::path& folder);
std::unique_ptr<BagSink> new_mcap(const std::filesystem::path& path, BagCompression compression);

// Compressed chunks of MCAP (https://mcap.dev/spec/registry#well-known-compression-formats): frames
// of LZ4 and Zstandard, by their libraries. `size` is what they are said to expand to. Memory grows
// with what they do expand to. Throws Error: another compression ("": none), broken, another size,
// more than 1 GiB.
std::string decompress_chunk(const std::string& compression, std::string_view bytes,
                             std::uint64_t size);
std::string compress_chunk(const std::string& compression, const std::string& bytes);

}  // namespace libmap
