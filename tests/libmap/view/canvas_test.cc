#include "libmap/view/canvas.h"

#include <gtest/gtest.h>

#include "tests/support/test_support.h"

namespace libmap {
namespace canvas_test {

constexpr Color white{255, 255, 255};
constexpr Color red{255, 0, 0};
constexpr Color blue{0, 0, 255};

// Bounding box of the pixels that are not white.
PixelRect drawn_box(const ColorImage& image) {
  int left = image.width, top = image.height, right = 0, bottom = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (image.at(x, y) == white) continue;
      left = std::min(left, x);
      top = std::min(top, y);
      right = std::max(right, x + 1);
      bottom = std::max(bottom, y + 1);
    }
  }
  return {double(left), double(top), double(right - left), double(bottom - top)};
}

TEST(Text, IsMeasuredAndShortened) {
  const TextStyle style{.size_px = 20};
  const double wide = text_size("graspability", style).x();
  EXPECT_GT(wide, 60.0);
  EXPECT_LT(wide, 200.0);
  EXPECT_GT(text_size("graspability", {.size_px = 40}).x(), 1.8 * wide);
  EXPECT_EQ(shortened_text("graspability", style, 1000.0), "graspability");
  const std::string shorter = shortened_text("graspability", style, 0.6 * wide);
  EXPECT_LE(text_size(shorter, style).x(), 0.6 * wide);
  EXPECT_TRUE(shorter.starts_with("gra")) << shorter;
  EXPECT_TRUE(shorter.ends_with("...")) << shorter;
  EXPECT_EQ(shortened_text("graspability", style, 3.0), "");
  // Whole characters only.
  for (double width = 20.0; width < 120.0; width += 3.0) {
    const std::string text =
        shortened_text("\u00e4\u00f6\u00fc\u00e4\u00f6\u00fc\u00e4", style, width);
    if (text.size() > 3) {
      EXPECT_EQ(text.size() % 2, text.ends_with("...") ? 1U : 0U);
    }
  }
}

TEST(Text, IsDrawnWhereItIsAligned) {
  const auto box_of = [](TextStyle style) {
    style.size_px = 30;
    Canvas canvas(400, 400);
    canvas.text({200.0, 200.0}, "HHHHHH", style);
    return drawn_box(canvas.pixels());
  };
  const double width = text_size("HHHHHH", {.size_px = 30}).x();
  const PixelRect left = box_of({});
  EXPECT_NEAR(left.left, 200.0, 4.0);
  EXPECT_NEAR(left.width, width, 8.0);
  EXPECT_NEAR(left.height, 0.73 * 30, 2.0);
  EXPECT_NEAR(left.top + left.height / 2.0, 200.0, 1.0);
  EXPECT_NEAR(box_of({.align = TextAlign::right}).right(), 200.0, 4.0);
  const PixelRect center = box_of({.align = TextAlign::center});
  EXPECT_NEAR(center.left + center.width / 2.0, 200.0, 1.5);
  const PixelRect upward = box_of({.upward = true});
  EXPECT_NEAR(upward.bottom(), 200.0, 4.0);
  EXPECT_NEAR(upward.height, left.width, 1.5);
  EXPECT_NEAR(upward.width, left.height, 1.5);
  EXPECT_GT(box_of({.bold = true}).width, left.width + 5.0);
}

TEST(Text, BytesThatAreNoTextDoNotHideTheRest) {
  const std::string broken = "a\xFF\n\xC3";
  EXPECT_GT(text_size(broken, {.size_px = 20}).x(), text_size("a", {.size_px = 20}).x());
  Canvas canvas(100, 50);
  canvas.text({5.0, 25.0}, broken, {.size_px = 20});
  canvas.rectangle({0.0, 0.0, 4.0, 4.0}, red);
  const ColorImage image = canvas.pixels();
  EXPECT_EQ(image.at(1, 1), red);
  EXPECT_GT(drawn_box(image).right(), 20.0);
}

TEST(Shapes, CoverTheirPixels) {
  Canvas canvas(40, 30);
  canvas.rectangle({3.0, 4.0, 10.0, 6.0}, red);
  canvas.clipped({20.0, 0.0, 5.0, 30.0}, [&] { canvas.rectangle({0.0, 20.0, 40.0, 3.0}, blue); });
  canvas.polyline({{0.0, 15.0}, {40.0, 15.0}}, 2.0, blue);
  canvas.disc({33.0, 7.0}, 4.0, red);
  const ColorImage image = canvas.pixels();
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 40; ++x) {
      const bool in_rectangle = x >= 3 && x < 13 && y >= 4 && y < 10;
      const bool in_clip = x >= 20 && x < 25 && y >= 20 && y < 23;
      const bool on_line = y == 14 || y == 15;
      if (x >= 28 && y < 12) continue;
      EXPECT_EQ(image.at(x, y), in_rectangle         ? red
                                : in_clip || on_line ? blue
                                                     : white)
          << x << " " << y;
    }
  }
  EXPECT_EQ(image.at(33, 7), red);
  EXPECT_EQ(image.at(33, 4), red);
  EXPECT_EQ(image.at(33, 1), white);
  EXPECT_EQ(image.at(29, 3), white);
}

TEST(Shapes, DashedLinesHaveGaps) {
  Canvas canvas(200, 20);
  canvas.polyline({{0.0, 10.0}, {200.0, 10.0}}, 4.0, blue, true);
  const ColorImage image = canvas.pixels();
  int changes = 0;
  for (int x = 1; x < 200; ++x) changes += image.at(x, 10) != image.at(x - 1, 10) ? 1 : 0;
  EXPECT_NEAR(changes, 2 * 200 / 28, 2);
}

TEST(Images, KeepTheirPixelsOrAreScaled) {
  ColorImage image(30, 20);
  for (int y = 0; y < 20; ++y)
    for (int x = 0; x < 30; ++x)
      image.at(x, y) = {std::uint8_t(8 * x), std::uint8_t(10 * y), std::uint8_t(x * y % 256)};
  Canvas canvas(60, 40);
  canvas.image(image, {7.0, 9.0, 30.0, 20.0});
  const ColorImage same = canvas.pixels();
  for (int y = 0; y < 20; ++y)
    for (int x = 0; x < 30; ++x) ASSERT_EQ(same.at(7 + x, 9 + y), image.at(x, y));
  EXPECT_EQ(same.at(6, 9), white);
  EXPECT_EQ(same.at(37, 28), white);

  // Stripes of one pixel become their mean, not some of them.
  ColorImage stripes(400, 400);
  for (int y = 0; y < 400; ++y)
    for (int x = 0; x < 400; ++x) stripes.at(x, y) = x % 2 == 0 ? red : blue;
  Canvas small(50, 50);
  small.image(stripes, {0.0, 0.0, 50.0, 50.0});
  const Color middle = small.pixels().at(25, 25);
  EXPECT_NEAR(middle[0], 127, 25);
  EXPECT_NEAR(middle[2], 127, 25);
}

TEST(Svg, ContainsTitleAndDescriptionOnce) {
  const auto draw = [] {
    Canvas canvas(100, 50, CanvasFormat::svg);
    canvas.text({5.0, 25.0}, "label", {});
    return canvas.svg("a < b & c", "what\xFF is shown");
  };
  const std::string svg = draw();
  EXPECT_NE(svg.find("<title>a &lt; b &amp; c</title>"), std::string::npos);
  EXPECT_NE(svg.find("<desc>what? is shown</desc>"), std::string::npos);
  EXPECT_EQ(svg.find("surface"), std::string::npos);
  EXPECT_EQ(draw(), svg);
}

}  // namespace canvas_test
}  // namespace libmap
