// Rows of a table written together with the names of their columns; for *_tables.cc alone.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "libmap/core/table.h"

namespace libgtd {

using NamedCells = std::vector<std::pair<const char*, std::string>>;

inline void append(const NamedCells& row, libmap::Table& table) {
  table.columns.clear();
  table.rows.emplace_back();
  for (const auto& [name, cell] : row) {
    table.columns.emplace_back(name);
    table.rows.back().push_back(cell);
  }
}

}  // namespace libgtd
