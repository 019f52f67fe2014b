// graspmap chart: columns of a table as curves.
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/table.h"
#include "libmap/core/text.h"
#include "libmap/view/charts.h"
#include "libmap/view/image_io.h"
#include "libmap/view/virtual_display.h"
#include "tools/command_line.h"

namespace {

using graspmap_tools::Run;

const std::vector<std::pair<std::string, libmap::LegendCorner>>& legend_names() {
  static const std::vector<std::pair<std::string, libmap::LegendCorner>> names = {
      {"none", libmap::LegendCorner::none},
      {"top-left", libmap::LegendCorner::top_left},
      {"top-right", libmap::LegendCorner::top_right},
      {"bottom-left", libmap::LegendCorner::bottom_left},
      {"bottom-right", libmap::LegendCorner::bottom_right}};
  return names;
}

constexpr std::size_t most_curves = 500;

struct ChartOptions {
  std::string table;
  std::string output;
  std::string x;
  std::string y;
  std::string series;
  std::string series_title;
  std::string title;
  std::string x_title;
  std::string y_title;
  std::string x_min = "auto";
  std::string x_max = "auto";
  std::string y_min = "auto";
  std::string y_max = "auto";
  bool markers = true;
  libmap::LegendCorner legend = libmap::LegendCorner::top_right;
  libmap::ChartSize size;
};

void bind(libmap::ParameterTable& table, ChartOptions& options) {
  constexpr libmap::Range pixels{200, 16384};
  table.add("x", options.x, "column of the horizontal axis");
  table.add("y", options.y, "columns of the curves, with commas between");
  table.add("series", options.series,
            "columns whose different texts are curves of their own, with commas between");
  table.add("series_title", options.series_title, "before each of those texts, in the legend");
  table.add("title", options.title, "above the chart");
  table.add("x_title", options.x_title, "of the horizontal axis; empty: the column's name");
  table.add("y_title", options.y_title, "of the vertical axis; empty: the columns' names");
  table.add("x_min", options.x_min, "left end of the horizontal axis; auto: from the data");
  table.add("x_max", options.x_max, "right end of the horizontal axis; auto: from the data");
  table.add("y_min", options.y_min, "lower end of the vertical axis; auto: from the data");
  table.add("y_max", options.y_max, "upper end of the vertical axis; auto: from the data");
  table.add("markers", options.markers, "a dot at each value");
  table.add("legend", options.legend, legend_names(), "where the curves' names stand");
  table.add("width_px", options.size.width_px, pixels, "width of the picture, pixels");
  table.add("height_px", options.size.height_px, pixels, "height of the picture, pixels");
}

std::string series_of(const libmap::Table& table, std::size_t row,
                      const std::vector<std::size_t>& columns) {
  std::string text;
  for (const std::size_t column : columns)
    text += (text.empty() ? "" : ", ") + table.rows[row][column];
  return text;
}

std::optional<double> finite_number(const libmap::Table& table, std::size_t row,
                                    std::size_t column) {
  const auto value = table.optional_number(row, column);
  if (value && !std::isfinite(*value))
    throw libmap::Error("cannot be drawn", {.file = table.file,
                                            .field = "row " + std::to_string(row + 1) +
                                                     ", column '" + table.columns[column] + "'",
                                            .value = table.rows[row][column],
                                            .bound = "a finite number, or nothing"});
  return value;
}

// Rows without one of the two numbers are passed over. Curves stand in the order in which their
// names first appear, their points as the x ascend.
void add_curves(const libmap::Table& table, const ChartOptions& options, const std::string& y,
                bool several, libmap::Chart& chart) {
  const std::size_t x_column = table.column(options.x);
  const std::size_t y_column = table.column(y);
  std::vector<std::size_t> series;
  for (const std::string& name : libmap::split_list(options.series))
    series.push_back(table.column(name));
  const std::string& asked = options.series.empty() ? options.y : options.series;
  std::vector<std::string> names;
  std::map<std::string, std::size_t> places;  // in `names`
  std::vector<std::vector<std::pair<double, double>>> points;
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    const auto x = finite_number(table, row, x_column);
    const auto value = finite_number(table, row, y_column);
    if (!x || !value) continue;
    const auto [at, is_new] = places.emplace(series_of(table, row, series), names.size());
    if (is_new) {
      if (chart.curves.size() + names.size() == most_curves)
        throw libmap::Error("makes more curves than a chart can show",
                            {.file = table.file,
                             .field = options.series.empty() ? "--y" : "--series",
                             .value = asked.substr(0, 80),
                             .bound = "<= " + std::to_string(most_curves)});
      names.push_back(at->first);
      points.emplace_back();
    }
    points[at->second].emplace_back(*x, *value);
  }
  for (std::size_t c = 0; c < names.size(); ++c) {
    std::stable_sort(points[c].begin(), points[c].end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    libmap::ChartCurve& curve = chart.curves.emplace_back();
    if (!series.empty()) curve.name = options.series_title + names[c];
    if (several) curve.name = y + (curve.name.empty() ? "" : ": " + curve.name);
    curve.markers = options.markers;
    for (const auto& [x, value] : points[c]) {
      curve.x.push_back(x);
      curve.y.push_back(value);
    }
  }
}

std::optional<double> end_of_axis(const std::string& text, const char* name) {
  if (text == "auto") return std::nullopt;
  const auto value = libmap::parse_double(text);
  if (!value || !std::isfinite(*value))
    throw libmap::Error("not an end of an axis",
                        {.field = name, .value = text, .bound = "auto or a number"});
  return value;
}

// range_with(values) is that of the data and of the end that is given; the other end is its.
template <typename Range>
std::pair<double, double> range_of(const std::string& low_text, const std::string& high_text,
                                   const char* low_name, const char* high_name,
                                   const Range& range_with) {
  const std::optional<double> low = end_of_axis(low_text, low_name);
  const std::optional<double> high = end_of_axis(high_text, high_name);
  if (low && high && !(*low < *high))
    throw libmap::Error("the axis ends before it begins",
                        {.field = high_name, .value = high_text, .bound = "> " + low_text});
  if (low && high && !std::isfinite(*high - *low))
    throw libmap::Error(
        "the axis is too wide to be drawn",
        {.field = high_name, .value = high_text, .bound = "less than 1.8e308 beyond " + low_text});
  std::vector<double> ends;
  if (low) ends.push_back(*low);
  if (high) ends.push_back(*high);
  const std::pair<double, double> found = range_with(ends);
  const std::pair<double, double> range = {low.value_or(found.first), high.value_or(found.second)};
  return range.first < range.second ? range : found;
}

libmap::Chart chart_of(const libmap::Table& table, const ChartOptions& options) {
  const std::vector<std::string> columns = libmap::split_list(options.y);
  if (columns.empty())
    throw libmap::Error("no column is named", {.field = "--y", .bound = "a column of the table"});
  libmap::Chart chart;
  chart.title = options.title;
  chart.legend = options.legend;
  chart.x_axis.title = options.x_title.empty() ? options.x : options.x_title;
  chart.y_axis.title = options.y_title.empty() ? options.y : options.y_title;
  for (const std::string& y : columns) add_curves(table, options, y, columns.size() > 1, chart);
  // Those below are wider: of curves that are one, each shows.
  const auto curves = static_cast<double>(chart.curves.size());
  for (std::size_t c = 0; c < chart.curves.size(); ++c)
    chart.curves[c].width_px = 2.0 + std::min(8.0 / curves, 1.5) * (curves - 1.0 - double(c));
  if (chart.curves.empty())
    throw libmap::Error("no row with numbers in both columns",
                        {.file = table.file, .field = options.x + ", " + options.y});
  chart.x_axis.range = range_of(options.x_min, options.x_max, "--x-min", "--x-max",
                                [&](const auto& ends) { return x_range(chart, ends); });
  chart.y_axis.range = range_of(options.y_min, options.y_max, "--y-min", "--y-max",
                                [&](const auto& ends) { return y_range(chart, ends); });
  try {
    chart.check();
  } catch (const libmap::Error& error) {
    throw error.in_file(table.file);
  }
  return chart;
}

void draw(const ChartOptions& options, Run& run) {
  const std::string extension = std::filesystem::path(options.output).extension().string();
  if (extension != ".png" && extension != ".svg")
    throw libmap::Error("charts are written as .png or .svg", {.file = options.output});
  run.claim_output(options.output, {options.table});
  const libmap::Table table = libmap::read_csv(options.table);
  run.add_input(options.table);
  const libmap::Chart chart = chart_of(table, options);
  run.manifest().results.emplace_back("curves", static_cast<std::int64_t>(chart.curves.size()));
  const libmap::VirtualDisplay display;
  run.write_output(options.output, [&](const auto& temporary) {
    if (extension == ".svg")
      libmap::write_chart_svg(temporary, chart, options.size);
    else
      libmap::write_text(temporary, libmap::to_png(libmap::draw_chart(chart, options.size)));
  });
}

}  // namespace

int main(int argc, char** argv) {
  ChartOptions options;
  graspmap_tools::Command command("chart", "Columns of a table as curves.");
  command.input("TABLE.csv", options.table, "CSV with a header line");
  command.output(options.output, "picture (.png, .svg)");
  bind(command.parameters(), options);
  return command.run(argc, argv, [&](Run& run) { draw(options, run); });
}
