// Compares fingers closed by libgtd and by Bullet: touching links and contact points.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "libmap/core/random_stream.h"
#include "tests/libgtd/grasp/bullet_hand.h"
#include "tests/libgtd/grasp/bullet_shapes.h"
#include "tests/libgtd/grasp/grasp_test_support.h"

namespace bullet_closing_test {

using namespace bullet_test;
using libmap::RandomStream;

constexpr int shape_count = 50;

// Sizes of shapes for a finger of this length, m.
Shape make_shape(int number, double reach) {
  RandomStream random(2026, static_cast<std::uint64_t>(number));
  const auto size = [&](double low, double high) { return reach * random.uniform(low, high); };
  const double half = 4.0 * reach;
  if (number < 14) {
    const double radius = size(0.2, 1.3);
    // The last shapes float.
    const double center = radius * (random.uniform(0.2, 1.0) + (number < 10 ? 0.0 : 1.0));
    return {"sphere", on_plane(sphere(radius, center), half), {0.0, 0.0, radius + center}};
  }
  if (number < 22) {
    const double height = size(0.2, 1.4);
    return {"post", on_plane(post(size(0.2, 1.1), height), half), {0.0, 0.0, height}};
  }
  if (number < 30) {
    const double height = size(0.2, 1.4);
    return {"box", on_plane(box(size(0.2, 0.9), size(0.2, 0.9), height), half), {0.0, 0.0, height}};
  }
  if (number < 36) {
    const double height = size(0.3, 1.4);
    return {"cone", on_plane(cone(size(0.5, 1.4), height), half), {0.0, 0.0, height}};
  }
  if (number < 42) {
    const double height = size(0.3, 1.4);
    return {
        "wedge", on_plane(wedge(size(0.5, 1.5), size(0.3, 1.2), height), half), {0.0, 0.0, height}};
  }
  if (number < 44) {
    const double slope = std::tan(random.uniform(5.0, 40.0) * radians);
    return {"tilted plane",
            field(half, 8, [slope](double x, double) { return slope * x; }),
            {0.0, 0.0, 0.0}};
  }
  struct Bump {
    double x, y, width, height;
  };
  std::vector<Bump> bumps;
  for (int n = 0; n < 40; ++n)
    bumps.push_back({size(-1.8, 1.8), size(-1.8, 1.8), size(0.1, 0.4), size(-0.3, 0.6)});
  const auto height = [&](double x, double y) {
    double sum = 0.0;
    for (const Bump& bump : bumps)
      sum += bump.height * std::exp(-0.5 * (std::pow(x - bump.x, 2) + std::pow(y - bump.y, 2)) /
                                    std::pow(bump.width, 2));
    return sum;
  };
  return {"bumps", field(2.2 * reach, 100, height), {0.0, 0.0, height(0.0, 0.0)}};
}

double reach_m(const Gripper& gripper) {
  return 0.001 * (gripper.finger_length_mm + gripper.spine_length_mm);
}

// 2 of 20,000 fingers on such random shapes differ: a grazing contact, and a contact assigned to
// the other half of the distal link at the same angle.
TEST(BulletGripper, ClosesAlike) {
  std::map<FingerOutcome, int> outcomes;
  int went_on_alone = 0;
  int palms = 0;
  for (int number = 0; number < shape_count; ++number) {
    const Gripper gripper = grasp_test::gripper(
        {}, std::array{"scar-e", "limbero", "hubrobo"}[static_cast<std::size_t>(number % 3)]);
    const Shape shape = make_shape(number, reach_m(gripper));
    RandomStream random(7, static_cast<std::uint64_t>(number));
    ApproachPose pose;
    pose.yaw_rad = random.uniform(0.0, 2.0 * pi);
    pose.offset_m = 0.06 * reach_m(gripper) * Eigen::Vector2d(random.normal(), random.normal());
    pose.tilt_rad = 3.0 * radians * Eigen::Vector2d(random.normal(), random.normal());
    const ClosedGripper ours = closed_by_libgtd(shape, gripper, pose);
    StaticMesh mesh(shape);
    const ClosedByBullet theirs =
        HandInBullet(gripper, mesh).close(pose, libgtd::ClosingOptions().start_height_m);
    const std::string name = fmt::format("{} {} on {}", number, gripper.name, shape.name);
    EXPECT_EQ(ours.palm_touches, theirs.palm_touches) << name;
    EXPECT_TRUE(ours.patch_from_gripper.isApprox(theirs.patch_from_gripper, 1e-5)) << name;
    ASSERT_EQ(ours.fingers.size(), theirs.fingers.size()) << name;
    palms += ours.palm_touches ? 1 : 0;
    std::size_t points = 0;
    for (std::size_t n = 0; n < ours.fingers.size(); ++n) {
      const libgtd::FingerClosing& closing = ours.fingers[n].closing;
      const ClosedByBullet::Finger& finger = theirs.fingers[n];
      EXPECT_EQ(closing.outcome, finger.outcome) << name << ", finger " << n;
      EXPECT_EQ(closing.link.has_value(), finger.link.has_value()) << name << ", finger " << n;
      EXPECT_NEAR(closing.proximal_rad, finger.proximal_rad, 0.1 * radians) << name;
      EXPECT_NEAR(closing.curl_rad, finger.curl_rad, 0.1 * radians) << name;
      points += (finger.link ? 1 : 0) + (finger.spines ? 1 : 0);
      ++outcomes[closing.outcome];
      went_on_alone += closing.spines && closing.link ? 1 : 0;
    }
    EXPECT_EQ(ours.contacts.size(), points) << name;
    for (const libgtd::GripContact& contact : ours.contacts) {
      const ClosedByBullet::Finger& finger = theirs.fingers[contact.finger];
      const auto& point = contact.by_spines ? finger.spines : finger.link;
      if (!point) continue;  // reported above
      EXPECT_LT((contact.point - *point).norm(), 1e-4) << name;
    }
  }
  EXPECT_GT(outcomes[FingerOutcome::spines], 100);
  EXPECT_GT(outcomes[FingerOutcome::link], 20);
  EXPECT_GT(outcomes[FingerOutcome::end_stop], 50);
  EXPECT_GT(went_on_alone, 20);
  EXPECT_GT(palms, 10);
  EXPECT_LT(palms, shape_count - 10);
}
}  // namespace bullet_closing_test
