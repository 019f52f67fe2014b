#include "libmap/view/charts.h"

#include <sys/mman.h>
#include <unistd.h>
#include <vtkAxis.h>
#include <vtkBrush.h>
#include <vtkChartLegend.h>
#include <vtkChartXY.h>
#include <vtkContextActor.h>
#include <vtkContextScene.h>
#include <vtkDoubleArray.h>
#include <vtkNew.h>
#include <vtkPen.h>
#include <vtkPlotArea.h>
#include <vtkPlotLine.h>
#include <vtkRenderWindow.h>
#include <vtkRenderer.h>
#include <vtkSVGExporter.h>
#include <vtkStringArray.h>
#include <vtkTable.h>
#include <vtkTextProperty.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <locale>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/text.h"
#include "libmap/view/offscreen.h"

namespace libmap {
namespace {

// Okabe and Ito 2008.
constexpr std::array<Color, 7> palette = {{{0, 114, 178},
                                           {213, 94, 0},
                                           {0, 158, 115},
                                           {204, 121, 167},
                                           {230, 159, 0},
                                           {86, 180, 233},
                                           {0, 0, 0}}};
constexpr Color diagonal_color = {150, 150, 150};

// Around the frame, in pixels. VTK's SVG writer turns the clipping frame upside down: nothing shows
// of it if `above` and `below` are the same.
struct Margins {
  int left = 105, right = 45, above = 82, below = 82;
};
constexpr Margins margins;

// Plain digits for numbers of everyday size, powers of ten for others.
std::string tick_text(double value, double largest) {
  if (largest >= 1e7 || largest < 1e-3) return to_text(value);
  std::array<char, 400> buffer;
  const auto end =
      std::to_chars(buffer.data(), buffer.data() + buffer.size(), value, std::chars_format::fixed);
  return std::string(buffer.data(), end.ptr);
}

// More letters than any chart has room for; VTK draws all, in seconds where there are thousands.
std::string shown(const std::string& text) {
  std::size_t most = 400;
  if (text.size() <= most) return text;
  while (most > 0 && (static_cast<unsigned char>(text[most]) & 0xC0U) == 0x80U) --most;
  return text.substr(0, most) + "...";
}

void check_numbers(const std::vector<double>& values, const std::string& field) {
  for (const double value : values)
    if (!std::isfinite(value))
      throw Error("cannot be drawn",
                  {.field = field, .value = to_text(value), .bound = "a finite number"});
}

void check_axis(const ChartAxis& axis, const std::string& field) {
  if (!axis.range) return;
  const auto [low, high] = *axis.range;
  if (!std::isfinite(high - low) || !(low < high))
    throw Error("cannot be drawn", {.field = field,
                                    .value = to_text(low) + " to " + to_text(high),
                                    .bound = "finite, its width too, and ascending"});
}

// Low and high of what is drawn, widened to round numbers; 0 to 1 where nothing is.
std::pair<double, double> range_around(const std::vector<double>& values) {
  if (values.empty()) return {0.0, 1.0};
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  if (*low == *high) {
    const double margin = std::max(0.5, std::abs(*low) * 0.5);
    return {*low - margin, *high + margin};
  }
  const std::vector<double> ticks = round_ticks(*low, *high, 10);
  const double step = ticks.size() > 1 ? ticks[1] - ticks[0] : *high - *low;
  return {std::floor(*low / step + 1e-9) * step, std::ceil(*high / step - 1e-9) * step};
}

}  // namespace

std::pair<double, double> x_range(const Chart& chart, std::vector<double> values) {
  if (chart.x_axis.range) return *chart.x_axis.range;
  for (const ChartCurve& curve : chart.curves)
    values.insert(values.end(), curve.x.begin(), curve.x.end());
  for (const ChartHistogram& histogram : chart.histograms) {
    values.push_back(histogram.first_edge);
    values.push_back(histogram.first_edge +
                     static_cast<double>(histogram.heights.size()) * histogram.bin_width);
  }
  return range_around(values);
}

std::pair<double, double> y_range(const Chart& chart, std::vector<double> values) {
  if (chart.y_axis.range) return *chart.y_axis.range;
  for (const ChartCurve& curve : chart.curves)
    values.insert(values.end(), curve.y.begin(), curve.y.end());
  for (const ChartHistogram& histogram : chart.histograms) {
    values.insert(values.end(), histogram.heights.begin(), histogram.heights.end());
    values.push_back(0.0);  // bars stand on zero
  }
  return range_around(values);
}

namespace {

// One axis of the drawing: the numbers low..high over the pixels from..to. VTK is given pixels and
// nothing else: its SVG writer clips before it transforms, rounds to six digits after it subtracts
// from the height, and scales the pen with the data; none of it shows if its transform is none.
struct PixelAxis {
  double low, high;
  double from_px, to_px;

  double pixel(double value) const {
    return from_px + (value - low) / (high - low) * (to_px - from_px);
  }
  std::vector<double> pixels(const std::vector<double>& values) const {
    std::vector<double> result;
    result.reserve(values.size());
    for (const double value : values) result.push_back(pixel(value));
    return result;
  }
};

// Ticks are placed and written here, not by VTK: the same under every locale.
void set_axis(vtkAxis* axis, const std::string& title, const PixelAxis& range) {
  axis->SetBehavior(vtkAxis::FIXED);
  axis->SetRange(range.from_px, range.to_px);
  axis->SetTitle(shown(title));
  vtkNew<vtkDoubleArray> positions;
  vtkNew<vtkStringArray> labels;
  const std::vector<double> ticks = round_ticks(range.low, range.high, 10);
  const double largest = std::max(std::abs(range.low), std::abs(range.high));
  for (const double tick : ticks) {
    positions->InsertNextValue(range.pixel(tick));
    labels->InsertNextValue(tick_text(tick, largest));
  }
  axis->SetCustomTickPositions(positions, labels);
  axis->GetTitleProperties()->SetFontSize(20);
  axis->GetTitleProperties()->SetBold(false);
  axis->GetLabelProperties()->SetFontSize(17);
  axis->GetGridPen()->SetColor(210, 210, 210, 255);
  axis->GetPen()->SetColor(60, 60, 60, 255);
}

vtkNew<vtkDoubleArray> column_of(const char* name, const std::vector<double>& values) {
  vtkNew<vtkDoubleArray> column;
  column->SetName(name);
  for (const double value : values) column->InsertNextValue(value);
  return column;
}

// The legend writes its text against its symbol.
std::string legend_text(const std::string& name) { return " " + shown(name); }

void add_line(vtkChartXY* chart, std::vector<double> x_px, std::vector<double> y_px,
              const ChartCurve& look, const Color& color) {
  if (x_px.size() == 1) {  // VTK complains of a line with one point
    x_px.push_back(x_px[0]);
    y_px.push_back(y_px[0]);
  }
  vtkNew<vtkTable> table;
  table->AddColumn(column_of("x", x_px));
  table->AddColumn(column_of("y", y_px));
  vtkNew<vtkPlotLine> line;
  line->SetInputData(table, 0, 1);
  line->SetLabel(legend_text(look.name));
  line->SetLegendVisibility(!look.name.empty());
  line->SetColor(color[0], color[1], color[2], 255);
  line->GetPen()->SetWidth(static_cast<float>(look.width_px));
  line->GetPen()->SetLineType(look.dashed ? vtkPen::DASH_LINE : vtkPen::SOLID_LINE);
  line->SetMarkerStyle(look.markers ? vtkPlotPoints::CIRCLE : vtkPlotPoints::NONE);
  line->SetMarkerSize(static_cast<float>(look.width_px) * 3.5F);
  chart->AddPlot(line);
}

// A filled step curve with an outline: bars that stand on zero.
void add_histogram(vtkChartXY* chart, const ChartHistogram& histogram, const Color& color,
                   const PixelAxis& x_axis, const PixelAxis& y_axis) {
  const double zero = y_axis.pixel(0.0);
  std::vector<double> x, y, outline_x, outline_y;
  for (std::size_t i = 0; i < histogram.heights.size(); ++i) {
    const double edge = histogram.first_edge + static_cast<double>(i) * histogram.bin_width;
    const double left = x_axis.pixel(edge), right = x_axis.pixel(edge + histogram.bin_width);
    const double height = y_axis.pixel(histogram.heights[i]);
    x.insert(x.end(), {left, right});
    y.insert(y.end(), {height, height});
    outline_x.insert(outline_x.end(), {left, left, right, right});
    outline_y.insert(outline_y.end(), {zero, height, height, zero});
  }
  vtkNew<vtkTable> table;
  table->AddColumn(column_of("x", x));
  table->AddColumn(column_of("zero", std::vector<double>(x.size(), zero)));
  table->AddColumn(column_of("height", y));
  vtkNew<vtkPlotArea> area;
  area->SetInputData(table);
  area->SetInputArray(0, "x");
  area->SetInputArray(1, "zero");
  area->SetInputArray(2, "height");
  area->SetLabel(legend_text(histogram.name));
  area->SetLegendVisibility(!histogram.name.empty());
  area->GetBrush()->SetColor(color[0], color[1], color[2], 110);
  area->GetPen()->SetColor(color[0], color[1], color[2], 255);
  chart->AddPlot(area);
  ChartCurve outline;
  outline.width_px = 1.0;
  add_line(chart, outline_x, outline_y, outline, color);
}

void set_legend(vtkChartXY* chart, LegendCorner corner, bool any_name) {
  if (corner == LegendCorner::none || !any_name) {
    chart->SetShowLegend(false);
    return;
  }
  const bool left = corner == LegendCorner::top_left || corner == LegendCorner::bottom_left;
  const bool top = corner == LegendCorner::top_left || corner == LegendCorner::top_right;
  chart->SetShowLegend(true);
  vtkChartLegend* legend = chart->GetLegend();
  legend->SetInline(true);
  legend->SetHorizontalAlignment(left ? vtkChartLegend::LEFT : vtkChartLegend::RIGHT);
  legend->SetVerticalAlignment(top ? vtkChartLegend::TOP : vtkChartLegend::BOTTOM);
  legend->SetLabelSize(17);
  legend->SetPadding(8);
  legend->SetSymbolWidth(40);
  legend->GetPen()->SetColor(150, 150, 150, 255);
}

vtkNew<vtkChartXY> build(const Chart& chart, const ChartSize& size) {
  const auto [x_low, x_high] = x_range(chart);
  const auto [y_low, y_high] = y_range(chart);
  const PixelAxis x_axis = {x_low, x_high, margins.left,
                            static_cast<double>(size.width_px - margins.right)};
  const PixelAxis y_axis = {y_low, y_high, margins.below,
                            static_cast<double>(size.height_px - margins.above)};
  vtkNew<vtkChartXY> built;
  built->SetAutoSize(false);
  built->SetLayoutStrategy(vtkChart::AXES_TO_RECT);
  built->SetSize(vtkRectf(static_cast<float>(x_axis.from_px), static_cast<float>(y_axis.from_px),
                          static_cast<float>(x_axis.to_px - x_axis.from_px),
                          static_cast<float>(y_axis.to_px - y_axis.from_px)));
  // The second line lifts the title off the frame.
  if (!chart.title.empty()) built->SetTitle(shown(chart.title) + "\n ");
  built->GetTitleProperties()->SetFontSize(23);
  set_axis(built->GetAxis(vtkAxis::BOTTOM), chart.x_axis.title, x_axis);
  set_axis(built->GetAxis(vtkAxis::LEFT), chart.y_axis.title, y_axis);
  std::size_t next_color = 0;
  const auto color_of = [&](const std::optional<Color>& wanted) {
    return wanted ? *wanted : palette[next_color++ % palette.size()];
  };
  for (const ChartHistogram& histogram : chart.histograms) {
    const Color color = color_of(histogram.color);
    if (!histogram.heights.empty()) add_histogram(built, histogram, color, x_axis, y_axis);
  }
  for (const ChartCurve& curve : chart.curves) {
    const Color color = color_of(curve.color);
    if (!curve.x.empty())
      add_line(built, x_axis.pixels(curve.x), y_axis.pixels(curve.y), curve, color);
  }
  const auto has_name = [](const auto& drawn) { return !drawn.name.empty(); };
  set_legend(built, chart.legend,
             std::any_of(chart.curves.begin(), chart.curves.end(), has_name) ||
                 std::any_of(chart.histograms.begin(), chart.histograms.end(), has_name));
  return built;
}

class ChartView {
 public:
  ChartView(const Chart& chart, const ChartSize& size) {
    chart.check();
    if (size.width_px < 200 || size.height_px < 200 || size.width_px > 16384 ||
        size.height_px > 16384)
      throw Error("cannot be drawn", {.field = "chart size",
                                      .value = size_text(size.width_px, size.height_px) + " pixels",
                                      .bound = "from 200 to 16384 each"});
    window_->SetOffScreenRendering(1);
    window_->SetMultiSamples(8);
    window_->SetSize(size.width_px, size.height_px);
    renderer_->SetBackground(1.0, 1.0, 1.0);
    window_->AddRenderer(renderer_);
    vtkNew<vtkContextActor> actor;
    actor->GetScene()->SetRenderer(renderer_);
    actor->GetScene()->AddItem(build(chart, size));
    renderer_->AddActor(actor);
  }

  vtkRenderWindow* render() {
    window_->Render();
    return window_;
  }

 private:
  vtkNew<vtkRenderer> renderer_;
  vtkNew<vtkRenderWindow> window_;
};

// What the picture says, for those who search or cannot see it.
std::string description(const Chart& chart) {
  std::string text = chart.y_axis.title + " over " + chart.x_axis.title;
  for (const ChartHistogram& histogram : chart.histograms)
    if (!histogram.name.empty()) text += "; " + histogram.name;
  for (const ChartCurve& curve : chart.curves)
    if (!curve.name.empty()) text += "; " + curve.name;
  return text;
}

// VTK writes its numbers into SVG files through streams of the global locale.
class PlainLocale {
 public:
  PlainLocale() : before_(std::locale::global(std::locale::classic())) {}
  ~PlainLocale() { std::locale::global(before_); }
  PlainLocale(const PlainLocale&) = delete;
  PlainLocale& operator=(const PlainLocale&) = delete;

 private:
  std::locale before_;
};

// A file in memory: VTK does not say when the disk is full.
class MemoryFile {
 public:
  MemoryFile() : descriptor_(memfd_create("graspmap", MFD_CLOEXEC)) {
    if (descriptor_ < 0)
      throw Error(std::string("no file in memory: ") + std::strerror(errno), {}, ErrorKind::failed);
  }
  ~MemoryFile() { close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  std::string path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

 private:
  int descriptor_;
};

std::string exported_svg(const Chart& chart, vtkRenderWindow* window) {
  const PlainLocale plain;
  const MemoryFile file;
  vtkNew<vtkSVGExporter> exporter;
  exporter->SetRenderWindow(window);
  exporter->SetTitle(chart.title.c_str());
  exporter->SetDescription(description(chart).c_str());
  // VTK's own text elements come out displaced, in points for pixels, and turned the wrong way.
  exporter->SetTextAsPath(true);
  exporter->SetFileName(file.path().c_str());
  exporter->Write();
  return read_whole_file(file.path());
}

// VTK 9.1 defines the frame that clips the curves only where it defines markers as well.
std::string with_clipping_frame(std::string svg, const ChartSize& size) {
  const std::string name = "vtkClipRect1";
  const std::size_t head = svg.find("</desc>");
  if (head == std::string::npos || svg.find("url(#" + name + ")") == std::string::npos ||
      svg.find("<clipPath id=\"" + name + "\"") != std::string::npos)
    return svg;
  const std::string frame =
      "\n  <defs>\n    <clipPath id=\"" + name + "\">\n      <rect x=\"" +
      std::to_string(margins.left) + "\" y=\"" + std::to_string(margins.above) + "\" width=\"" +
      std::to_string(size.width_px - margins.left - margins.right) + "\" height=\"" +
      std::to_string(size.height_px - margins.above - margins.below) +
      "\"/>\n    </clipPath>\n  </defs>";
  return svg.insert(head + std::string("</desc>").size(), frame);
}

}  // namespace

void Chart::check() const {
  check_axis(x_axis, "x axis range");
  check_axis(y_axis, "y axis range");
  for (const ChartCurve& curve : curves) {
    const std::string field = "curve '" + curve.name + "'";
    if (curve.x.size() != curve.y.size())
      throw Error("x and y differ in length", {.field = field,
                                               .value = std::to_string(curve.x.size()) + " and " +
                                                        std::to_string(curve.y.size())});
    check_numbers(curve.x, field + ", x");
    check_numbers(curve.y, field + ", y");
  }
  for (const ChartHistogram& histogram : histograms) {
    const std::string field = "histogram '" + histogram.name + "'";
    check_numbers(histogram.heights, field + ", heights");
    check_numbers({histogram.first_edge, histogram.bin_width}, field + ", edges");
    if (!(histogram.bin_width > 0.0))
      throw Error(
          "cannot be drawn",
          {.field = field + ", bin width", .value = to_text(histogram.bin_width), .bound = "> 0"});
  }
}

ColorImage draw_chart(const Chart& chart, const ChartSize& size) {
  return pixels_of(*ChartView(chart, size).render(), size.width_px, size.height_px);
}

void write_chart_svg(const std::filesystem::path& path, const Chart& chart, const ChartSize& size) {
  ChartView view(chart, size);
  write_text(path, with_clipping_frame(exported_svg(chart, view.render()), size));
}

Chart roc_chart(const std::vector<RocCurve>& curves, const std::string& title) {
  Chart chart;
  chart.title = title;
  chart.x_axis = {"false positive rate", std::pair(0.0, 1.0)};
  chart.y_axis = {"true positive rate", std::pair(0.0, 1.0)};
  chart.legend = LegendCorner::bottom_right;
  ChartCurve diagonal;
  diagonal.name = "chance";
  diagonal.x = diagonal.y = {0.0, 1.0};
  diagonal.color = diagonal_color;
  diagonal.width_px = 1.5;
  diagonal.dashed = true;
  chart.curves.push_back(std::move(diagonal));
  for (const RocCurve& curve : curves) {
    ChartCurve drawn;
    drawn.name = curve.name;
    if (curve.area) drawn.name += ", AUC " + to_fixed_text(*curve.area, 3) + " (trapezoid)";
    drawn.x = curve.false_positive_rates;
    drawn.y = curve.true_positive_rates;
    drawn.markers = curve.false_positive_rates.size() <= 50;
    chart.curves.push_back(std::move(drawn));
  }
  return chart;
}

std::vector<double> round_ticks(double low, double high, int most) {
  std::vector<double> ticks;
  if (!(low < high) || !std::isfinite(high - low) || most < 1) return ticks;
  const double min_step = (high - low) / most;
  const double power = std::floor(std::log10(min_step));
  // The tick is a whole number times 10^exponent, divided or multiplied once, so that its text is
  // short.
  const auto scaled = [&](double whole) {
    return power < 0 ? whole / std::pow(10.0, -power) : whole * std::pow(10.0, power);
  };
  double multiple = 1;
  for (const double candidate : {1.0, 2.0, 5.0, 10.0}) {
    multiple = candidate;
    if (scaled(candidate) >= min_step * (1 - 1e-9)) break;
  }
  const double step = scaled(multiple);
  // Numbers this close together have no short texts, and may not even differ by a step.
  // Nor have steps so small that their power of ten is not finite.
  if (!(step > 0.0) || step < 1e-12 * std::max(std::abs(low), std::abs(high))) return ticks;
  const double slack = 1e-9;
  const double first = std::ceil(low / step - slack);
  const int count = static_cast<int>(std::floor(high / step + slack) - first) + 1;
  for (int i = 0; i < count; ++i) ticks.push_back(scaled((first + i) * multiple) + 0.0);
  return ticks;
}

}  // namespace libmap
