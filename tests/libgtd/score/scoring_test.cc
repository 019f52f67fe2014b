#include "libgtd/score/voxel_matching.h"

#include <gtest/gtest.h>

namespace scoring_test {

using libgtd::Method;
using libgtd::score_percent;

TEST(Score, IsTheShareOfWantedVoxels) {
  for (const Method method :
       {Method::thesis, Method::envelope, Method::climblab, Method::corrected}) {
    EXPECT_EQ(score_percent({200, 100}, method, 120), 50.0);
    EXPECT_EQ(score_percent({200, 200}, method, 120), 100.0);
    EXPECT_EQ(score_percent({200, 0}, method, 120), 0.0);
    EXPECT_EQ(score_percent({0, 0}, method, 120), 0.0);
  }
}

TEST(Score, IsLoweredFromSixtyPercentOnAtOrBelowTheThreshold) {
  // 100 % of 90 voxels with TSV 120: 100 - 30 / 120 * 100.
  EXPECT_EQ(score_percent({90, 90}, Method::corrected, 120), 75.0);
  EXPECT_EQ(score_percent({90, 90}, Method::thesis, 120), 75.0);
  EXPECT_EQ(score_percent({120, 120}, Method::corrected, 120), 100.0);
  EXPECT_NEAR(score_percent({50, 30}, Method::thesis, 100), 10.0, 1e-5);  // exactly 60 %
  EXPECT_NEAR(score_percent({100, 59}, Method::corrected, 120), 59.0, 1e-12);
  EXPECT_EQ(score_percent({90, 90}, Method::climblab, 120), 100.0);
}

TEST(Score, OfTheAuthorsProgramCanBeNegativeAndOfCorrectedNot) {
  EXPECT_LT(score_percent({10, 7}, Method::thesis, 120), 0.0);
  EXPECT_EQ(score_percent({10, 7}, Method::corrected, 120), 0.0);
}

TEST(Score, DividesInSinglePrecisionAsTheAuthorsProgram) {
  const double percent = score_percent({675, 47}, Method::thesis, 120);
  EXPECT_EQ(percent, static_cast<double>(static_cast<float>(percent)));
  EXPECT_NE(percent, score_percent({675, 47}, Method::corrected, 120));
}

TEST(Graspable, ByThresholdOrByClimbLabsRule) {
  EXPECT_TRUE(libgtd::meets_threshold({200, 160}, 0.8, Method::corrected, 120, 0.8));
  EXPECT_FALSE(libgtd::meets_threshold({200, 159}, 0.795, Method::corrected, 120, 0.8));
  EXPECT_TRUE(libgtd::meets_threshold({121, 121}, 1.0, Method::climblab, 120, 0.8));
  EXPECT_FALSE(libgtd::meets_threshold({120, 120}, 1.0, Method::climblab, 120, 0.8));
  EXPECT_FALSE(libgtd::meets_threshold({200, 199}, 0.995, Method::climblab, 120, 0.8));
}

}  // namespace scoring_test
