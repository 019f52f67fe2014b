#include "libmap/core/single_precision.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/support/test_support.h"

namespace libmap {
namespace single_precision_test {

float kept(double value) {
  const volatile float single = static_cast<float>(value);
  return single;
}

TEST(SinglePrecision, EveryNumberIsRounded) {
  std::vector<Eigen::Vector3d> points(100);
  for (Eigen::Vector3d& point : points)
    for (double& coordinate : point) coordinate = graspmap_test::uniform(-300, 300);
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3d rounded = rounded_to_single(point);
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_EQ(rounded[axis], static_cast<double>(kept(point[axis])));
      EXPECT_EQ(rounded_to_single(point[axis]), rounded[axis]);
      EXPECT_EQ(rounded_to_single(rounded[axis]), rounded[axis]);
      EXPECT_NE(rounded[axis], point[axis]);
    }
  }
}

}  // namespace single_precision_test
}  // namespace libmap
