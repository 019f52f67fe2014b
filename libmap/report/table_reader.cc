#include "libmap/report/table_reader.h"

#include <algorithm>
#include <fstream>
#include <string>

#include "libmap/core/file_output.h"

namespace libmap {

namespace {

constexpr std::size_t head_bytes = std::size_t{4} << 20;

struct FileHead {
  std::string text;
  std::uint64_t lines = 0;  // of the whole file
  bool whole = true;
};

// Cut behind a line's end that is not within quotes.
void cut_at_row(std::string& text) {
  auto quotes = std::count(text.begin(), text.end(), '"');
  while (!text.empty()) {
    const std::size_t end = text.find_last_of('\n');
    if (end == std::string::npos) return;
    quotes -= std::count(text.begin() + static_cast<std::ptrdiff_t>(end), text.end(), '"');
    text.resize(end);
    if (quotes % 2 == 0) return;
  }
}

FileHead read_head(const std::filesystem::path& path) {
  require_readable_file(path);
  FileHead head;
  std::ifstream stream(path, std::ios::binary);
  head.text.resize(head_bytes);
  stream.read(head.text.data(), static_cast<std::streamsize>(head_bytes));
  head.text.resize(static_cast<std::size_t>(stream.gcount()));
  head.lines = static_cast<std::uint64_t>(std::count(head.text.begin(), head.text.end(), '\n'));
  char last = head.text.empty() ? '\n' : head.text.back();
  std::string more(head_bytes, '\0');
  while (stream.read(more.data(), static_cast<std::streamsize>(head_bytes)) ||
         stream.gcount() > 0) {
    head.whole = false;
    head.lines +=
        static_cast<std::uint64_t>(std::count(more.begin(), more.begin() + stream.gcount(), '\n'));
    last = more[static_cast<std::size_t>(stream.gcount()) - 1];
  }
  if (last != '\n') ++head.lines;
  if (!head.whole) cut_at_row(head.text);
  return head;
}

}  // namespace

ReportTable read_report_table(const std::filesystem::path& path,
                              const std::vector<OutlineColumn>& columns, std::size_t open_rows,
                              std::size_t max_rows) {
  const FileHead head = read_head(path);
  Table all = parse_csv(head.text, path.string());
  ReportTable shown;
  shown.open_rows = open_rows;
  if (!head.whole)
    shown.lines = head.lines;
  else if (all.rows.size() > max_rows)
    shown.lines = all.rows.size() + 1;
  std::vector<std::size_t> places;
  for (const OutlineColumn& column : columns) {
    places.push_back(all.column(column.name));
    shown.table.columns.push_back(column.name);
    shown.headings.push_back(column.heading);
  }
  if (all.rows.size() > max_rows) all.rows.resize(max_rows);
  if (columns.empty()) {
    shown.headings = all.columns;
    shown.table = std::move(all);
    return shown;
  }
  shown.table.file = all.file;
  for (const std::vector<std::string>& row : all.rows) {
    std::vector<std::string>& cells = shown.table.rows.emplace_back();
    for (const std::size_t place : places) cells.push_back(row[place]);
  }
  return shown;
}

}  // namespace libmap
