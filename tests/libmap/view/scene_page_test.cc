#include "libmap/view/scene_page.h"

#include <gmock/gmock.h>

#include "tests/support/test_support.h"

namespace libmap {
namespace scene_page_test {

using ::testing::ElementsAre;

SceneViewOptions options_of(int width, int height) {
  SceneViewOptions options;
  options.width = width;
  options.height = height;
  options.title = "Graspability of the test site";
  return options;
}

// No part lies on another or beyond the picture, and the scene has the most of it.
TEST(PlanPage, PartsNeverOverlapAtAnySize) {
  const std::vector<Legend> legends{score_legend()};
  for (const int width : {1, 2, 64, 100, 160, 320, 640, 801, 1600, 4000, 16384}) {
    for (const int height : {1, 2, 64, 90, 120, 240, 480, 599, 1200, 3000, 16384}) {
      const ScenePage page = plan_page(options_of(width, height), legends);
      EXPECT_GE(page.plot.width, 0.5 * width) << width << " x " << height;
      EXPECT_GE(page.plot.height, 0.55 * height) << width << " x " << height;
      std::vector<PixelRect> parts{page.plot};
      for (const auto& part : {page.title, page.legend, page.axes, page.scale_bar})
        if (part) parts.push_back(*part);
      for (std::size_t a = 0; a < parts.size(); ++a) {
        EXPECT_GE(parts[a].left, 0.0);
        EXPECT_GE(parts[a].top, 0.0);
        EXPECT_LE(parts[a].right(), width);
        EXPECT_LE(parts[a].bottom(), height);
        for (std::size_t b = 0; b < a; ++b)
          EXPECT_FALSE(parts[a].overlaps(parts[b])) << width << " x " << height;
      }
    }
  }
}

TEST(PlanPage, UsualSizesHaveAllPartsAndTinyOnesTheScene) {
  const std::vector<Legend> legends{score_legend()};
  for (const auto& [width, height] :
       std::vector<std::pair<int, int>>{{4000, 3000}, {1600, 1200}, {800, 600}, {640, 480}}) {
    const ScenePage page = plan_page(options_of(width, height), legends);
    EXPECT_TRUE(page.title && page.legend && page.axes && page.scale_bar) << width;
    EXPECT_GE(page.legend_font_px, 8);
  }
  EXPECT_FALSE(plan_page(options_of(64, 64), legends).legend);
  SceneViewOptions bare = options_of(500, 300);
  bare.title.clear();
  bare.legend = bare.axes = bare.scale_bar = false;
  const PixelRect plot = plan_page(bare, legends).plot;
  EXPECT_EQ(plot.width, 500.0);
  EXPECT_EQ(plot.height, 300.0);
}

TEST(ScaleBar, LengthsAreRound) {
  EXPECT_DOUBLE_EQ(round_length_m(1.0), 1.0);
  EXPECT_DOUBLE_EQ(round_length_m(0.99), 0.5);
  EXPECT_DOUBLE_EQ(round_length_m(0.31), 0.2);
  EXPECT_DOUBLE_EQ(round_length_m(7300.0), 5000.0);
  for (int k = 0; k < 200; ++k) {
    const double longest = std::pow(10.0, graspmap_test::uniform(-5, 5));
    EXPECT_LE(round_length_m(longest), longest * (1.0 + 1e-9));
    EXPECT_GE(round_length_m(longest), 0.39 * longest);
  }
  EXPECT_EQ(length_text(0.005), "5 mm");
  EXPECT_EQ(length_text(0.01), "1 cm");
  EXPECT_EQ(length_text(0.2), "20 cm");
  EXPECT_EQ(length_text(50.0), "50 m");
  EXPECT_EQ(length_text(2000.0), "2 km");
  EXPECT_EQ(length_text(0.0002), "0.2 mm");
}

TEST(TickTexts, HaveTheSameDecimals) {
  EXPECT_THAT(tick_texts({0.0, 0.5, 1.0}), ElementsAre("0.0", "0.5", "1.0"));
  EXPECT_THAT(tick_texts({-0.05, 0.0, 0.05}), ElementsAre("-0.05", "0.00", "0.05"));
  EXPECT_THAT(tick_texts({0.0, 20.0, 40.0}), ElementsAre("0", "20", "40"));
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

}  // namespace scene_page_test
}  // namespace libmap
