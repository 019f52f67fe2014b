// What `graspmap info` and others write as JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "libmap/core/point_cloud.h"

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

}  // namespace graspmap_tools
