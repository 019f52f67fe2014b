#include "tools/support/calibration_charts.h"

#include <algorithm>
#include <cmath>

#include "libmap/core/text.h"
#include "libmap/view/charts.h"
#include "libmap/view/virtual_display.h"

namespace graspmap_tools {

namespace {

using libmap::Chart;
using libmap::ChartCurve;

constexpr libmap::Color corner_color = {150, 150, 150};
constexpr libmap::Color residual_color = {213, 94, 0};
constexpr libmap::Color bound_color = {90, 90, 90};
constexpr int chart_width_px = 1000;

std::string draw(const Chart& chart, int height_px) {
  const libmap::VirtualDisplay display;
  return libmap::to_png(libmap::draw_chart(chart, {chart_width_px, height_px}));
}

// The largest of 1, 2, 5, 10, ... that shows the mean residual no longer than 1/40 of the width.
double magnification(const libmap::CameraCalibrationResult& result) {
  double sum = 0.0;
  std::size_t count = 0;
  for (const libmap::CalibratedPicture& picture : result.pictures)
    for (const Eigen::Vector2d& residual : picture.residuals_px) {
      sum += residual.norm();
      ++count;
    }
  if (!(sum > 0)) return 1.0;
  const double wanted = result.camera.width / 40.0 / (sum / static_cast<double>(count));
  const double power = std::pow(10.0, std::floor(std::log10(std::clamp(wanted, 1.0, 1e6))));
  double scale = power;
  for (const double multiple : {2.0, 5.0})
    if (multiple * power <= wanted) scale = multiple * power;
  return scale;
}

}  // namespace

std::string draw_residuals(const libmap::CameraCalibrationResult& result) {
  const int width = result.camera.width;
  const int height = result.camera.height;
  const double scale = magnification(result);
  Chart chart;
  chart.title = "Found minus projected corners, " + libmap::to_text(scale) + " times";
  chart.x_axis = {"column [px]", std::pair(0.0, static_cast<double>(width))};
  chart.y_axis = {"height above the image's lower edge [px]",
                  std::pair(0.0, static_cast<double>(height))};
  // Charts have y upwards, images downwards.
  const auto add = [&](ChartCurve& curve, const Eigen::Vector2d& pixel) {
    curve.x.push_back(pixel.x());
    curve.y.push_back(height - 1 - pixel.y());
  };
  for (const libmap::CalibratedPicture& picture : result.pictures)
    for (std::size_t n = 0; n < picture.corners.size(); ++n) {
      ChartCurve dot;
      dot.color = corner_color;
      dot.markers = true;
      dot.width_px = 1.2;
      add(dot, picture.corners[n]);
      chart.curves.push_back(std::move(dot));
      ChartCurve arrow;
      arrow.color = residual_color;
      arrow.width_px = 1.5;
      add(arrow, picture.corners[n]);
      add(arrow, picture.corners[n] + scale * picture.residuals_px[n]);
      chart.curves.push_back(std::move(arrow));
    }
  const double inner_width = chart_width_px - 150.0;
  const int height_px = static_cast<int>(std::lround(inner_width * height / width)) + 164;
  return draw(chart, std::clamp(height_px, 400, 3000));
}

std::string draw_errors(const libmap::CameraCalibrationResult& result, double bound_px) {
  Chart chart;
  chart.title = "Reprojection error of each picture";
  const auto count = static_cast<double>(result.pictures.size());
  chart.x_axis = {"picture", std::pair(0.5, count + 0.5)};
  libmap::ChartHistogram bars;
  bars.name = "root mean square";
  bars.first_edge = 0.5;
  double largest = bound_px;
  for (const libmap::CalibratedPicture& picture : result.pictures) {
    bars.heights.push_back(picture.rms_px);
    largest = std::max(largest, picture.rms_px);
  }
  chart.y_axis = {"error [px]", std::pair(0.0, 1.2 * largest)};
  chart.histograms.push_back(std::move(bars));
  ChartCurve bound;
  bound.name = libmap::to_text(bound_px) + " px";
  bound.x = {0.5, count + 0.5};
  bound.y = {bound_px, bound_px};
  bound.color = bound_color;
  bound.dashed = true;
  chart.curves.push_back(std::move(bound));
  return draw(chart, 600);
}

}  // namespace graspmap_tools
