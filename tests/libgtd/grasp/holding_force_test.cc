#include "libgtd/grasp/holding_force.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "tests/libgtd/grasp/grasp_test_support.h"

namespace holding_force_test {

using grasp_test::ring_of_contacts;
using libgtd::BearingContact;
using libgtd::GripContact;
using libgtd::HoldingOptions;
using libgtd::SpineSharing;

constexpr double degree = libmap::radians_per_degree;
const double phi = std::atan(0.39);
const Eigen::Vector3d away = Eigen::Vector3d::UnitZ();

std::vector<BearingContact> bearing(const std::vector<GripContact>& contacts,
                                    const std::vector<double>& facet_angles, double friction = 0.39,
                                    double limit_n = 1e3) {
  std::vector<BearingContact> made;
  for (const GripContact& contact : contacts)
    made.emplace_back(contact, facet_angles, friction, limit_n);
  return made;
}

HoldingOptions limited(double closing_force_n = 10, SpineSharing sharing = SpineSharing::best) {
  return {.load_point = {0, 0, 0.05},
          .closing_force_n = closing_force_n,
          .holds_when_closed = false,
          .sharing = sharing};
}

// m P tan(g + psi + phi - 90 deg), 0 for a negative angle: plane (g = 0), cone or sphere at the
// polar angle g, cylinder (g = 90 deg, psi = 0: m mu P).
TEST(HoldingForce, ClosedFormsOnSlopes) {
  for (const SpineSharing sharing : {SpineSharing::best, SpineSharing::equally})
    for (const int fingers : {3, 4, 8})
      for (const double slope : {0.0, 20.0, 45.0, 70.0, 90.0})
        for (const double psi : {0.0, 15.0, 40.0, 70.0, 85.0}) {
          const double angle = (slope + psi) * degree + phi - 90 * degree;
          if (angle > 85 * degree) continue;  // caged: limited by the spines only
          const double expected = angle > 0 ? fingers * 10 * std::tan(angle) : 0;
          EXPECT_NEAR(libgtd::holding_force(
                          bearing(ring_of_contacts(fingers, 0.08, slope * degree), {psi * degree}),
                          away, limited(10, sharing)),
                      expected, 1e-9 * (1 + expected))
              << fingers << " " << slope << " " << psi;
        }
}

// Wedge: two fingers on each side of a ridge.
TEST(HoldingForce, OnAWedge) {
  std::vector<GripContact> contacts;
  for (const double side : {1.0, -1.0})
    for (const double y : {-0.03, 0.03}) {
      GripContact contact = ring_of_contacts(1, 0.05, 50 * degree)[0];
      contact.finger = contacts.size();
      for (Eigen::Vector3d* v : {&contact.point, &contact.normal, &contact.drag, &contact.outward})
        v->x() *= side;
      contact.point.y() = y;
      contacts.push_back(contact);
    }
  EXPECT_NEAR(libgtd::holding_force(bearing(contacts, {30 * degree}), away, limited()),
              4 * 10 * std::tan(50 * degree + 30 * degree + phi - 90 * degree), 1e-8);
}

// Chen et al. 2024, from a run of their program: two fingers of ten spines, closing force and spine
// limit 10 N, 400 draws; psi between the minimum that bears the closing force and 90 deg.
TEST(HoldingForce, PublishedMonteCarlo) {
  struct Row {
    double slope_deg, mean_n, deviation_n;
  };
  for (const Row& row : {Row{0, 6.7, 0.8}, Row{15, 14.4, 1.9}, Row{30, 24.0, 5.2},
                         Row{45, 35.9, 8.9}, Row{60, 47.1, 12.4}}) {
    double sum = 0;
    libmap::RandomStream random(11, static_cast<std::uint64_t>(row.slope_deg));
    for (int draw = 0; draw < 400; ++draw) {
      std::vector<BearingContact> contacts;
      for (const GripContact& contact : ring_of_contacts(2, 0.08, row.slope_deg * degree)) {
        std::vector<double> facet_angles;
        for (int n = 0; n < 10; ++n)
          facet_angles.push_back(
              random.uniform(90 * degree - phi - row.slope_deg * degree, 90 * degree));
        contacts.emplace_back(contact, facet_angles, 0.39, 10.0);
      }
      HoldingOptions options = limited(10, SpineSharing::equally);
      options.holds_when_closed = true;
      sum += libgtd::holding_force(contacts, away, options);
    }
    EXPECT_NEAR(sum / 400, row.mean_n, row.deviation_n) << row.slope_deg;
  }
}

std::vector<BearingContact> random_contacts(libmap::RandomStream& random, int count,
                                            double friction, double limit_n,
                                            const Eigen::Isometry3d& motion) {
  std::vector<BearingContact> contacts;
  for (int n = 0; n < count; ++n) {
    GripContact contact =
        ring_of_contacts(count, random.uniform(0.04, 0.1),
                         random.uniform(0, 100) * degree)[static_cast<std::size_t>(n)];
    contact.point.z() = random.uniform(-0.05, 0);
    std::vector<double> facet_angles;
    for (int spine = 0; spine < 4; ++spine) facet_angles.push_back(random.uniform(0, 90) * degree);
    contact.point = motion * contact.point;
    for (Eigen::Vector3d* v : {&contact.normal, &contact.drag, &contact.outward})
      *v = motion.linear() * *v;
    contacts.emplace_back(contact, facet_angles, friction, limit_n);
  }
  return contacts;
}

struct Case {
  double friction = 0.39;
  double limit_n = 10;
  double closing_n = 10;
  bool holds = false;
  int count = 6;
  SpineSharing sharing = SpineSharing::best;
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
};

double force_of(std::uint64_t seed, const Case& of) {
  libmap::RandomStream random(seed, 2);
  auto contacts = random_contacts(random, 6, of.friction, of.limit_n, of.motion);
  contacts.erase(contacts.begin() + of.count, contacts.end());
  const Eigen::Vector3d direction = libgtd::pull_directions()[seed % 17].vector;
  return libgtd::holding_force(contacts, of.motion.linear() * direction,
                               {.load_point = of.motion * Eigen::Vector3d(0, 0, 0.03),
                                .closing_force_n = of.closing_n,
                                .holds_when_closed = of.holds,
                                .axis = of.motion.linear() * away,
                                .sharing = of.sharing});
}

TEST(HoldingForce, RisesWithWhatHolds) {
  int positive = 0;
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    const double force = force_of(seed, {});
    positive += force > 0.1 ? 1 : 0;
    const double tolerance = 1e-8 * (1 + force);
    EXPECT_LE(force, force_of(seed, {.friction = 0.5}) + tolerance) << seed;
    EXPECT_LE(force, force_of(seed, {.limit_n = 15}) + tolerance) << seed;
    EXPECT_LE(force, force_of(seed, {.closing_n = 15}) + tolerance) << seed;
    EXPECT_LE(force, force_of(seed, {.holds = true}) + tolerance) << seed;
    EXPECT_GE(force, force_of(seed, {.count = 5}) - tolerance) << seed;
    EXPECT_GE(force, force_of(seed, {.sharing = SpineSharing::equally}) - tolerance) << seed;
    EXPECT_NEAR(3 * force, force_of(seed, {.limit_n = 30, .closing_n = 30}), 3 * tolerance) << seed;
    const Eigen::Isometry3d motion =
        Eigen::Translation3d(1, -2, 0.5) *
        Eigen::AngleAxisd(1.1, Eigen::Vector3d(0.3, -1, 0.7).normalized());
    EXPECT_NEAR(force, force_of(seed, {.motion = motion}), tolerance) << seed;
  }
  EXPECT_GT(positive, 50);
}

TEST(HoldingForce, SpinesThatShareEqually) {
  // On a cylinder without friction, only the facets bear force: 5 N each.
  const auto force = [](std::vector<double> facet_angles, SpineSharing sharing) {
    return libgtd::holding_force(bearing(ring_of_contacts(4, 0.08, 0), facet_angles, 0.0, 5.0),
                                 away, limited(1e3, sharing));
  };
  // Without friction there is no pull down along the normal unless the facet overhangs.
  EXPECT_NEAR(force({80 * degree}, SpineSharing::best), 0, 1e-9);
  // Friction of 20 deg, facets of 90 and 75 deg: pulls at 20 and 5 deg below the plane.
  const double mu = std::tan(20 * degree);
  const auto with_friction = [&](std::vector<double> facet_angles, SpineSharing sharing) {
    return libgtd::holding_force(bearing(ring_of_contacts(4, 0.08, 0), facet_angles, mu, 5.0), away,
                                 limited(1e3, sharing));
  };
  const double steep = 5 * std::sin(20 * degree);
  const double flat = 5 * std::sin(5 * degree);
  EXPECT_NEAR(with_friction({90 * degree, 75 * degree}, SpineSharing::best), 4 * (steep + flat),
              1e-8);
  EXPECT_NEAR(with_friction({90 * degree, 75 * degree}, SpineSharing::equally),
              4 * std::max(steep, 2 * flat), 1e-8);
  EXPECT_NEAR(with_friction({90 * degree, 88 * degree}, SpineSharing::equally),
              4 * 2 * 5 * std::sin(18 * degree), 1e-8);
}

TEST(HoldingForce, AdhesionLaw) {
  libgtd::EngagementOptions options;
  options.law = libgtd::EngagementLaw::adhesion;
  std::vector<BearingContact> contacts;
  for (const GripContact& contact : ring_of_contacts(8, 0.1, 0))
    contacts.emplace_back(contact, options, 0.39, 2.5);
  EXPECT_NEAR(libgtd::holding_force(contacts, away, limited(1e3)), 8 * 2.5 * std::tan(20 * degree),
              1e-9);
  EXPECT_NEAR(libgtd::holding_force(contacts, away, limited(1.0)), 8 * 1.0 * std::tan(20 * degree),
              1e-9);
}

TEST(HoldingForce, NothingHolds) {
  EXPECT_EQ(libgtd::min_holding_force({}, limited()).force_n, 0);
  EXPECT_EQ(
      libgtd::min_holding_force(bearing(ring_of_contacts(1, 0.08, 1.5), {1.5}), limited()).force_n,
      0);
  // All on one side.
  auto contacts = ring_of_contacts(8, 0.08, 60 * degree);
  contacts.resize(3);
  EXPECT_EQ(libgtd::holding_force(bearing(contacts, {0.3}), away, limited()), 0);
  // No friction, facet angle 0.
  EXPECT_NEAR(
      libgtd::holding_force(bearing(ring_of_contacts(8, 0.08, 0.5), {0.0}, 0.0), away, limited()),
      0, 1e-12);
}

TEST(HoldingForce, TheLeastOfTheDirections) {
  ASSERT_EQ(libgtd::pull_directions().size(), 17u);
  EXPECT_EQ(libgtd::pull_directions()[3].name(), "45@90");
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    libmap::RandomStream random(seed, 5);
    const auto contacts = random_contacts(random, 2 + static_cast<int>(seed % 8), 0.6, 10,
                                          Eigen::Isometry3d::Identity());
    double least = 1e9;
    for (const auto& direction : libgtd::pull_directions())
      least = std::min(least, libgtd::holding_force(contacts, direction.vector, limited()));
    for (const std::size_t first : {0, 5, 16}) {
      const libgtd::WeakestDirection found = libgtd::min_holding_force(contacts, limited(), first);
      EXPECT_NEAR(found.force_n, least, 1e-9);
      EXPECT_NEAR(libgtd::holding_force(contacts, libgtd::pull_directions()[found.direction].vector,
                                        limited()),
                  least, 1e-9);
    }
  }
}

TEST(Engagement, ShareOfSpines) {
  libgtd::Engagement engagement;
  EXPECT_NEAR(libgtd::engagement_fraction(engagement, 25), 1 - std::exp(-3.0), 1e-12);
  EXPECT_LT(libgtd::engagement_fraction(engagement, 100), 0.9);
  engagement.drag_mm = 0;
  EXPECT_EQ(libgtd::engagement_fraction(engagement, 25), 0);
  // Random draws of 10000 spines.
  libmap::RandomStream random(1, 1);
  libgtd::Gripper many = grasp_test::gripper();
  many.fingers->spines_per_finger = 10000;
  const auto drawn = libgtd::draw_bearing(ring_of_contacts(1, 0.1, 0), many, {}, random);
  ASSERT_EQ(drawn.size(), 1u);
  EXPECT_NEAR(static_cast<double>(drawn[0].spines()), 10000 * (1 - std::exp(-3.0)), 100);
}

}  // namespace holding_force_test
