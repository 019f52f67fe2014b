#include "libmap/core/score_color.h"

#include <gtest/gtest.h>

#include <cmath>

namespace score_color_test {

using libmap::score_classes;
using libmap::score_color;

TEST(ScoreColorTest, ClassesBeginAtTheirBound) {
  for (std::size_t n = 0; n + 1 < score_classes.size(); ++n) {
    const double bound = score_classes[n].min_score;
    EXPECT_EQ(score_color(bound), score_classes[n].color) << bound;
    EXPECT_EQ(score_color(bound + 0.05), score_classes[n].color) << bound;
    EXPECT_EQ(score_color(bound - 0.001), score_classes[n + 1].color) << bound;
  }
}

TEST(ScoreColorTest, SinglePrecisionKeepsTheClass) {
  for (const libmap::ScoreClass& one : score_classes) {
    if (!std::isfinite(one.min_score)) continue;
    EXPECT_EQ(score_color(static_cast<double>(static_cast<float>(one.min_score))), one.color);
  }
}

TEST(ScoreColorTest, NegativeIsRedAndNaNIsGray) {
  EXPECT_EQ(score_color(-3.0), score_classes.back().color);
  EXPECT_EQ(score_color(0.0), score_classes.back().color);
  EXPECT_EQ(score_color(1.0), score_classes.front().color);
  EXPECT_EQ(score_color(std::nan("")), libmap::no_value_color);
}

}  // namespace score_color_test
