// Converts results of stages to JSON for output, and results of finished tiles to JSON and back.
#pragma once

#include <nlohmann/json.hpp>
#include <variant>
#include <vector>

#include "libmap/core/point_cloud.h"
#include "libmap/core/result_table.h"

namespace graspmap_tools {

nlohmann::ordered_json to_json(const libmap::ManifestValue& value);
nlohmann::ordered_json to_json(const libmap::ResultTable& table);  // missing values are null

inline nlohmann::ordered_json numbers_json(const Eigen::Vector3d& position) {
  return {position.x(), position.y(), position.z()};
}
// Returns the bounding box as {"min": [x, y, z], "max": ...}; null if there are no positions.
inline nlohmann::ordered_json bounds_json(const std::vector<Eigen::Vector3d>& positions) {
  if (positions.empty()) return nullptr;
  const libmap::Bounds3d bounds = libmap::bounds_of(positions);
  return {{"min", numbers_json(bounds.min)}, {"max", numbers_json(bounds.max)}};
}

// Prints JSON to standard output, with replacement characters for invalid UTF-8.
void print_json(const nlohmann::ordered_json& json);

// Convert those results of a tile that are merged over tiles (Merge) to JSON, and back.
template <typename Result>
nlohmann::json tile_json_of(const Result& result) {
  nlohmann::json data;
  const libmap::ResultTable table = libmap::described(result);
  for (const libmap::TileField& field : table.tile_fields())
    data[field.key] = to_json(field.value());
  return data;
}

template <typename Result>
Result result_of(const nlohmann::json& data) {
  Result result;
  const libmap::ResultTable table = libmap::described(result);
  for (const libmap::TileField& field : table.tile_fields()) {
    if (std::holds_alternative<double>(field.value()))
      field.set(data.at(field.key).get<double>());
    else
      field.set(data.at(field.key).get<std::int64_t>());
  }
  return result;
}

}  // namespace graspmap_tools
