#include "libmap/view/charts.h"

#include <gmock/gmock.h>
#include <vtkSmartPointer.h>
#include <vtkXMLDataElement.h>
#include <vtkXMLUtilities.h>

#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <locale>
#include <map>

#include "libmap/core/text.h"
#include "libmap/view/canvas.h"
#include "tests/support/test_support.h"

namespace charts_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using libmap::Chart;
using libmap::ChartCurve;
using libmap::ChartHistogram;
using libmap::ChartSize;
using libmap::Color;
using libmap::ColorImage;
using testing::HasSubstr;

constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();
constexpr Color red = {220, 0, 0}, green = {0, 160, 0}, blue = {0, 0, 220};

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

// Bounding box of the pixels of exactly this color.
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

// All elements of a given name, or of any name.
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
  Svg svg;
  svg.text = libmap::chart_svg(chart, size);
  svg.root =
      vtkSmartPointer<Element>::Take(vtkXMLUtilities::ReadElementFromString(svg.text.c_str()));
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

// Paths whose stroke or fill ("stroke:rgb", "fill:rgb") has that color, each with its points.
std::vector<std::vector<PointPx>> paths(const Svg& svg, const std::string& use,
                                        const Color& color) {
  std::vector<std::vector<PointPx>> found;
  for (Element* path : svg.all("path")) {
    const char* style = path->GetAttribute("style");
    const char* at = style == nullptr ? nullptr : std::strstr(style, (use + "(").c_str());
    double parts[3];
    if (at == nullptr ||
        std::sscanf(at + use.size(), "(%lf%%,%lf%%,%lf%%)", parts, parts + 1, parts + 2) != 3)
      continue;
    bool same = true;
    for (std::size_t c = 0; c < 3; ++c) same = same && std::abs(parts[c] * 2.55 - color[c]) < 0.01;
    if (same) found.push_back(numbers_in(path->GetAttribute("d")));
  }
  return found;
}

// The points of the one polyline of that color.
std::vector<PointPx> polyline(const Svg& svg, const Color& color) {
  const auto found = paths(svg, "stroke:rgb", color);
  EXPECT_EQ(found.size(), 1U);
  return found.empty() ? std::vector<PointPx>{} : found.front();
}

libmap::PixelRect box_of(const std::vector<PointPx>& points) {
  PointPx low{1e9, 1e9}, high{-1e9, -1e9};
  for (const PointPx& point : points) {
    low = {std::min(low.x, point.x), std::min(low.y, point.y)};
    high = {std::max(high.x, point.x), std::max(high.y, point.y)};
  }
  return {low.x, low.y, high.x - low.x, high.y - low.y};
}

constexpr Color frame = {60, 60, 60};

// The boxes of all texts: letters are outlines that are defined once, and used at a position.
std::vector<libmap::PixelRect> texts(const Svg& svg) {
  std::map<std::string, libmap::PixelRect> letters;
  for (Element* symbol : svg.all("symbol")) {
    const char* outline = symbol->FindNestedElementWithName("path")->GetAttribute("d");
    letters["#" + std::string(symbol->GetAttribute("id"))] =
        box_of(numbers_in(outline == nullptr ? "" : outline));
  }
  std::vector<libmap::PixelRect> boxes;
  for (Element* group : svg.all("g")) {
    if (group->FindNestedElementWithName("use") == nullptr) continue;
    std::vector<PointPx> corners;
    for (int i = 0; i < group->GetNumberOfNestedElements(); ++i) {
      Element* use = group->GetNestedElement(i);
      const libmap::PixelRect& letter = letters.at(use->GetAttribute("xlink:href"));
      double x = 0.0, y = 0.0;
      EXPECT_TRUE(use->GetScalarAttribute("x", x) && use->GetScalarAttribute("y", y));
      if (letter.width < 0.0) continue;  // a blank
      corners.push_back({x + letter.left, y + letter.top});
      corners.push_back({x + letter.right(), y + letter.bottom()});
    }
    boxes.push_back(box_of(corners));
  }
  return boxes;
}

TEST(Charts, LinesLieWhereTheirNumbersSay) {
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

TEST(Charts, EqualChartsGiveEqualImagesAndFiles) {
  Chart chart = unit_chart();
  chart.title = "duplicate";
  chart.curves = {curve_of({0, 0.3, 1}, {0, 0.8, 1}, red)};
  EXPECT_TRUE(libmap::draw_chart(chart) == libmap::draw_chart(chart));
  EXPECT_TRUE(svg_of(chart).text == svg_of(chart).text);
}

TEST(Charts, SvgIsWellFormedAndCarriesItsNames) {
  Chart chart = libmap::roc_chart(
      {{.name = "before & <after>", .x = {1, 0.25, 0}, .y = {1, 0.5, 0}}}, "Rocks \"A\" & <B>");
  const Svg svg = svg_of(chart, libmap::roc_chart_size);
  EXPECT_STREQ(svg.root->GetName(), "svg");
  EXPECT_STREQ(svg.root->GetAttribute("width"), "900px");
  EXPECT_THAT(svg.all("title").at(0)->GetCharacterData(), HasSubstr("Rocks \"A\" & <B>"));
  EXPECT_THAT(svg.all("desc").at(0)->GetCharacterData(),
              testing::AllOf(HasSubstr("true positive rate over false positive rate"),
                             HasSubstr("chance; before & <after>")));
  // 11 + 11 ticks, two axis titles, the title, and two legend names.
  EXPECT_EQ(texts(svg).size(), 27U);
  EXPECT_TRUE(svg.all("text").empty());
}

// Where ticks, labels and titles are.
TEST(Charts, AxesAreLabeledAtTheirTicks) {
  Chart chart = unit_chart();
  chart.title = "A title";
  chart.y_axis.range = {0.0, 4.0};
  chart.curves = {curve_of({0, 1}, {0, 4}, red)};
  const Svg svg = svg_of(chart, {800, 600});
  const std::vector<PointPx> line = polyline(svg, red);
  const PointPx zero = line.front(), top_right = line.back();
  const std::vector<libmap::PixelRect> boxes = texts(svg);
  ASSERT_EQ(boxes.size(), 11U + 9U + 3U);
  std::size_t marks = 0;
  for (const auto& mark : paths(svg, "stroke:rgb", frame)) marks += mark.size() == 2 ? 1 : 0;
  EXPECT_EQ(marks, 11U + 9U);
  const auto label_at = [&](double x, double y) {
    return std::count_if(boxes.begin(), boxes.end(), [&](const libmap::PixelRect& box) {
      return std::abs(box.left + box.width / 2.0 - x) < 3.0 &&
             std::abs(box.top + box.height / 2.0 - y) < 3.0;
    });
  };
  for (int tick = 0; tick <= 10; ++tick)
    EXPECT_EQ(label_at(zero.x + 0.1 * tick * (top_right.x - zero.x), zero.y + 21.0), 1) << tick;
  for (int tick = 0; tick <= 8; ++tick) {
    const double y = zero.y + tick / 8.0 * (top_right.y - zero.y);
    EXPECT_EQ(std::count_if(boxes.begin(), boxes.end(),
                            [&](const libmap::PixelRect& box) {
                              return std::abs(box.right() - (zero.x - 12.0)) < 3.0 &&
                                     std::abs(box.top + box.height / 2.0 - y) < 2.0;
                            }),
              1)
        << tick;
  }
  // Title, name of the x axis, name of the y axis, which reads upward.
  EXPECT_EQ(label_at(400.0, 41.0), 1);
  const double middle = (zero.x + top_right.x) / 2.0;
  EXPECT_EQ(label_at(middle, zero.y + 58.0), 1);
  EXPECT_EQ(label_at(24.0, (zero.y + top_right.y) / 2.0), 1);
}

TEST(Charts, LabelsKeepApartAndInside) {
  for (const double scale : {1e-12, 1.0, 1234567.0, 1e15}) {
    Chart chart;
    chart.curves = {curve_of({-scale, scale}, {-scale, 3 * scale}, red)};
    for (const ChartSize size : {ChartSize{400, 300}, ChartSize{900, 700}}) {
      const std::vector<libmap::PixelRect> boxes = texts(svg_of(chart, size));
      EXPECT_GT(boxes.size(), 5U);
      for (std::size_t a = 0; a < boxes.size(); ++a) {
        EXPECT_GE(boxes[a].left, 0.0) << scale;
        EXPECT_LE(boxes[a].bottom(), size.height_px) << scale;
        for (std::size_t b = 0; b < a; ++b)
          EXPECT_FALSE(boxes[a].overlaps(boxes[b])) << scale << " " << size.width_px;
      }
    }
  }
}

TEST(Charts, SvgCurvesLieInsideTheirClippingFrameUntransformed) {
  for (const bool markers : {false, true}) {
    Chart chart = unit_chart();
    chart.title = "frame";
    chart.curves = {curve_of({0, 0.25, 1}, {0, 0.5, 1}, red),
                    curve_of({-1, 0.5, 2}, {0.5, 7, 0.5}, blue)};
    chart.curves[0].markers = chart.curves[1].markers = markers;
    const Svg svg = svg_of(chart, {800, 600});
    for (Element* group : svg.all("g")) {
      // A viewer applies `transform` to the clipping frame too: the two must not meet in one
      // element.
      if (group->GetAttribute("clip-path") == nullptr) continue;
      const char* transform = group->GetAttribute("transform");
      EXPECT_TRUE(transform == nullptr || std::string(transform) == "matrix(1,0,0,1,0,0)")
          << transform;
    }
    const std::vector<PointPx> points = polyline(svg, red);
    ASSERT_EQ(points.size(), 3u);
    EXPECT_NEAR(points[1].x - points[0].x, 0.25 * (points[2].x - points[0].x), 0.01);
    EXPECT_NEAR(points[1].y - points[0].y, 0.5 * (points[2].y - points[0].y), 0.01);
    // Five pixels around the frame, or parts of that.
    const auto clips = svg.all("clipPath");
    ASSERT_FALSE(clips.empty());
    const libmap::PixelRect frame{points[0].x - 6.0, points[2].y - 6.0,
                                  points[2].x - points[0].x + 12.0,
                                  points[0].y - points[2].y + 12.0};
    for (Element* clip : clips) {
      const libmap::PixelRect box =
          box_of(numbers_in(clip->FindNestedElementWithName("path")->GetAttribute("d")));
      EXPECT_TRUE(frame.contains({box.left, box.top}) &&
                  frame.contains({box.right(), box.bottom()}));
    }
  }
}

TEST(Charts, WhatIsBeyondTheRangeIsNotDrawn) {
  Chart chart = unit_chart();
  chart.curves = {curve_of({-1, 2}, {-0.5, 1.5}, red), curve_of({0, 1, 1}, {0, 0, 1}, blue)};
  const ColorImage image = libmap::draw_chart(chart, {800, 600});
  // The blue curve is on the edges of the frame, and seen there.
  const Box edges = find_color(image, blue), inside = find_color(image, red);
  EXPECT_GT(edges.count, 900);
  EXPECT_GT(inside.count, 500);
  EXPECT_GE(inside.left, edges.left - 6);
  EXPECT_LE(inside.right, edges.right + 6);
  EXPECT_GE(inside.top, edges.top - 6);
  EXPECT_LE(inside.bottom, edges.bottom + 6);
}

TEST(Charts, EveryReferenceInTheSvgIsDefined) {
  std::size_t references = 0;
  Chart cut = unit_chart();
  cut.curves = {curve_of({-1, 2}, {0, 1}, red)};
  for (const Chart& chart :
       {cut, unit_chart(), libmap::roc_chart({{.name = "a", .x = {1, 0}, .y = {1, 0}}}, "a"),
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

TEST(Charts, SmallAndLargeNumbersKeepTheirShape) {
  for (const double scale : {1e-12, 1e-3, 1.0, 1e6, 1e15}) {
    for (const double offset : {0.0, 1000.0, -1000.0}) {
      Chart chart;
      chart.legend = libmap::LegendCorner::none;
      chart.curves = {curve_of({offset * scale, (offset + 1) * scale, (offset + 2) * scale},
                               {offset * scale, (offset + 0.5) * scale, (offset + 2) * scale},
                               red)};
      const std::vector<PointPx> points = polyline(svg_of(chart), red);
      ASSERT_EQ(points.size(), 3u) << scale;
      EXPECT_NEAR(points[1].x - points[0].x, 0.5 * (points[2].x - points[0].x), 0.05) << scale;
      EXPECT_NEAR(points[1].y - points[0].y, 0.25 * (points[2].y - points[0].y), 0.05) << scale;
      EXPECT_GT(points[2].x - points[0].x, 300) << scale;
    }
  }
}

TEST(Charts, NumbersDoNotDependOnTheLocale) {
  struct Comma : std::numpunct<char> {
    char do_decimal_point() const override { return ','; }
    char do_thousands_sep() const override { return '.'; }
    std::string do_grouping() const override { return "\3"; }
  };
  Chart chart = libmap::roc_chart({{.name = "map", .x = {1, 0.25, 0}, .y = {1, 0.5, 0}}}, "locale");
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

TEST(Charts, HistogramBarsStandOnZeroAndTouch) {
  Chart chart;
  chart.y_axis.range = {-2.0, 4.0};
  chart.legend = libmap::LegendCorner::none;
  ChartHistogram histogram;
  histogram.first_edge = 1.0;
  histogram.bin_width = 0.5;
  histogram.heights = {3.0, -1.5, 0.0, 2.0};
  histogram.color = blue;
  chart.histograms = {histogram};
  // From a corner of the frame to the opposite one.
  chart.x_axis.range = {1.0, 3.0};
  chart.curves = {curve_of({1.0, 3.0}, {-2.0, 4.0}, red)};
  const Svg svg = svg_of(chart);
  const std::vector<PointPx> outline = polyline(svg, blue), corners = polyline(svg, red);
  const auto pixel_of = [&](double x, double y) {
    return PointPx{corners[0].x + (x - 1.0) / 2.0 * (corners[1].x - corners[0].x),
                   corners[0].y + (y + 2.0) / 6.0 * (corners[1].y - corners[0].y)};
  };
  const auto has = [&](const PointPx& wanted) {
    return std::any_of(outline.begin(), outline.end(), [&](const PointPx& point) {
      return std::hypot(point.x - wanted.x, point.y - wanted.y) < 0.02;
    });
  };
  for (std::size_t bar = 0; bar < 4; ++bar) {
    const double left = 1.0 + 0.5 * static_cast<double>(bar), height = histogram.heights[bar];
    if (height == 0.0) continue;
    EXPECT_TRUE(has(pixel_of(left, height)) && has(pixel_of(left + 0.5, height))) << bar;
  }
  EXPECT_TRUE(has(pixel_of(1.0, 0.0)) && has(pixel_of(3.0, 0.0)));
  // Filled: the pale blue between the outlines.
  const PointPx inside = pixel_of(1.25, 1.2), outside = pixel_of(1.75, 1.2);
  const ColorImage image = libmap::draw_chart(chart);
  const auto color_at = [&](const PointPx& point) {
    return image.at(static_cast<int>(point.x), static_cast<int>(point.y));
  };
  EXPECT_LT(color_at(inside)[0], 200);
  EXPECT_GT(color_at(inside)[2], 220);
  EXPECT_EQ(color_at(outside), (Color{255, 255, 255}));
}

TEST(Charts, TheLegendNamesCurvesInTheirColors) {
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

TEST(Charts, NothingOrHardlyAnythingToDraw) {
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
  EXPECT_FALSE(paths(svg_of({}), "stroke:rgb", frame).empty());
}

TEST(Charts, WhatCannotBeDrawnIsNamed) {
  const auto error_with = [](auto change, ChartSize size = {}) {
    Chart chart = unit_chart();
    chart.curves = {curve_of({0, 1}, {0, 1}, red)};
    chart.curves[0].name = "map";
    change(chart);
    const libmap::Error error = error_of([&] { libmap::chart_svg(chart, size); });
    const libmap::ErrorContext context = error.context();
    EXPECT_TRUE(is_error(error_of([&] { libmap::draw_chart(chart, size); }),
                         {.field = context.field, .value = context.value, .bound = context.bound}));
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

TEST(TickTexts, HaveTheSameDecimals) {
  EXPECT_THAT(libmap::tick_texts({0.0, 0.5, 1.0}), testing::ElementsAre("0.0", "0.5", "1.0"));
  EXPECT_THAT(libmap::tick_texts({-0.05, 0.0, 0.05}),
              testing::ElementsAre("-0.05", "0.00", "0.05"));
  EXPECT_THAT(libmap::tick_texts({0.0, 20.0, 40.0}), testing::ElementsAre("0", "20", "40"));
  EXPECT_THAT(libmap::tick_texts({-1e-12, 0.0, 1e-12}),
              testing::ElementsAre("-1e-12", "0", "1e-12"));
  EXPECT_THAT(libmap::tick_texts({0.0, 1e300}), testing::ElementsAre("0", "1e+300"));
}

TEST(Charts, NamesOfAnyLengthTakeAChartsRoom) {
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
