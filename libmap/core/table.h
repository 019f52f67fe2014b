// Table of text cells with named columns, and CSV as file format (RFC 4180).
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
  std::string file;                            // source file, for errors; can be empty

  std::optional<std::size_t> find_column(std::string_view name) const;  // index or nullopt
  // Returns a column's index. If missing, throws Error naming file, column and a similar column.
  std::size_t column(std::string_view name) const;
  // Returns a cell as a number. Throws Error naming file, row (from 1) and column for other text.
  double number(std::size_t row, std::size_t column) const;
  // Returns a cell as a number, or nullopt if it is empty. Throws as number() does.
  std::optional<double> optional_number(std::size_t row, std::size_t column) const;
};

// Parses CSV text with a header line, quotes as in RFC 4180 and line ends CRLF, LF or CR. Skips a
// UTF-8 byte order mark, empty lines and lines that begin with '#'. Throws Error if there is no
// header, a row has another length, the separator is not a comma, or the text is otherwise invalid.
Table parse_csv(std::string_view text, const std::string& file);
Table read_csv(const std::filesystem::path& path);  // throws also if the file cannot be read
std::string to_csv(const Table& table);             // returns CSV text with a header line
// Returns one row of CSV text with the end of line.
std::string csv_line(const std::vector<std::string>& cells);

}  // namespace libmap
