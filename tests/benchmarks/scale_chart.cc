// Draws what scale.py measured: scale_chart TABLE.csv PICTURE.png. Columns: area_m2, pivots,
// wall_s, processor_s, peak_mib.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <string>
#include <vector>

#include "libmap/core/file_output.h"
#include "libmap/core/table.h"
#include "libmap/view/charts.h"
#include "libmap/view/image_io.h"

namespace {

using libmap::Chart;

std::vector<double> column(const libmap::Table& table, const std::string& name) {
  std::vector<double> values;
  for (std::size_t row = 0; row < table.rows.size(); ++row)
    values.push_back(table.number(row, table.column(name)));
  return values;
}

std::vector<double> logarithms(std::vector<double> values) {
  for (double& value : values) value = std::log10(value);
  return values;
}

Chart time_chart(const libmap::Table& table) {
  const std::vector<double> area = logarithms(column(table, "area_m2"));
  Chart chart;
  chart.title = "graspmap score: time";
  chart.x_axis.title = "log10 of the area in square meters";
  chart.y_axis.title = "log10 of the time in seconds";
  chart.legend = libmap::LegendCorner::top_left;
  chart.curves = {{.name = "on the clock",
                   .x = area,
                   .y = logarithms(column(table, "wall_s")),
                   .color = {},
                   .markers = true},
                  {.name = "of all processors",
                   .x = area,
                   .y = logarithms(column(table, "processor_s")),
                   .color = {},
                   .markers = true}};
  return chart;
}

Chart memory_chart(const libmap::Table& table) {
  const std::vector<double> area = logarithms(column(table, "area_m2"));
  const std::vector<double> peak = column(table, "peak_mib");
  Chart chart;
  chart.title = "graspmap score: memory";
  chart.x_axis.title = "log10 of the area in square meters";
  chart.y_axis.title = "largest resident memory, MiB";
  chart.y_axis.range = {0.0, std::max(1100.0, 1.1 * *std::max_element(peak.begin(), peak.end()))};
  chart.legend = libmap::LegendCorner::top_left;
  chart.curves = {{.name = "resident", .x = area, .y = peak, .color = {}, .markers = true},
                  {.name = "1 GiB",
                   .x = area,
                   .y = std::vector<double>(area.size(), 1024.0),
                   .color = {},
                   .dashed = true}};
  return chart;
}

libmap::ColorImage side_by_side(const libmap::ColorImage& left, const libmap::ColorImage& right) {
  libmap::ColorImage both(left.width + right.width, left.height);
  for (int v = 0; v < both.height; ++v)
    for (int u = 0; u < both.width; ++u)
      both.at(u, v) = u < left.width ? left.at(u, v) : right.at(u - left.width, v);
  return both;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "usage: scale_chart TABLE.csv PICTURE.png\n";
    return 2;
  }
  const libmap::Table table = libmap::read_csv(argv[1]);
  const libmap::ChartSize size{800, 600};
  libmap::write_whole_file(
      argv[2], libmap::to_png(side_by_side(libmap::draw_chart(time_chart(table), size),
                                           libmap::draw_chart(memory_chart(table), size))));
  return 0;
}
