// What `graspmap info` and others write as JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/ros/bag_reader.h"

namespace graspmap_tools {

inline nlohmann::ordered_json numbers_json(const Eigen::Vector3d& place) {
  return {place.x(), place.y(), place.z()};
}

// null if there are no positions.
inline nlohmann::ordered_json bounds_json(const std::vector<Eigen::Vector3d>& positions) {
  if (positions.empty()) return nullptr;
  const libmap::Bounds3d bounds = libmap::bounds_of(positions);
  return {{"min", numbers_json(bounds.min)}, {"max", numbers_json(bounds.max)}};
}

// Topics, messages and times of a bag.
inline nlohmann::ordered_json bag_json(const libmap::BagListing& listing) {
  nlohmann::ordered_json topics = nlohmann::ordered_json::array();
  for (const libmap::BagTopic& topic : listing.topics)
    topics.push_back({{"name", topic.name},
                      {"type", topic.type},
                      {"md5sum", topic.md5sum},
                      {"messages", topic.messages},
                      {"latching", topic.latching}});
  return {{"messages", listing.messages},
          {"start_s", listing.start_s},
          {"end_s", listing.end_s},
          {"topics", topics}};
}

}  // namespace graspmap_tools
