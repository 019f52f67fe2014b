#include "libmap/report/html.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "libmap/core/text.h"

namespace libmap {

namespace {

constexpr int max_decimals = 3;
constexpr std::size_t open_rows = 40;

bool has_fraction(std::string_view cell) {
  return cell.find_first_of(".eE") != std::string_view::npos;
}

std::string head_html(const ReportTable& table, const std::vector<NumberStyle>& styles) {
  std::string html = "<thead><tr>";
  for (std::size_t column = 0; column < table.headings.size(); ++column)
    html += fmt::format("<th scope=\"col\"{}>{}</th>",
                        styles[column].numeric && column > 0 ? " class=\"number\"" : "",
                        breakable_html(table.headings[column]));
  return html + "</tr></thead>\n";
}

std::string rows_html(const ReportTable& table, const std::vector<NumberStyle>& styles,
                      std::size_t begin, std::size_t end, const std::string& row_attribute) {
  std::string html = "<tbody>\n";
  for (std::size_t n = begin; n < end; ++n) {
    html += row_attribute.empty() ? "<tr>" : fmt::format("<tr {}=\"{}\">", row_attribute, n);
    const std::vector<std::string>& row = table.table.rows[n];
    for (std::size_t column = 0; column < row.size(); ++column) {
      const std::string& cell = row[column];
      if (column == 0) {
        html += "<th scope=\"row\">" + escape_html(cell) + "</th>";
        continue;
      }
      const std::string text = shown_number(cell, styles[column]);
      html += cell_html({text, text == cell ? "" : cell}, styles[column].numeric);
    }
    html += "</tr>\n";
  }
  return html + "</tbody>";
}

}  // namespace

NumberStyle number_style(const std::vector<std::string>& cells) {
  NumberStyle style;
  double largest = 0.0;
  bool fractions = false;
  for (const std::string& cell : cells) {
    if (trim(cell).empty() || trim(cell) == "nan") continue;
    const auto number = parse_double(cell);
    if (!number) return {};
    style.numeric = true;
    if (!std::isfinite(*number)) continue;
    largest = std::max(largest, std::abs(*number));
    if (!has_fraction(cell)) continue;
    fractions = true;
    // Decimals of the shortest form: "0.10000000" has one.
    const std::string text = to_text(*number);
    const std::size_t point = text.find('.');
    const bool exponent = text.find('e') != std::string::npos;
    const int decimals = exponent                     ? max_decimals
                         : point == std::string::npos ? 0
                                                      : static_cast<int>(text.size() - point - 1);
    style.decimals = std::max(style.decimals, std::min(decimals, max_decimals));
  }
  style.as_given = !fractions;
  if (fractions && largest > 0.0 && largest < 0.01) style.decimals = -1;
  if (fractions && largest >= 1e9) style.decimals = -1;
  return style;
}

std::string shown_number(const std::string& cell, const NumberStyle& style) {
  if (!style.numeric || style.as_given) return cell;
  const auto number = parse_double(cell);
  if (!number) return trim(cell) == "nan" ? "\xE2\x80\x93" : cell;
  if (!std::isfinite(*number)) return "\xE2\x80\x93";
  return style.decimals < 0 ? short_number(*number) : to_fixed_text(*number, style.decimals);
}

std::string short_number(double value) {
  if (!std::isfinite(value)) return "\xE2\x80\x93";
  if (value == std::floor(value) && std::abs(value) < 1e9) return fmt::format("{:.0f}", value);
  if (std::abs(value) >= 1000.0 && std::abs(value) < 1e9) return fmt::format("{:.0f}", value);
  return fmt::format("{:.3g}", value);
}

std::string cell_html(const CellText& cell, bool numeric) {
  return "<td" + std::string(numeric ? " class=\"number\"" : "") + attribute("title", cell.title) +
         ">" + escape_html(cell.text) + "</td>";
}

std::string table_html(const ReportTable& table, const std::string& row_attribute) {
  std::vector<NumberStyle> styles;
  for (std::size_t column = 0; column < table.headings.size(); ++column) {
    std::vector<std::string> cells;
    for (const std::vector<std::string>& row : table.table.rows) cells.push_back(row[column]);
    styles.push_back(number_style(cells));
  }
  const std::size_t rows = table.table.rows.size();
  // A few additional rows are not folded.
  const std::size_t open = rows <= open_rows + 5 || !row_attribute.empty() ? rows : open_rows;
  const std::string head = head_html(table, styles);
  std::string html =
      "<table>" + head + rows_html(table, styles, 0, open, row_attribute) + "</table>\n";
  if (open < rows)
    html += fmt::format(
        "<details class=\"more\"><summary>{} more rows</summary>\n<table>{}{}"
        "</table></details>\n",
        rows - open, head, rows_html(table, styles, open, rows, row_attribute));
  return html;
}

std::string scroll_box(const std::string& table, const std::string& name) {
  return "<div class=\"scroll\" tabindex=\"0\" role=\"region\"" + attribute("aria-label", name) +
         ">\n" + table + "</div>\n";
}

}  // namespace libmap
