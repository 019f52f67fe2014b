// metadata.yaml of a rosbag2 folder (https://github.com/ros2/rosbag2:
// rosbag2_storage/include/rosbag2_storage/yaml.hpp). Inner part of bag_reader and sqlite_bag.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "libmap/ros/bag_storage.h"

namespace libmap {

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

}  // namespace libmap
