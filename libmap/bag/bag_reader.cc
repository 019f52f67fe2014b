#include "libmap/bag/bag_reader.h"

#include <algorithm>

#include "libmap/bag/bag_storage.h"
#include "libmap/bag/ros_messages.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

namespace fs = std::filesystem;

const BagStorage& storage_of(const fs::path& file) {
  require_readable_file(file);
  const std::string head = file_head(file, 16);
  if (head.starts_with("#ROSBAG V2.0\n") || head.starts_with("#ROSBAG V1.")) return ros1_storage;
  if (head.starts_with("SQLite format 3")) return sqlite_storage;
  if (head.starts_with("\x89MCAP0\r\n")) return mcap_storage;
  throw Error("the file is not a bag",
              {.file = file.string(),
               .field = "first line",
               .value = ros_message::printable(head.substr(0, head.find('\n'))),
               .bound = "#ROSBAG V2.0 or V1.x, SQLite format 3 or MCAP"});
}

}  // namespace

std::string ros2_name(const MessageType& type) {
  std::string name = type.name;
  return name.insert(name.find('/'), "/msg");
}

bool BagTopic::is(const MessageType& other) const {
  return type == other.name || type == ros2_name(other);
}

bool BagTopic::has_definition_of(const MessageType& other) const {
  // In ROS 2, the name alone identifies the definition.
  return is(other) && (md5sum.empty() || md5sum == other.md5sum);
}

std::size_t RecordedTopics::index_of(const BagTopic& topic) {
  const auto [found, is_new] = known.emplace(
      std::tuple(topic.name, topic.type, topic.md5sum, topic.encoding), topics.size());
  const std::size_t index = found->second;
  if (is_new) topics.push_back(topic);
  topics[index].latching = topics[index].latching || topic.latching;
  return index;
}

void RecordedTopics::add(std::size_t index, std::size_t messages, std::int64_t first,
                         std::int64_t last) {
  topics[index].messages += messages;
  first_ns = std::min(first_ns, first);
  last_ns = std::max(last_ns, last);
}

bool has_bag_extension(const fs::path& path) {
  const std::string extension = lower_case(path.extension().string());
  return extension == ".bag" || extension == ".mcap" || extension == ".db3";
}

bool is_bag_path(const fs::path& path) {
  if (has_bag_extension(path)) return true;
  std::error_code code;
  if (!fs::is_directory(path, code)) return false;
  if (fs::exists(path / rosbag2_metadata_name, code)) return true;
  // A folder without metadata.yaml is a bag whose recording was not ended.
  return std::any_of(fs::directory_iterator(path, code), fs::directory_iterator(),
                     [](const fs::directory_entry& file) {
                       return file.path().extension() == ".db3" ||
                              file.path().extension() == ".mcap";
                     });
}

std::vector<fs::path> files_of_bag(const fs::path& path) {
  std::error_code code;
  if (!fs::is_directory(path, code)) return {path};
  std::vector<fs::path> files = {path / rosbag2_metadata_name};
  for (const std::string& name : read_rosbag2_metadata(files[0])) files.push_back(path / name);
  return files;
}

BagListing list_bag(const fs::path& path) {
  RecordedTopics recorded;
  BagListing listing;
  for (const fs::path& file : files_of_bag(path)) {
    if (file.filename() == rosbag2_metadata_name) continue;
    const BagStorage& storage = storage_of(file);
    listing.storage = storage.name;
    storage.list(file, recorded);
  }
  std::erase_if(recorded.topics, [](const BagTopic& topic) { return topic.messages == 0; });
  listing.topics = std::move(recorded.topics);
  for (const BagTopic& topic : listing.topics) listing.messages += topic.messages;
  if (listing.messages > 0) {
    listing.start_s = ros_message::seconds_of(recorded.first_ns);
    listing.end_s = ros_message::seconds_of(recorded.last_ns);
  }
  return listing;
}

void read_bag(const fs::path& path, const std::vector<BagRequest>& requests,
              const TakeMessage& take) {
  for (const fs::path& file : files_of_bag(path)) {
    if (file.filename() == rosbag2_metadata_name) continue;
    const BagStorage& storage = storage_of(file);
    if (!requests.empty()) storage.read(file, requests, take);
  }
}

const BagTopic& require_topic(const BagListing& listing, const std::string& name,
                              const MessageType& type) {
  std::vector<std::string> names;
  for (const BagTopic& topic : listing.topics) {
    if (topic.name == name && topic.has_definition_of(type)) return topic;
    if (topic.name == name && topic.is(type))
      throw Error("not the md5sum of the supported definition of " + topic.type,
                  {.field = "md5sum of " + name, .value = topic.md5sum, .bound = type.md5sum});
    if (topic.name == name)
      throw Error("not the required type",
                  {.field = "type of " + name, .value = topic.type, .bound = type.name});
    names.push_back(topic.name);
  }
  std::string known;
  for (const BagTopic& topic : listing.topics)
    if (topic.is(type)) known += (known.empty() ? "one of " : ", ") + topic.name;
  throw Error("no such topic with messages" + did_you_mean(name, names),
              {.field = "topic", .value = name, .bound = known});
}

}  // namespace libmap
