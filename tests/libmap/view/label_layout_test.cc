#include "libmap/view/label_layout.h"

#include "tests/support/test_support.h"

namespace libmap {
namespace label_layout_test {

using graspmap_test::uniform;

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

}  // namespace label_layout_test
}  // namespace libmap
