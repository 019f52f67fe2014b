#include "libmap/ros/rosbag2_metadata.h"

#include <yaml-cpp/yaml.h>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/yaml_document.h"
#include "libmap/ros/ros_messages.h"

namespace libmap {

namespace {

namespace fs = std::filesystem;

YAML::Node field_of(const YAML::Node& map, const char* name) {
  return map.IsMap() ? map[name] : YAML::Node(YAML::NodeType::Undefined);
}

std::string text_of(const YAML::Node& map, const char* name) {
  const YAML::Node node = field_of(map, name);
  return node && node.IsScalar() ? node.Scalar() : std::string();
}

// Older versions put the folder's name before the file's.
std::string name_of_file(const YAML::Node& node) {
  const std::string name =
      node.IsScalar() ? fs::path(node.Scalar()).filename().string() : std::string();
  if (name.empty() || name == "." || name == "..")
    throw at_node(Error("is no name of a file"), "relative_file_paths", node);
  return name;
}

std::string lines_of_topic(const BagTopic& topic) {
  std::string quality;
  for (const char c : quality_of_service(topic.latching))
    quality += c == '\n' ? std::string("\\n") : std::string(1, c);
  return "    - topic_metadata:\n        name: " + topic.name + "\n        type: " + topic.type +
         "\n        serialization_format: cdr\n        offered_qos_profiles: \"" + quality +
         "\"\n      message_count: " + std::to_string(topic.messages) + "\n";
}

std::string lines_of_times(const RecordedTopics& topics, const std::string& indent) {
  const std::int64_t duration = topics.last_ns - topics.first_ns;
  return indent + "duration:\n" + indent + "  nanoseconds: " + std::to_string(duration) + "\n" +
         indent + "starting_time:\n" + indent +
         "  nanoseconds_since_epoch: " + std::to_string(topics.first_ns) + "\n";
}

}  // namespace

std::vector<std::string> read_rosbag2_metadata(const fs::path& path) {
  if (!fs::exists(path))
    throw Error(
        "no such file: its recording was not ended (`ros2 bag reindex` makes one), or this "
        "is no bag",
        {.file = path.string()});
  std::vector<std::string> names;
  read_yaml(read_whole_file(path, max_yaml_bytes), path.string(), [&](const YAML::Node& document) {
    const YAML::Node bag = field_of(document, "rosbag2_bagfile_information");
    if (!bag || !bag.IsMap()) throw Error("is missing", {.field = "rosbag2_bagfile_information"});
    const std::string format = text_of(bag, "compression_format");
    if (!format.empty())
      throw Error("compressed folders are not read (`ros2 bag convert` decompresses)",
                  {.field = "compression_format", .value = ros_message::printable(format)});
    const YAML::Node files = field_of(bag, "relative_file_paths");
    if (!files || !files.IsSequence() || files.size() == 0)
      throw Error("names no file", {.field = "relative_file_paths"});
    for (const YAML::Node& file : files) names.push_back(name_of_file(file));
  });
  return names;
}

std::string rosbag2_metadata(const RecordedTopics& topics, const std::string& storage,
                             const std::string& file) {
  std::size_t messages = 0;
  std::string lines;
  for (const BagTopic& topic : topics.topics) {
    messages += topic.messages;
    lines += lines_of_topic(topic);
  }
  const std::string count = std::to_string(messages);
  return "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: " + storage + "\n" +
         lines_of_times(topics, "  ") + "  message_count: " + count +
         "\n  topics_with_message_count:\n" + lines +
         "  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    - " +
         file + "\n  files:\n    - path: " + file + "\n" + lines_of_times(topics, "      ") +
         "      message_count: " + count + "\n";
}

std::string quality_of_service(bool latching) {
  if (!latching) return {};
  const std::string forever = "\n    sec: 9223372036\n    nsec: 854775807\n";
  return "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n  deadline:" + forever +
         "  lifespan:" + forever + "  liveliness: 1\n  liveliness_lease_duration:" + forever +
         "  avoid_ros_namespace_conventions: false";
}

bool is_latching(std::string_view quality_of_service) {
  return quality_of_service.find("durability: 1") != std::string_view::npos ||
         quality_of_service.find("durability: transient_local") != std::string_view::npos;
}

}  // namespace libmap
