#include "libmap/cloud/csv_codec.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/table.h"
#include "libmap/core/text.h"

namespace libmap {
namespace {

bool is_coordinate(const std::string& name) {
  return name.size() == 1 && std::string("xyzXYZ").find(name) != std::string::npos;
}

bool has_numbers(const Table& table, std::size_t column) {
  return std::any_of(table.rows.begin(), table.rows.end(),
                     [column](const auto& row) { return parse_double(row[column]).has_value(); });
}

// int32 if every cell is an integer of its range.
ScalarType type_of(const std::vector<double>& values) {
  const bool integers = std::all_of(values.begin(), values.end(), [](double value) {
    return fits_type(value, ScalarType::int32) && !(value == 0.0 && std::signbit(value));
  });
  return integers ? ScalarType::int32 : ScalarType::float64;
}

std::vector<double> numbers_of(const Table& table, std::size_t column) {
  const bool required = is_coordinate(table.columns[column]);
  std::vector<double> values(table.rows.size());
  for (std::size_t row = 0; row < values.size(); ++row)
    values[row] =
        required
            ? table.number(row, column)
            : table.optional_number(row, column).value_or(std::numeric_limits<double>::quiet_NaN());
  return values;
}

}  // namespace

GeometryColumns decode_csv(std::string_view text, const std::string& file) {
  const Table table = parse_csv(text, file);
  GeometryColumns content;
  content.info.format = "csv";
  content.info.encoding = FileEncoding::ascii;
  content.info.bytes = text.size();
  content.info.points = table.rows.size();
  content.vertices.rows = table.rows.size();
  for (std::size_t column = 0; column < table.columns.size(); ++column) {
    const std::string& name = table.columns[column];
    if (!table.rows.empty() && !is_coordinate(name) && !has_numbers(table, column)) {
      content.info.skipped.push_back("column " + name);
      continue;
    }
    const std::vector<double> values = numbers_of(table, column);
    const ScalarType type = is_coordinate(name) ? ScalarType::float64 : type_of(values);
    std::copy(values.begin(), values.end(), content.vertices.add_numbers(name, type));
    content.info.fields.push_back({name, type, 1});
  }
  return content;
}

void encode_csv(const ColumnSet& columns, std::ostream& out) {
  Table header;
  for (const Column& column : columns.columns) header.columns.push_back(column.name);
  out << to_csv(header);
  write_rows(columns.rows, out, [&](std::size_t begin, std::size_t end, std::string& text) {
    append_rows_of_text(columns.columns, begin, end, ',', text);
  });
}

}  // namespace libmap
