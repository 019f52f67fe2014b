#include "libmap/view/charts.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/view/canvas.h"

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
constexpr Color grid_color = {210, 210, 210};
constexpr Color axis_color = {60, 60, 60};
constexpr Color legend_color = {255, 255, 255};
constexpr TextStyle title_style{.size_px = 22, .align = TextAlign::center};
constexpr TextStyle axis_style{.size_px = 18, .align = TextAlign::center};
constexpr TextStyle label_style{.size_px = 15};

// Margins around the frame. The left one increases with the width of the y axis labels.
constexpr double left_px = 105, right_px = 45, above_px = 82, below_px = 82;
constexpr double edge_px = 5.0;  // clipping margin beyond the frame
constexpr int max_axis_ticks = 10;

void check_numbers(const std::vector<double>& values, const std::string& field) {
  for (const double value : values)
    if (!std::isfinite(value))
      throw Error("the chart cannot be drawn",
                  {.field = field, .value = to_text(value), .bound = "a finite number"});
}

void check_axis(const ChartAxis& axis, const std::string& field) {
  if (!axis.range) return;
  const auto [low, high] = *axis.range;
  if (!std::isfinite(high - low) || !(low < high))
    throw Error("the chart cannot be drawn", {.field = field,
                                              .value = to_text(low) + " to " + to_text(high),
                                              .bound = "finite and ascending, of finite width"});
}

// Range of the values, widened to round numbers; 0 to 1 without values.
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
    values.push_back(0.0);  // bars begin at zero
  }
  return range_around(values);
}

namespace {

// Linear map from the numbers low..high to the pixels from..to.
struct PixelAxis {
  double low, high;
  double from_px, to_px;

  double pixel(double value) const {
    return from_px + (value - low) / (high - low) * (to_px - from_px);
  }
};

struct LegendLine {
  std::string name;
  Color color;
  const ChartCurve* curve;  // null: a histogram
};

class ChartDrawing {
 public:
  ChartDrawing(const Chart& chart, const ChartSize& size, Canvas& canvas)
      : chart_(chart), canvas_(canvas) {
    const auto [x_low, x_high] = x_range(chart);
    const auto [y_low, y_high] = y_range(chart);
    const double height = size.height_px - above_px - below_px;
    constexpr double tick_px = 24.0;
    x_ticks_ = round_ticks(x_low, x_high, max_axis_ticks);
    y_ticks_ = round_ticks(y_low, y_high,
                           std::clamp(static_cast<int>(height / tick_px), 1, max_axis_ticks));
    double widest = 0.0;
    for (const std::string& text : tick_texts(y_ticks_))
      widest = std::max(widest, text_size(text, label_style).x());
    const double left = std::max(left_px, std::ceil(widest) + 52.0);
    frame_ = {left, above_px, std::max(1.0, size.width_px - left - right_px), height};
    x_axis_ = {x_low, x_high, frame_.left, frame_.right()};
    y_axis_ = {y_low, y_high, frame_.bottom(), frame_.top};
  }

  void draw() {
    draw_titles();
    draw_ticks();
    canvas_.polyline({{frame_.left, frame_.top},
                      {frame_.left, frame_.bottom()},
                      {frame_.right(), frame_.bottom()}},
                     1.5, axis_color);
    // Lines and markers on the frame are not clipped.
    const PixelRect edge{frame_.left - edge_px, frame_.top - edge_px, frame_.width + 2 * edge_px,
                         frame_.height + 2 * edge_px};
    canvas_.clipped(edge, [&] {
      std::size_t next_color = 0;
      const auto color_of = [&](const std::optional<Color>& wanted) {
        return wanted ? *wanted : palette[next_color++ % palette.size()];
      };
      for (const ChartHistogram& histogram : chart_.histograms) {
        const Color color = color_of(histogram.color);
        draw_histogram(histogram, color);
        add_to_legend({histogram.name, color, nullptr});
      }
      for (const ChartCurve& curve : chart_.curves) {
        const Color color = color_of(curve.color);
        draw_curve(curve, color);
        add_to_legend({curve.name, color, &curve});
      }
    });
    if (chart_.legend != LegendCorner::none && !legend_.empty()) draw_legend();
  }

 private:
  Eigen::Vector2d pixel_of(double x, double y) const {
    return {x_axis_.pixel(x), y_axis_.pixel(y)};
  }

  void draw_titles() {
    const double middle = frame_.left + frame_.width / 2.0;
    const double width = frame_.right() + right_px;
    canvas_.text({width / 2.0, 0.5 * above_px},
                 shortened_text(chart_.title, title_style, width - 20.0), title_style);
    canvas_.text({middle, frame_.bottom() + 56.0},
                 shortened_text(chart_.x_axis.title, axis_style, frame_.width), axis_style);
    TextStyle upward = axis_style;
    upward.upward = true;
    canvas_.text({22.0, frame_.top + frame_.height / 2.0},
                 shortened_text(chart_.y_axis.title, upward, frame_.height), upward);
  }

  // Labels of the x axis that would touch the previous label are omitted.
  void draw_ticks() {
    TextStyle style = label_style;
    style.align = TextAlign::center;
    double taken = 0.0;
    std::vector<std::string> texts = tick_texts(x_ticks_);
    for (std::size_t i = 0; i < texts.size(); ++i) {
      const double x = x_axis_.pixel(x_ticks_[i]);
      canvas_.polyline({{x, frame_.top}, {x, frame_.bottom()}}, 1.0, grid_color);
      canvas_.polyline({{x, frame_.bottom()}, {x, frame_.bottom() + 6.0}}, 1.5, axis_color);
      const double half = text_size(texts[i], style).x() / 2.0;
      if (x - half < taken) continue;
      canvas_.text({x, frame_.bottom() + 21.0}, texts[i], style);
      taken = x + half + 8.0;
    }
    style.align = TextAlign::right;
    texts = tick_texts(y_ticks_);
    for (std::size_t i = 0; i < texts.size(); ++i) {
      const double y = y_axis_.pixel(y_ticks_[i]);
      canvas_.polyline({{frame_.left, y}, {frame_.right(), y}}, 1.0, grid_color);
      canvas_.polyline({{frame_.left - 6.0, y}, {frame_.left, y}}, 1.5, axis_color);
      canvas_.text({frame_.left - 11.0, y}, texts[i], style);
    }
  }

  // Bars begin at zero and have a common outline.
  void draw_histogram(const ChartHistogram& histogram, const Color& color) {
    std::vector<Eigen::Vector2d> outline;
    for (std::size_t i = 0; i < histogram.heights.size(); ++i) {
      const double left = histogram.first_edge + static_cast<double>(i) * histogram.bin_width;
      const double right = left + histogram.bin_width;
      const double height = histogram.heights[i];
      outline.insert(outline.end(), {pixel_of(left, 0.0), pixel_of(left, height),
                                     pixel_of(right, height), pixel_of(right, 0.0)});
    }
    canvas_.polygon(outline, color, bar_opacity);
    canvas_.polyline(outline, 1.0, color);
  }

  void draw_curve(const ChartCurve& curve, const Color& color) {
    std::vector<Eigen::Vector2d> points;
    points.reserve(curve.x.size());
    for (std::size_t i = 0; i < curve.x.size(); ++i)
      points.push_back(pixel_of(curve.x[i], curve.y[i]));
    canvas_.polyline(points, curve.width_px, color, curve.dashed);
    if (curve.markers)
      for (const Eigen::Vector2d& point : points)
        canvas_.disc(point, marker_radius * curve.width_px, color);
  }

  void add_to_legend(LegendLine line) {
    if (!line.name.empty()) legend_.push_back(std::move(line));
  }

  void draw_legend() {
    constexpr double padding = 10.0, symbol = 40.0, row = 24.0, margin = 12.0;
    const double room = frame_.width - 2.0 * margin - 3.0 * padding - symbol;
    double widest = 0.0;
    for (LegendLine& line : legend_) {
      line.name = shortened_text(line.name, label_style, room);
      widest = std::max(widest, text_size(line.name, label_style).x());
    }
    const double width = 3.0 * padding + symbol + widest;
    const double height = padding + row * static_cast<double>(legend_.size());
    const bool at_left =
        chart_.legend == LegendCorner::top_left || chart_.legend == LegendCorner::bottom_left;
    const bool at_top =
        chart_.legend == LegendCorner::top_left || chart_.legend == LegendCorner::top_right;
    const PixelRect box{at_left ? frame_.left + margin : frame_.right() - margin - width,
                        at_top ? frame_.top + margin : frame_.bottom() - margin - height, width,
                        height};
    canvas_.rectangle(box, diagonal_color);
    canvas_.rectangle({box.left + 1.0, box.top + 1.0, box.width - 2.0, box.height - 2.0},
                      legend_color);
    double y = box.top + padding / 2.0 + row / 2.0;
    for (const LegendLine& line : legend_) {
      draw_symbol(line, {box.left + padding, y}, symbol);
      canvas_.text({box.left + 2.0 * padding + symbol, y}, line.name, label_style);
      y += row;
    }
  }

  void draw_symbol(const LegendLine& line, const Eigen::Vector2d& left, double width) {
    const Eigen::Vector2d right = left + Eigen::Vector2d(width, 0.0);
    if (line.curve != nullptr) {
      canvas_.polyline({left, right}, line.curve->width_px, line.color, line.curve->dashed);
      if (line.curve->markers)
        canvas_.disc((left + right) / 2.0, marker_radius * line.curve->width_px, line.color);
      return;
    }
    const Eigen::Vector2d up(0.0, 7.0);
    const std::vector<Eigen::Vector2d> corners{left - up, right - up, right + up, left + up,
                                               left - up};
    canvas_.polygon(corners, line.color, bar_opacity);
    canvas_.polyline(corners, 1.0, line.color);
  }

  static constexpr double bar_opacity = 0.43;
  static constexpr double marker_radius = 1.75;  // in line widths

  const Chart& chart_;
  Canvas& canvas_;
  std::vector<double> x_ticks_;
  std::vector<double> y_ticks_;
  PixelRect frame_;
  PixelAxis x_axis_{};
  PixelAxis y_axis_{};
  std::vector<LegendLine> legend_;
};

void check(const Chart& chart, const ChartSize& size) {
  chart.check();
  if (size.width_px < 200 || size.height_px < 200 || size.width_px > 16384 ||
      size.height_px > 16384)
    throw Error("the chart cannot be drawn",
                {.field = "chart size",
                 .value = size_text(size.width_px, size.height_px) + " pixels",
                 .bound = "from 200 to 16384 each"});
}

// Text alternative of the chart.
std::string description(const Chart& chart) {
  std::string text = chart.y_axis.title + " over " + chart.x_axis.title;
  for (const ChartHistogram& histogram : chart.histograms)
    if (!histogram.name.empty()) text += "; " + histogram.name;
  for (const ChartCurve& curve : chart.curves)
    if (!curve.name.empty()) text += "; " + curve.name;
  return text;
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
          "the chart cannot be drawn",
          {.field = field + ", bin width", .value = to_text(histogram.bin_width), .bound = "> 0"});
  }
}

ColorImage draw_chart(const Chart& chart, const ChartSize& size) {
  check(chart, size);
  Canvas canvas(size.width_px, size.height_px);
  ChartDrawing(chart, size, canvas).draw();
  return canvas.pixels();
}

std::string chart_svg(const Chart& chart, const ChartSize& size) {
  check(chart, size);
  Canvas canvas(size.width_px, size.height_px, CanvasFormat::svg);
  ChartDrawing(chart, size, canvas).draw();
  return canvas.svg(chart.title, description(chart));
}

Chart roc_chart(std::vector<ChartCurve> curves, const std::string& title) {
  Chart chart;
  chart.title = title;
  chart.x_axis = {"false positive rate", std::pair(0.0, 1.0)};
  chart.y_axis = {"true positive rate", std::pair(0.0, 1.0)};
  chart.legend = LegendCorner::bottom_right;
  for (ChartCurve& curve : curves) curve.markers = curve.x.size() <= 50;
  chart.curves = std::move(curves);
  chart.curves.insert(chart.curves.begin(), {.name = "chance",
                                             .x = {0.0, 1.0},
                                             .y = {0.0, 1.0},
                                             .color = diagonal_color,
                                             .width_px = 1.5,
                                             .dashed = true});
  return chart;
}

std::vector<double> round_ticks(double low, double high, int max_ticks) {
  std::vector<double> ticks;
  if (!(low < high) || !std::isfinite(high - low) || max_ticks < 1) return ticks;
  const double min_step = (high - low) / max_ticks;
  const double power = std::floor(std::log10(min_step));
  // Ticks are computed by one division or multiplication of an integer, so that their text is
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
  // Steps this small have no short texts, may vanish in rounding, or have no finite power of ten.
  if (!(step > 0.0) || step < 1e-12 * std::max(std::abs(low), std::abs(high))) return ticks;
  const double slack = 1e-9;
  const double first = std::ceil(low / step - slack);
  const int count = static_cast<int>(std::floor(high / step + slack) - first) + 1;
  for (int i = 0; i < count; ++i) ticks.push_back(scaled((first + i) * multiple) + 0.0);
  return ticks;
}

std::vector<std::string> tick_texts(const std::vector<double>& ticks) {
  std::vector<std::string> texts;
  texts.reserve(ticks.size());
  const double step = ticks.size() > 1 ? std::abs(ticks[1] - ticks[0]) : 1.0;
  const auto is_round = [](double value) { return std::abs(value - std::round(value)) < 1e-6; };
  // float removes rounding errors of sums; double if float would be infinite.
  const auto short_text = [](double value) {
    return std::abs(value) < 1e38 ? to_text(static_cast<float>(value)) : to_text(value);
  };
  int decimals = 0;
  while (decimals < 6 && !is_round(step * std::pow(10.0, decimals))) ++decimals;
  for (const double tick : ticks)
    texts.push_back(step < 1e-6 || std::abs(tick) >= 1e7 ? short_text(tick)
                                                         : to_fixed_text(tick, decimals));
  return texts;
}

}  // namespace libmap
