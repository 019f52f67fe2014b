// Tests the holding force of contacts that are symmetric except for rounding, or nearly so: the
// rows of the equilibrium are then nearly dependent.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <vector>

#include "libgtd/grasp/holding_force.h"
#include "libmap/core/random_stream.h"

namespace symmetry_test {

using libgtd::BearingContact;
using libmap::RandomStream;

// On a post the pull is that of friction, m mu P; slightly inclined normals change it slightly.
TEST(HoldingForce, IsThatOfThePostIfContactsAreNearlySymmetric) {
  for (std::uint64_t seed = 0; seed < 3000; ++seed) {
    RandomStream random(seed, 3);
    const std::size_t fingers = 4 + random.below(7);
    const double friction = random.uniform(0.1, 1.0);
    const double yaw = random.uniform(0.0, 6.3);
    const double radius = random.uniform(0.02, 0.07);
    const double height = random.uniform(-0.08, 0.0);
    const double tilt = random.uniform() < 0.2 ? 0.0 : std::pow(10.0, random.uniform(-15.0, -4.0));
    const double limit_n = std::pow(10.0, random.uniform(1.3, 6.0));
    std::vector<BearingContact> contacts;
    for (std::size_t n = 0; n < fingers; ++n) {
      const double azimuth =
          yaw + 2.0 * std::numbers::pi * static_cast<double>(n) / static_cast<double>(fingers);
      libgtd::GripContact contact;
      contact.finger = n;
      contact.by_spines = true;
      contact.outward = {std::cos(azimuth), std::sin(azimuth), 0.0};
      contact.point = radius * contact.outward + height * Eigen::Vector3d::UnitZ();
      const Eigen::Vector3d aside(random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5),
                                  random.uniform(-0.5, 0.5));
      contact.normal = (contact.outward + tilt * aside).normalized();
      contact.drag = (contact.normal.z() * contact.normal - Eigen::Vector3d::UnitZ()).normalized();
      contacts.emplace_back(contact, std::vector<double>{0.0}, friction, limit_n);
    }
    libgtd::HoldingOptions options;
    options.closing_force_n = 10.0;
    options.holds_when_closed = false;
    const double expected = 10.0 * friction * static_cast<double>(fingers);
    EXPECT_NEAR(libgtd::holding_force(contacts, Eigen::Vector3d::UnitZ(), options), expected,
                expected * (1e-4 + 60.0 * tilt / friction))
        << seed;
  }
}

}  // namespace symmetry_test
