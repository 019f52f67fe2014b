// CSV tables of points as columns.
#pragma once

#include <ostream>
#include <string>
#include <string_view>

#include "libmap/cloud/columns.h"

namespace libmap {

// Columns without a single number are passed over and named in info.skipped. Throws Error: a cell
// that is no number in a column of numbers, an empty cell in x, y or z.
GeometryColumns decode_csv(std::string_view text, const std::string& file);

// A header line and a row per point, each number as the shortest text that reads back the same.
void encode_csv(const ColumnSet& columns, std::ostream& out);

}  // namespace libmap
