// A table of text cells with named columns, as CSV files hold it (RFC 4180).
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace libmap {

struct Table {
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;  // each as long as `columns`
  std::string file;                            // where it was read from, for errors; may be empty

  std::optional<std::size_t> find_column(std::string_view name) const;  // its index
  // Throws Error naming the file, the column and the nearest known one.
  std::size_t column(std::string_view name) const;
  // The cell as a number. Throws Error naming file, line and column if it is not one.
  double number(std::size_t row, std::size_t column) const;
  // The same, nothing for an empty cell.
  std::optional<double> optional_number(std::size_t row, std::size_t column) const;
};

// CSV text with a header line; quotes as in RFC 4180; CRLF, LF or CR; a UTF-8 byte order mark,
// empty lines and lines that begin with '#' are passed over. A row of another length and a header
// with another separator are an Error.
Table parse_csv(std::string_view text, const std::string& file);
Table read_csv(const std::filesystem::path& path);
std::string to_csv(const Table& table);
// One row of it, its end of line included.
std::string csv_line(const std::vector<std::string>& cells);

}  // namespace libmap
