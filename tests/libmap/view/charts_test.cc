#include "libmap/view/charts.h"

#include <gmock/gmock.h>
#include <vtkSmartPointer.h>
#include <vtkXMLDataElement.h>
#include <vtkXMLUtilities.h>

#include <charconv>
#include <cmath>
#include <limits>
#include <locale>
#include <memory>

#include "libmap/core/text.h"
#include "libmap/view/virtual_display.h"
#include "tests/support/test_support.h"

namespace charts_test {

using graspmap_test::error_of;
using libmap::Chart;
using libmap::ChartCurve;
using libmap::ChartHistogram;
using libmap::ChartSize;
using libmap::Color;
using libmap::ColorImage;
using testing::HasSubstr;

constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();
constexpr Color red = {220, 0, 0}, green = {0, 160, 0}, blue = {0, 0, 220};

class Charts : public testing::Test {
 protected:
  static void SetUpTestSuite() { display = std::make_unique<libmap::VirtualDisplay>(); }
  static void TearDownTestSuite() { display.reset(); }
  static std::unique_ptr<libmap::VirtualDisplay> display;
};
std::unique_ptr<libmap::VirtualDisplay> Charts::display;

ChartCurve curve_of(std::vector<double> x, std::vector<double> y, const Color& color) {
  ChartCurve curve;
  curve.x = std::move(x);
  curve.y = std::move(y);
  curve.color = color;
  curve.width_px = 3;
  return curve;
}

struct Box {
  int left = 1 << 20, top = 1 << 20, right = -1, bottom = -1;
  int count = 0;
  double middle_row() const { return 0.5 * (top + bottom); }
};

// Where that very color is.
Box find_color(const ColorImage& image, const Color& color) {
  Box box;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (image.at(x, y) != color) continue;
      box.left = std::min(box.left, x);
      box.right = std::max(box.right, x);
      box.top = std::min(box.top, y);
      box.bottom = std::max(box.bottom, y);
      ++box.count;
    }
  }
  return box;
}

Chart unit_chart() {
  Chart chart;
  chart.x_axis = {"x", std::pair(0.0, 1.0)};
  chart.y_axis = {"y", std::pair(0.0, 1.0)};
  chart.legend = libmap::LegendCorner::none;
  return chart;
}

using Element = vtkXMLDataElement;

// All elements of that name, or of any name.
void collect(Element* element, const std::string& name, std::vector<Element*>& found) {
  if (name.empty() || name == element->GetName()) found.push_back(element);
  for (int i = 0; i < element->GetNumberOfNestedElements(); ++i)
    collect(element->GetNestedElement(i), name, found);
}

struct Svg {
  vtkSmartPointer<Element> root;
  std::string text;

  std::vector<Element*> all(const std::string& name) const {
    std::vector<Element*> found;
    collect(root, name, found);
    return found;
  }
};

// Parsed as XML: a file that is not well-formed fails.
Svg svg_of(const Chart& chart, const ChartSize& size = {}) {
  const auto path = graspmap_test::scratch_folder() / "chart.svg";
  libmap::write_chart_svg(path, chart, size);
  Svg svg;
  svg.root =
      vtkSmartPointer<Element>::Take(vtkXMLUtilities::ReadElementFromFile(path.string().c_str()));
  svg.text = graspmap_test::read_text(path);
  EXPECT_NE(svg.root, nullptr) << svg.text;
  return svg;
}

struct PointPx {
  double x, y;
};

std::vector<PointPx> numbers_in(const std::string& text) {
  std::vector<double> numbers;
  const char* next = text.data();
  const char* const end = text.data() + text.size();
  while (next < end) {
    double value = 0;
    const auto read = std::from_chars(next, end, value);
    if (read.ec == std::errc()) {
      numbers.push_back(value);
      next = read.ptr;
    } else {
      ++next;
    }
  }
  std::vector<PointPx> points;
  for (std::size_t i = 0; i + 1 < numbers.size(); i += 2)
    points.push_back({numbers[i], numbers[i + 1]});
  return points;
}

// The points of the one polyline of that color ("#rrggbb").
std::vector<PointPx> polyline(const Svg& svg, const std::string& color) {
  std::vector<PointPx> points;
  for (Element* line : svg.all("polyline")) {
    if (line->GetAttribute("stroke") != color) continue;
    EXPECT_TRUE(points.empty());
    points = numbers_in(line->GetAttribute("points"));
  }
  return points;
}

TEST_F(Charts, LinesLieWhereTheirNumbersSay) {
  Chart chart = unit_chart();
  chart.curves = {curve_of({0.2, 0.6}, {0.25, 0.25}, red), curve_of({0.2, 0.6}, {0.5, 0.5}, green),
                  curve_of({0.4, 0.8}, {0.75, 0.75}, blue)};
  const ColorImage image = libmap::draw_chart(chart, {800, 600});
  ASSERT_EQ(image.width, 800);
  ASSERT_EQ(image.height, 600);
  EXPECT_EQ(image.at(0, 0), (Color{255, 255, 255}));
  const Box low = find_color(image, red), middle = find_color(image, green),
            high = find_color(image, blue);
  ASSERT_GT(low.count, 200);
  ASSERT_GT(high.count, 200);
  EXPECT_LT(high.middle_row(), middle.middle_row());  // up is up
  EXPECT_NEAR(low.middle_row() - middle.middle_row(), middle.middle_row() - high.middle_row(), 1.5);
  const double width = low.right - low.left;  // of 0.4 on the x axis
  EXPECT_NEAR(high.left - low.left, width / 2, 2);
  EXPECT_NEAR(high.right - low.right, width / 2, 2);
}

TEST_F(Charts, EqualChartsGiveEqualPicturesAndFiles) {
  Chart chart = unit_chart();
  chart.title = "duplicate";
  chart.curves = {curve_of({0, 0.3, 1}, {0, 0.8, 1}, red)};
  EXPECT_TRUE(libmap::draw_chart(chart) == libmap::draw_chart(chart));
  EXPECT_TRUE(svg_of(chart).text == svg_of(chart).text);
}

TEST_F(Charts, SvgIsWellFormedAndCarriesItsNames) {
  Chart chart = libmap::roc_chart({{"before & <after>", {1, 0.25, 0}, {1, 0.5, 0}, 0.6449}},
                                  "Rocks \"A\" & <B>");
  const Svg svg = svg_of(chart, libmap::roc_chart_size);
  EXPECT_STREQ(svg.root->GetName(), "svg");
  EXPECT_STREQ(svg.root->GetAttribute("width"), "900");
  EXPECT_THAT(svg.all("title").at(0)->GetCharacterData(), HasSubstr("Rocks \"A\" & <B>"));
  EXPECT_THAT(svg.all("desc").at(0)->GetCharacterData(),
              testing::AllOf(HasSubstr("true positive rate over false positive rate"),
                             HasSubstr("before & <after>, AUC 0.645 (trapezoid)")));
  // Letters are outlines: those of 11 + 11 ticks, two axis titles, the title, and two legend names.
  EXPECT_GE(svg.all("path").size(), 27u);
}

TEST_F(Charts, SvgCurvesLieInsideTheirClippingFrameUntransformed) {
  for (const bool markers : {false, true}) {
    Chart chart = unit_chart();
    chart.title = "frame";
    chart.curves = {curve_of({0, 0.25, 1}, {0, 0.5, 1}, red)};
    chart.curves[0].markers = markers;
    const Svg svg = svg_of(chart, {800, 600});
    for (Element* group : svg.all("g")) {
      // A viewer applies `transform` to the clipping frame too: the two must not meet in one
      // element.
      if (group->GetAttribute("clip-path") == nullptr) continue;
      const char* transform = group->GetAttribute("transform");
      EXPECT_TRUE(transform == nullptr || std::string(transform) == "matrix(1,0,0,1,0,0)")
          << transform;
    }
    const std::vector<PointPx> points = polyline(svg, "#dc0000");
    ASSERT_EQ(points.size(), 3u);
    EXPECT_NEAR(points[1].x - points[0].x, 0.25 * (points[2].x - points[0].x), 0.01);
    EXPECT_NEAR(points[1].y - points[0].y, 0.5 * (points[2].y - points[0].y), 0.01);
    const auto clips = svg.all("clipPath");
    ASSERT_FALSE(clips.empty());
    for (Element* clip : clips) {
      Element* frame = clip->FindNestedElementWithName("rect");
      double x = 0, y = 0, width = 0, height = 0;
      ASSERT_TRUE(frame->GetScalarAttribute("x", x) && frame->GetScalarAttribute("y", y) &&
                  frame->GetScalarAttribute("width", width) &&
                  frame->GetScalarAttribute("height", height));
      EXPECT_NEAR(points[0].x, x, 1);
      EXPECT_NEAR(points[0].y, y + height, 1);
      EXPECT_NEAR(points[2].x, x + width, 1);
      EXPECT_NEAR(points[2].y, y, 1);
    }
  }
}

TEST_F(Charts, EveryReferenceInTheSvgIsDefined) {
  std::size_t references = 0;
  for (const Chart& chart : {unit_chart(), libmap::roc_chart({{"a", {1, 0}, {1, 0}, {}}}, "a"),
                             libmap::roc_chart({}, "")}) {
    const Svg svg = svg_of(chart);
    std::size_t at = 0;
    while ((at = svg.text.find("url(#", at)) != std::string::npos) {
      at += 5;
      const std::string id = svg.text.substr(at, svg.text.find(')', at) - at);
      EXPECT_THAT(svg.text, HasSubstr("id=\"" + id + "\""));
      ++references;
    }
  }
  EXPECT_GT(references, 0u);
}

TEST_F(Charts, SmallAndLargeNumbersKeepTheirShape) {
  for (const double scale : {1e-12, 1e-3, 1.0, 1e6, 1e15}) {
    for (const double offset : {0.0, 1000.0, -1000.0}) {
      Chart chart;
      chart.legend = libmap::LegendCorner::none;
      chart.curves = {curve_of({offset * scale, (offset + 1) * scale, (offset + 2) * scale},
                               {offset * scale, (offset + 0.5) * scale, (offset + 2) * scale},
                               red)};
      const std::vector<PointPx> points = polyline(svg_of(chart), "#dc0000");
      ASSERT_EQ(points.size(), 3u) << scale;
      EXPECT_NEAR(points[1].x - points[0].x, 0.5 * (points[2].x - points[0].x), 0.05) << scale;
      EXPECT_NEAR(points[1].y - points[0].y, 0.25 * (points[2].y - points[0].y), 0.05) << scale;
      EXPECT_GT(points[2].x - points[0].x, 300) << scale;
    }
  }
}

TEST_F(Charts, NumbersDoNotDependOnTheLocale) {
  struct Comma : std::numpunct<char> {
    char do_decimal_point() const override { return ','; }
    char do_thousands_sep() const override { return '.'; }
    std::string do_grouping() const override { return "\3"; }
  };
  Chart chart = libmap::roc_chart({{"map", {1, 0.25, 0}, {1, 0.5, 0}, 0.625}}, "locale");
  ChartHistogram histogram;
  histogram.heights = {1234.5, 12345.25};
  Chart large;
  large.histograms = {histogram};
  const std::string plain = svg_of(chart).text + svg_of(large, {1500, 1500}).text;
  const ColorImage image = libmap::draw_chart(chart);
  const std::locale before = std::locale::global(std::locale(std::locale(), new Comma));
  const std::string comma = svg_of(chart).text + svg_of(large, {1500, 1500}).text;
  const ColorImage comma_image = libmap::draw_chart(chart);
  std::locale::global(before);
  EXPECT_TRUE(comma == plain);
  EXPECT_TRUE(comma_image == image);
}

TEST_F(Charts, HistogramBarsStandOnZeroAndTouch) {
  Chart chart;
  chart.y_axis.range = {-2.0, 4.0};
  chart.legend = libmap::LegendCorner::none;
  ChartHistogram histogram;
  histogram.first_edge = 1.0;
  histogram.bin_width = 0.5;
  histogram.heights = {3.0, -1.5, 0.0, 2.0};
  histogram.color = blue;
  chart.histograms = {histogram};
  const std::vector<PointPx> outline = polyline(svg_of(chart), "#0000dc");
  ASSERT_EQ(outline.size(), 16u);
  const double zero = outline[0].y;
  const double unit = (zero - outline[1].y) / 3.0;
  EXPECT_GT(unit, 0);
  for (std::size_t bar = 0; bar < 4; ++bar) {
    EXPECT_NEAR(outline[4 * bar].y, zero, 0.01);
    EXPECT_NEAR(outline[4 * bar + 1].y, zero - unit * histogram.heights[bar], 0.01);
    EXPECT_NEAR(outline[4 * bar + 3].x - outline[4 * bar].x, outline[2].x - outline[1].x, 0.01);
    if (bar > 0) {
      EXPECT_NEAR(outline[4 * bar].x, outline[4 * bar - 1].x, 0.01);
    }
  }
  // Filled: the pale blue between the outlines.
  const ColorImage image = libmap::draw_chart(chart);
  const Color inside =
      image.at(static_cast<int>(outline[1].x) + 20, static_cast<int>(zero - unit * 1.5) + 7);
  EXPECT_LT(inside[0], 200);
  EXPECT_GT(inside[2], 220);
}

TEST_F(Charts, TheLegendNamesCurvesInTheirColors) {
  Chart chart = unit_chart();
  ChartCurve curve = curve_of({0.1, 0.2}, {0.1, 0.1}, red);
  chart.curves = {curve};
  const int unnamed = find_color(libmap::draw_chart(chart), red).count;
  chart.curves[0].name = "one";
  for (const auto corner : {libmap::LegendCorner::top_left, libmap::LegendCorner::top_right,
                            libmap::LegendCorner::bottom_right}) {
    chart.legend = corner;
    EXPECT_GT(find_color(libmap::draw_chart(chart), red).count, unnamed + 20);
  }
  chart.legend = libmap::LegendCorner::none;
  EXPECT_EQ(find_color(libmap::draw_chart(chart), red).count, unnamed);
}

TEST_F(Charts, NothingOrHardlyAnythingToDraw) {
  EXPECT_EQ(libmap::draw_chart({}).width, ChartSize().width_px);
  Chart chart = unit_chart();
  chart.curves = {curve_of({}, {}, red), curve_of({0.5}, {0.5}, green)};
  chart.histograms.emplace_back();
  EXPECT_EQ(find_color(libmap::draw_chart(chart), red).count, 0);
  chart.curves[1].markers = true;
  EXPECT_GT(find_color(libmap::draw_chart(chart), green).count, 20);
  Chart constant;
  constant.curves = {curve_of({3, 3, 3}, {7, 7, 7}, red), curve_of({0, 0}, {0, 0}, red)};
  libmap::draw_chart(constant);
  const Svg empty = svg_of(libmap::roc_chart({}, ""));
  EXPECT_FALSE(empty.all("polyline").empty());
}

TEST_F(Charts, WhatCannotBeDrawnIsNamed) {
  const auto error_with = [](auto change, ChartSize size = {}) {
    Chart chart = unit_chart();
    chart.curves = {curve_of({0, 1}, {0, 1}, red)};
    chart.curves[0].name = "map";
    change(chart);
    const auto path = graspmap_test::scratch_folder() / "wrong.svg";
    const libmap::Error error = error_of([&] { libmap::write_chart_svg(path, chart, size); });
    EXPECT_FALSE(std::filesystem::exists(path));
    error_of([&] { libmap::draw_chart(chart, size); });
    return error.context();
  };
  EXPECT_EQ(error_with([](Chart& c) { c.curves[0].x.pop_back(); }).value, "1 and 2");
  EXPECT_EQ(error_with([](Chart& c) { c.curves[0].y[1] = nan_value; }).field, "curve 'map', y");
  EXPECT_EQ(error_with([](Chart& c) { c.x_axis.range = {1.0, 1.0}; }).field, "x axis range");
  EXPECT_EQ(error_with([](Chart& c) {
              c.y_axis.range = {-1.7e308, 1.7e308};
            }).field,
            "y axis range");
  EXPECT_EQ(error_with([](Chart& c) { c.y_axis.range = {0.0, nan_value}; }).field, "y axis range");
  EXPECT_EQ(error_with([](Chart& c) {
              c.histograms.emplace_back();
              c.histograms[0].bin_width = 0.0;
            }).bound,
            "> 0");
  EXPECT_EQ(error_with([](Chart&) {}, {10, 600}).field, "chart size");
  EXPECT_EQ(error_with([](Chart&) {}, {600, 100000}).field, "chart size");
  EXPECT_THAT(error_of([] {
                libmap::write_chart_svg(graspmap_test::scratch_folder() / "none" / "a.svg",
                                        unit_chart());
              }).what(),
              HasSubstr("none"));
}

TEST(RoundTicks, AreRoundAndInside) {
  using testing::ElementsAre;
  EXPECT_THAT(libmap::round_ticks(0, 1, 10),
              ElementsAre(0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1));
  EXPECT_THAT(libmap::round_ticks(-1, 1, 4), ElementsAre(-1, -0.5, 0, 0.5, 1));
  EXPECT_THAT(libmap::round_ticks(3, 47, 5), ElementsAre(10, 20, 30, 40));
  EXPECT_THAT(libmap::round_ticks(1, 1, 5), ElementsAre());
  EXPECT_THAT(libmap::round_ticks(0, std::numeric_limits<double>::infinity(), 5), ElementsAre());
  EXPECT_THAT(libmap::round_ticks(1, std::nextafter(1.0, 2.0), 5), ElementsAre());
  EXPECT_THAT(libmap::round_ticks(nan_value, 1, 5), ElementsAre());
  EXPECT_THAT(libmap::round_ticks(5e-324, 3e-320, 10), ElementsAre());
}

TEST_F(Charts, NamesOfAnyLengthTakeAChartsRoom) {
  Chart chart = unit_chart();
  chart.legend = libmap::LegendCorner::top_left;
  std::string name;
  while (name.size() < 5000) name += "\xC3\xA4";
  chart.title = chart.x_axis.title = chart.y_axis.title = name;
  libmap::ChartCurve& curve = chart.curves.emplace_back();
  curve.name = name;
  curve.x = curve.y = {0, 1};
  EXPECT_LT(svg_of(chart).text.size(), 2'000'000U);
}

TEST(RoundTicks, ManyRandomRanges) {
  for (int round = 0; round < 2000; ++round) {
    const double low = graspmap_test::uniform(-1, 1) * std::pow(10, graspmap_test::uniform(-9, 9));
    const double high = low + std::pow(10, graspmap_test::uniform(-6, 9)) * (1 + std::abs(low));
    const int most = 3 + round % 10;
    const std::vector<double> ticks = libmap::round_ticks(low, high, most);
    ASSERT_GE(ticks.size(), 1u) << low << " " << high;
    ASSERT_LE(ticks.size(), static_cast<std::size_t>(most) + 1);
    const double slack = 1e-8 * (high - low);
    for (std::size_t i = 0; i < ticks.size(); ++i) {
      EXPECT_GE(ticks[i], low - slack);
      EXPECT_LE(ticks[i], high + slack);
      EXPECT_LE(libmap::to_text(ticks[i]).size(), 18u) << ticks[i];
    }
    // No room for one more at either end.
    const double step = ticks.size() > 1 ? ticks[1] - ticks[0] : (high - low);
    EXPECT_GT(ticks.front() - step, low - step * 1.0001);
    EXPECT_LT(ticks.front() - step, low + slack);
    EXPECT_GT(ticks.back() + step, high - slack);
  }
}

}  // namespace charts_test
