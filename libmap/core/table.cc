#include "libmap/core/table.h"

#include <algorithm>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

// Limit, because the time of some operations is proportional to the square of the columns.
constexpr std::size_t max_columns = 10000;

// Reads one record of `text` at `position` and moves `position` behind its end of line.
std::vector<std::string> next_record(std::string_view text, std::size_t& position,
                                     std::size_t& line) {
  std::vector<std::string> cells(1);
  bool quoted = false;
  while (position < text.size()) {
    const char c = text[position++];
    if (c == '\n') ++line;
    if (quoted) {
      if (c != '"') {
        cells.back() += c;
      } else if (position < text.size() && text[position] == '"') {
        cells.back() += text[position++];
      } else {
        quoted = false;
      }
    } else if (c == '"') {
      quoted = true;
    } else if (c == ',') {
      cells.emplace_back();
    } else if (c == '\n') {
      return cells;
    } else if (c != '\r' || (position < text.size() && text[position] != '\n')) {
      cells.back() += c;
    }
  }
  if (quoted) throw Error("a quote is not closed", {.field = "line " + std::to_string(line)});
  return cells;
}

bool is_blank(std::string_view text, std::size_t position) {
  const std::string_view line = text.substr(position, text.find('\n', position) - position);
  return trim(line).empty() || trim(line).front() == '#';
}

std::string quoted_cell(const std::string& cell) {
  if (cell.find_first_of(",\"\r\n#") == std::string::npos && trim(cell).size() == cell.size())
    return cell;
  std::string quoted = "\"";
  for (const char c : cell) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

}  // namespace

std::optional<std::size_t> Table::find_column(std::string_view name) const {
  const auto found = std::find(columns.begin(), columns.end(), name);
  if (found == columns.end()) return std::nullopt;
  return static_cast<std::size_t>(found - columns.begin());
}

std::size_t Table::column(std::string_view name) const {
  if (const auto found = find_column(name)) return *found;
  throw Error("no such column" + did_you_mean(name, columns),
              {.file = file, .field = "column '" + std::string(name) + "'"});
}

double Table::number(std::size_t row, std::size_t column) const {
  const std::optional<double> value = parse_double(rows[row][column]);
  if (value) return *value;
  throw Error("not a number",
              {.file = file,
               .field = "row " + std::to_string(row + 1) + ", column '" + columns[column] + "'",
               .value = "'" + rows[row][column] + "'"});
}

std::optional<double> Table::optional_number(std::size_t row, std::size_t column) const {
  if (trim(rows[row][column]).empty()) return std::nullopt;
  return number(row, column);
}

Table parse_csv(std::string_view text, const std::string& file) {
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  if (text.find('\n') == std::string_view::npos && text.find('\r') != std::string_view::npos) {
    std::string lines(text);  // line ends of classic Mac OS
    std::replace(lines.begin(), lines.end(), '\r', '\n');
    return parse_csv(lines, file);
  }
  if (text.find('\0') != std::string_view::npos) throw Error("not a text file", {.file = file});
  Table table;
  table.file = file;
  std::size_t position = 0;
  std::size_t line = 1;
  try {
    while (position < text.size()) {
      if (is_blank(text, position)) {
        const std::size_t end = text.find('\n', position);
        position = end == std::string_view::npos ? text.size() : end + 1;
        ++line;
        continue;
      }
      const std::size_t first_line = line;
      std::vector<std::string> cells = next_record(text, position, line);
      if (table.columns.empty()) {
        if (cells.size() > max_columns)
          throw Error("too many columns", {.field = "line " + std::to_string(first_line),
                                           .value = std::to_string(cells.size()) + " cells long",
                                           .bound = "<= " + std::to_string(max_columns)});
        for (const char other : {';', '\t'})
          if (cells.size() == 1 && cells.front().find(other) != std::string::npos)
            throw Error("columns must be separated by commas, and decimals by points",
                        {.field = "separator in line " + std::to_string(first_line),
                         .value = other == ';' ? "';'" : "tab",
                         .bound = "','"});
        for (std::string& cell : cells) table.columns.emplace_back(trim(cell));
        continue;
      }
      if (cells.size() != table.columns.size())
        throw Error("the header has " + std::to_string(table.columns.size()) + " columns",
                    {.field = "line " + std::to_string(first_line),
                     .value = std::to_string(cells.size()) + " cells long"});
      table.rows.push_back(std::move(cells));
    }
  } catch (const Error& error) {
    throw error.in_file(file);
  }
  if (table.columns.empty()) throw Error("no header line", {.file = file});
  return table;
}

Table read_csv(const std::filesystem::path& path) {
  return parse_csv(read_whole_file(path), path.string());
}

std::string csv_line(const std::vector<std::string>& cells) {
  std::string text;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (i > 0) text += ',';
    text += quoted_cell(cells[i]);
  }
  // A reader would skip an empty line.
  if (cells.size() == 1 && cells.front().empty()) text += "\"\"";
  return text + '\n';
}

std::string to_csv(const Table& table) {
  std::string text = csv_line(table.columns);
  for (const std::vector<std::string>& row : table.rows) text += csv_line(row);
  return text;
}

}  // namespace libmap
