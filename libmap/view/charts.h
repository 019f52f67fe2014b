// Draws charts of curves and histograms as images and as SVG. No display is required.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/image.h"

namespace libmap {

struct ChartCurve {
  std::string name{};  // legend entry; empty: none
  std::vector<double> x{};
  std::vector<double> y{};
  std::optional<Color> color{};  // default: the next color of a palette for color-blind readers
                                 // (Okabe and Ito 2008)
  double width_px = 2.5;
  bool dashed = false;
  bool markers = false;  // a dot at each point
};

// Adjacent bars; bar i covers [first_edge + i * bin_width, first_edge + (i + 1) * bin_width].
struct ChartHistogram {
  std::string name;  // legend entry; empty: none
  double first_edge = 0.0;
  double bin_width = 1.0;       // > 0
  std::vector<double> heights;  // from y = 0
  std::optional<Color> color;   // default as in ChartCurve
};

struct ChartAxis {
  std::string title;                               // with unit
  std::optional<std::pair<double, double>> range;  // nullopt: round numbers around the data
};

// Position of the legend in the chart.
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

// Returns low and high end of an axis: ChartAxis::range, or round numbers around data and `values`.
std::pair<double, double> x_range(const Chart& chart, std::vector<double> values = {});
std::pair<double, double> y_range(const Chart& chart, std::vector<double> values = {});

struct ChartSize {
  int width_px = 900;
  int height_px = 700;
};

// Draws the chart as an image. Throws Error as Chart::check, and for a side not in 200 to 16384 px.
ColorImage draw_chart(const Chart& chart, const ChartSize& size = {});

// Draws the chart as SVG. Text is stored as outlines, so that it looks the same in all viewers.
// <title> and <desc> contain the titles and names. Throws Error as draw_chart does.
std::string chart_svg(const Chart& chart, const ChartSize& size = {});

// Chart of receiver operating characteristics with the false positive rate on x. Both axes range
// from 0 to 1; the diagonal is the curve of a random score. Curves of up to 50 points have markers.
Chart roc_chart(std::vector<ChartCurve> curves, const std::string& title);
// Size for a square ROC chart.
inline constexpr ChartSize roc_chart_size{900, 900};

// Returns round numbers within [low, high], at most `max_ticks` + 1, with a step of 1, 2 or 5 times
// a power of ten. Empty if low >= high.
std::vector<double> round_ticks(double low, double high, int max_ticks);

// Formats ticks, all with the same number of decimals.
std::vector<std::string> tick_texts(const std::vector<double>& ticks);

}  // namespace libmap
