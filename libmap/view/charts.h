// Charts of curves and histograms, as an image and as SVG. No display is needed.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/image.h"

namespace libmap {

struct ChartCurve {
  std::string name{};  // in the legend; empty: not in it
  std::vector<double> x{};
  std::vector<double> y{};
  std::optional<Color> color{};  // default: the next of a palette that color-blind people can tell
                                 // apart (Okabe and Ito 2008)
  double width_px = 2.5;
  bool dashed = false;
  bool markers = false;  // a dot at each point
};

// Bars side by side: bar i from first_edge + i * bin_width to the next.
struct ChartHistogram {
  std::string name;
  double first_edge = 0.0;
  double bin_width = 1.0;  // > 0
  std::vector<double> heights;
  std::optional<Color> color;
};

struct ChartAxis {
  std::string title;                               // with its unit
  std::optional<std::pair<double, double>> range;  // default: round numbers around the data
};

// Where the legend stands in the chart.
enum class LegendCorner { none, top_left, top_right, bottom_left, bottom_right };

struct Chart {
  std::string title;
  ChartAxis x_axis;
  ChartAxis y_axis;
  std::vector<ChartCurve> curves;
  std::vector<ChartHistogram> histograms;  // behind the curves
  LegendCorner legend = LegendCorner::top_right;

  // Throws Error naming the first field that cannot be drawn: arrays that differ in length, numbers
  // that are not finite, an empty range.
  void check() const;
};

// What an axis shows, low and high: its range, or round numbers around the data and `values`.
std::pair<double, double> x_range(const Chart& chart, std::vector<double> values = {});
std::pair<double, double> y_range(const Chart& chart, std::vector<double> values = {});

struct ChartSize {
  int width_px = 900;
  int height_px = 700;
};

// The chart as a picture. Throws Error as Chart::check does.
ColorImage draw_chart(const Chart& chart, const ChartSize& size = {});

// The same drawing as SVG. Letters are outlines, so that all viewers show them alike; <title> and
// <desc> contain the names.
std::string chart_svg(const Chart& chart, const ChartSize& size = {});

// Receiver operating characteristics, false positive rates on x, in one chart: 0 to 1 on both axes,
// with the diagonal of a score without information. Curves of at most 50 points have markers.
Chart roc_chart(std::vector<ChartCurve> curves, const std::string& title);
// The size at which a ROC chart is square.
inline constexpr ChartSize roc_chart_size{900, 900};

// At most `most` + 1 round numbers (1, 2 or 5 times a power of ten apart) within low..high.
std::vector<double> round_ticks(double low, double high, int most);

// Round numbers in a row as texts with the same number of decimals.
std::vector<std::string> tick_texts(const std::vector<double>& ticks);

}  // namespace libmap
