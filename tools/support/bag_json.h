// What a ROS 1 bag holds, as `graspmap bag --list --json` and `graspmap info` say it.
#pragma once

#include <nlohmann/json.hpp>

#include "libmap/ros/bag_reader.h"

namespace graspmap_tools {

nlohmann::ordered_json bag_json(const libmap::BagListing& listing);

}  // namespace graspmap_tools
