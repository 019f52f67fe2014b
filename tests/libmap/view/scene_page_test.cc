#include "libmap/view/scene_page.h"

#include <gtest/gtest.h>

#include "tests/support/test_support.h"

namespace libmap {
namespace scene_page_test {

using graspmap_test::uniform;

SceneViewOptions options_of(int width, int height) {
  SceneViewOptions options;
  options.width = width;
  options.height = height;
  options.title = "Graspability of the test site";
  return options;
}

// Parts of the page neither overlap nor exceed the image, and the scene has most of the area.
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
    const double longest = std::pow(10.0, uniform(-5, 5));
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

PixelRect around(const Eigen::Vector2d& point, double radius) {
  return {point.x() - radius, point.y() - radius, 2.0 * radius, 2.0 * radius};
}

TEST(PlaceLabels, RightBesideALonePoint) {
  const auto boxes = place_labels({{{100.0, 100.0}, 60.0, 20.0}}, 8.0, {0.0, 0.0, 400.0, 300.0});
  ASSERT_EQ(boxes.size(), 1U);
  EXPECT_GT(boxes[0].left, 108.0);
  EXPECT_LT(boxes[0].left, 120.0);
  EXPECT_DOUBLE_EQ(boxes[0].top + boxes[0].height / 2.0, 100.0);
}

TEST(PlaceLabels, StaysInsideAtTheEdges) {
  const PixelRect bounds{0.0, 0.0, 400.0, 300.0};
  for (const Eigen::Vector2d& corner :
       {Eigen::Vector2d(2, 2), Eigen::Vector2d(398, 2), Eigen::Vector2d(2, 298),
        Eigen::Vector2d(398, 298), Eigen::Vector2d(398, 150)}) {
    const PixelRect box = place_labels({{corner, 60.0, 20.0}}, 8.0, bounds).front();
    EXPECT_GE(box.left, bounds.left);
    EXPECT_GE(box.top, bounds.top);
    EXPECT_LE(box.right(), bounds.right());
    EXPECT_LE(box.bottom(), bounds.bottom());
  }
}

TEST(PlaceLabels, ThirtyLabelsCoverNothing) {
  for (int round = 0; round < 20; ++round) {
    std::vector<LabelRequest> requests;
    for (int i = 0; i < 30; ++i)
      requests.push_back({{uniform(100, 1100), uniform(50, 850)}, uniform(30, 90), 24.0});
    const std::vector<PixelRect> boxes = place_labels(requests, 9.0, {0.0, 0.0, 1200.0, 900.0});
    ASSERT_EQ(boxes.size(), requests.size());
    for (std::size_t a = 0; a < boxes.size(); ++a) {
      EXPECT_DOUBLE_EQ(boxes[a].width, requests[a].width_px);
      for (std::size_t b = 0; b < boxes.size(); ++b) {
        EXPECT_FALSE(boxes[a].overlaps(around(requests[b].anchor, 8.9)))
            << round << ": " << a << " on point " << b;
        if (a != b) {
          EXPECT_FALSE(boxes[a].overlaps(boxes[b])) << round << ": " << a << ", " << b;
        }
      }
    }
  }
}

TEST(PlaceLabels, ACrowdInOnePlaceGetsABoxEach) {
  const std::vector<LabelRequest> requests(200, {{50.0, 50.0}, 40.0, 15.0});
  const std::vector<PixelRect> boxes = place_labels(requests, 5.0, {0.0, 0.0, 100.0, 100.0});
  ASSERT_EQ(boxes.size(), 200U);
  for (const PixelRect& box : boxes) EXPECT_DOUBLE_EQ(box.height, 15.0);
}

}  // namespace scene_page_test
}  // namespace libmap
