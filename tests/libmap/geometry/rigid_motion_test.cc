#include "libmap/geometry/rigid_motion.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/test_support.h"

namespace rigid_motion_test {

using graspmap_test::uniform;
using libmap::Matrix6d;
using libmap::Pose;
using libmap::Vector6d;

Vector6d random_step(double shift_m, double turn_rad) {
  Vector6d step;
  for (int n = 0; n < 3; ++n) step[n] = uniform(-shift_m, shift_m);
  for (int n = 3; n < 6; ++n) step[n] = uniform(-turn_rad, turn_rad);
  return step;
}

Pose random_pose() { return libmap::moved(Pose::Identity(), random_step(1.0, 1.5)); }

TEST(RigidMotion, StepsAreUndone) {
  for (int trial = 0; trial < 50; ++trial) {
    const Pose pose = random_pose();
    const Vector6d step = random_step(0.5, 1.5);
    EXPECT_LT((libmap::step_between(pose, libmap::moved(pose, step)) - step).norm(), 1e-12);
  }
  const Eigen::Vector3d tiny(1e-10, -2e-10, 3e-10);
  EXPECT_LT(
      (libmap::rotation_vector_of(libmap::rotation_of(tiny).toRotationMatrix()) - tiny).norm(),
      1e-16);
  const Eigen::Vector3d half_turn(0.0, M_PI - 1e-7, 0.0);
  EXPECT_NEAR(libmap::rotation_vector_of(libmap::rotation_of(half_turn).toRotationMatrix()).norm(),
              M_PI - 1e-7, 1e-9);
}

// Derivative by central differences.
TEST(RigidMotion, DerivativesAreThoseOfDifferences) {
  constexpr double step = 1e-6;
  for (const double turn : {1e-5, 0.01, 0.5, 1.7}) {
    const Pose a = random_pose();
    const Pose b = libmap::moved(a, random_step(0.5, turn));
    const Pose measured = libmap::moved(a.inverse() * b, random_step(0.1, turn));
    const Pose relative = a.inverse() * b;
    const Matrix6d outer = libmap::step_derivative(measured, relative);
    const libmap::RelativeJacobian jacobian = libmap::relative_jacobian(relative);
    for (int n = 0; n < 6; ++n) {
      const Vector6d by = step * Vector6d::Unit(n);
      const auto residual = [&](const Pose& from, const Pose& to) {
        return libmap::step_between(measured, from.inverse() * to);
      };
      const Vector6d by_a =
          (residual(libmap::moved(a, by), b) - residual(libmap::moved(a, -by), b)) / (2.0 * step);
      const Vector6d by_b =
          (residual(a, libmap::moved(b, by)) - residual(a, libmap::moved(b, -by))) / (2.0 * step);
      EXPECT_LT((outer * jacobian.by_a.col(n) - by_a).norm(), 1e-7) << turn << " " << n;
      EXPECT_LT((outer * jacobian.by_b.col(n) - by_b).norm(), 1e-7) << turn << " " << n;
    }
  }
}

}  // namespace rigid_motion_test
