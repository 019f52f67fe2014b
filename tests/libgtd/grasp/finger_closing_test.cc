#include "libgtd/grasp/finger_closing.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "libmap/core/random_stream.h"
#include "tests/libgtd/grasp/grasp_test_support.h"

namespace finger_closing_test {

using graspmap_test::error_of;
using libgtd::FingerClosing;
using libgtd::FingerGeometry;
using libgtd::FingerOutcome;
using libgtd::GroundSegment;

constexpr double degree = libmap::radians_per_degree;

std::vector<GroundSegment> profile_through(const std::vector<Eigen::Vector2d>& points) {
  std::vector<GroundSegment> profile;
  for (std::size_t n = 0; n + 1 < points.size(); ++n)
    profile.push_back({points[n], points[n + 1], static_cast<std::uint32_t>(n), true});
  return profile;
}

bool cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c,
           const Eigen::Vector2d& d) {
  const auto side = [](const Eigen::Vector2d& p, const Eigen::Vector2d& q,
                       const Eigen::Vector2d& r) {
    return (q - p).x() * (r - p).y() - (q - p).y() * (r - p).x();
  };
  return (side(a, b, c) > 0) != (side(a, b, d) > 0) && (side(c, d, a) > 0) != (side(c, d, b) > 0);
}

bool touches(const Eigen::Vector2d& a, const Eigen::Vector2d& b,
             const std::vector<GroundSegment>& profile) {
  return std::any_of(profile.begin(), profile.end(),
                     [&](const auto& segment) { return cross(a, b, segment.a, segment.b); });
}

// Oracle by small steps: angles at which a link first intersects the profile.
FingerClosing close_in_steps(const FingerGeometry& finger,
                             const std::vector<GroundSegment>& profile, double step) {
  FingerClosing closing;
  closing.curl_rad = finger.curl_rad;
  for (double t = finger.opening_rad; t >= finger.closing_rad; t -= step) {
    closing.proximal_rad = t;
    const Eigen::Vector2d knuckle = finger.knuckle(t);
    const Eigen::Vector2d tip = finger.tip(t, finger.curl_rad);
    if (touches(finger.joint(), knuckle, profile)) {
      closing.outcome = FingerOutcome::link;
      for (double c = finger.curl_rad; c <= finger.curl_limit_rad; c += step) {
        closing.curl_rad = c;
        // Excludes the knuckle itself, which may touch.
        const Eigen::Vector2d end = finger.tip(t, c);
        const Eigen::Vector2d middle = 0.5 * (knuckle + end);
        if (touches(middle, end, profile)) {
          closing.outcome = FingerOutcome::spines;
          return closing;
        }
        if (touches(knuckle + 0.02 * (end - knuckle), middle, profile)) return closing;
      }
      return closing;
    }
    const Eigen::Vector2d middle = 0.5 * (knuckle + tip);
    if (touches(middle, tip, profile)) {
      closing.outcome = FingerOutcome::spines;
      return closing;
    }
    if (touches(knuckle, middle, profile)) {
      closing.outcome = FingerOutcome::link;
      return closing;
    }
  }
  closing.outcome = FingerOutcome::end_stop;
  closing.proximal_rad = finger.closing_rad;
  return closing;
}

TEST(FingerClosing, PublishedMeasures) {
  const FingerGeometry finger = libgtd::finger_geometry(grasp_test::gripper());
  EXPECT_NEAR(finger.tip(85 * degree, 20 * degree).x(), 0.1230, 1e-4);
  EXPECT_NEAR(finger.tip(10 * degree, 20 * degree).y(), -0.0798, 1e-4);
}

TEST(FingerClosing, OnNothingItReachesTheEndStop) {
  const FingerGeometry finger = libgtd::finger_geometry(grasp_test::gripper());
  for (const auto& profile : {profile_through({}), profile_through({{-1, -0.3}, {1, -0.3}})}) {
    const FingerClosing closing = libgtd::close_finger(finger, profile);
    EXPECT_EQ(closing.outcome, FingerOutcome::end_stop);
    EXPECT_EQ(closing.proximal_rad, finger.closing_rad);
    EXPECT_FALSE(closing.spines || closing.link);
  }
}

// Circle of the tip around the joint against a plane at depth d: LF cos t + LS cos(t - c) = d.
TEST(FingerClosing, TipOnAPlane) {
  const FingerGeometry finger = libgtd::finger_geometry(grasp_test::gripper());
  for (const double depth : {0.03, 0.05, 0.07}) {
    const FingerClosing closing =
        libgtd::close_finger(finger, profile_through({{-1, -depth}, {1, -depth}}));
    ASSERT_TRUE(closing.spines);
    EXPECT_EQ(closing.outcome, FingerOutcome::spines);
    EXPECT_NEAR(closing.spines->y(), -depth, 1e-12);
    EXPECT_NEAR((*closing.spines - finger.tip(closing.proximal_rad, finger.curl_rad)).norm(), 0,
                1e-12);
  }
}

// A ridge thinner than any step, in the path of each part of the finger.
TEST(FingerClosing, AThinRidgeIsNotSkipped) {
  const FingerGeometry finger = libgtd::finger_geometry(grasp_test::gripper());
  const auto ridge = [](double r, double z) {
    return profile_through({{r - 1e-7, -0.2}, {r, z}, {r + 1e-7, -0.2}});
  };
  const Eigen::Vector2d on_proximal = finger.joint() + 0.5 * (finger.knuckle(0.8) - finger.joint());
  const FingerClosing stopped =
      libgtd::close_finger(finger, ridge(on_proximal.x(), on_proximal.y()));
  EXPECT_NEAR(stopped.proximal_rad, 0.8, 1e-6);
  ASSERT_TRUE(stopped.link);
  EXPECT_NEAR((*stopped.link - on_proximal).norm(), 0, 1e-6);
  const Eigen::Vector2d knuckle = finger.knuckle(0.8);
  const Eigen::Vector2d tip = finger.tip(0.8, finger.curl_rad);
  const Eigen::Vector2d outer = knuckle + 0.75 * (tip - knuckle);
  const FingerClosing spines = libgtd::close_finger(finger, ridge(outer.x(), outer.y()));
  EXPECT_EQ(spines.outcome, FingerOutcome::spines);
  EXPECT_NEAR(spines.proximal_rad, 0.8, 1e-5);
  const Eigen::Vector2d inner = knuckle + 0.25 * (tip - knuckle);
  EXPECT_EQ(libgtd::close_finger(finger, ridge(inner.x(), inner.y())).outcome, FingerOutcome::link);
}

TEST(FingerClosing, AgreesWithSmallSteps) {
  constexpr double step = 0.02 * degree;
  int compared = 0;
  int outcomes[3] = {};
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    libmap::RandomStream random(seed, 1);
    FingerGeometry finger = libgtd::finger_geometry(grasp_test::gripper());
    finger.curl_rad = random.uniform(0, 60) * degree;
    // A profile below the open finger.
    std::vector<Eigen::Vector2d> points;
    const double open_depth = -finger.tip(finger.opening_rad, finger.curl_rad).y();
    const double low = std::max(open_depth, -finger.knuckle(finger.opening_rad).y()) + 1e-3;
    for (double r = -0.05; r < 0.16; r += random.uniform(0.004, 0.03))
      points.emplace_back(r, -random.uniform(low, 0.1));
    const auto profile = profile_through(points);
    const FingerClosing exact = libgtd::close_finger(finger, profile);
    const FingerClosing stepped = close_in_steps(finger, profile, step);
    ++outcomes[static_cast<int>(exact.outcome)];
    EXPECT_LE(std::abs(exact.proximal_rad - stepped.proximal_rad), 3 * step) << seed;
    // Two contacts at nearly the same angle may occur in either order.
    if (exact.outcome != stepped.outcome) continue;
    ++compared;
    EXPECT_LE(std::abs(exact.curl_rad - stepped.curl_rad), 20 * step) << seed;
  }
  EXPECT_GE(compared, 285);
  for (const int count : {outcomes[0], outcomes[1]}) EXPECT_GE(count, 10);
}

TEST(FingerClosing, HeightOfTheOpenFinger) {
  const FingerGeometry finger = libgtd::finger_geometry(grasp_test::gripper());
  const double depth = -finger.tip(finger.opening_rad, finger.curl_rad).y();
  EXPECT_NEAR(*libgtd::open_finger_height(finger, profile_through({{-1, 0}, {1, 0}})), depth,
              1e-12);
  // A point under the proximal link.
  const Eigen::Vector2d middle = 0.5 * (finger.joint() + finger.knuckle(finger.opening_rad));
  EXPECT_NEAR(
      *libgtd::open_finger_height(
          finger, profile_through({{middle.x() - 1e-9, -1}, {middle.x(), 0.5}, {middle.x(), -1}})),
      0.5 - middle.y(), 1e-6);
  EXPECT_FALSE(libgtd::open_finger_height(finger, profile_through({{0.2, 0}, {1, 0}})));
}

TEST(FingerClosing, AGripperWithoutFingers) {
  libgtd::Gripper gripper = grasp_test::gripper();
  gripper.fingers.reset();
  EXPECT_EQ(error_of([&] { libgtd::finger_geometry(gripper); }).context().field, "fingers");
}

}  // namespace finger_closing_test
