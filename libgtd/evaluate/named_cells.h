// Makes table rows from named cells, and JSON from rates, for the tables of libgtd/evaluate.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libgtd/evaluate/roc.h"
#include "libmap/core/table.h"

namespace libgtd {

using NamedCells = std::vector<std::pair<std::string, std::string>>;

// Appends a row; the names of its cells become the columns of the table.
inline void append(const NamedCells& row, libmap::Table& table) {
  table.columns.clear();
  table.rows.emplace_back();
  for (const auto& [name, cell] : row) {
    table.columns.push_back(name);
    table.rows.back().push_back(cell);
  }
}

using Json = nlohmann::ordered_json;

inline Json json_of(const std::optional<double>& value) {
  return value ? Json(*value) : Json(nullptr);
}

inline Json json_of(const std::optional<Interval>& interval) {
  return interval ? Json::array({interval->low, interval->high}) : Json(nullptr);
}

inline Json json_of(const Rate& rate) {
  return {{"count", rate.count},
          {"total", rate.total},
          {"value", json_of(rate.value())},
          {"wilson_95", json_of(rate.wilson_95())}};
}

}  // namespace libgtd
