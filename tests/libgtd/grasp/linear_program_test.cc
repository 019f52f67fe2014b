// Compares the holding force with the exact linear program solver of CGAL.
#include <CGAL/Gmpzf.h>
#include <CGAL/QP_functions.h>
#include <CGAL/QP_models.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "libgtd/grasp/holding_force.h"
#include "tests/libgtd/grasp/grasp_test_support.h"

namespace linear_program_test {

using libgtd::BearingContact;
using libgtd::GripContact;
using libgtd::HoldingOptions;
using libgtd::SpineSharing;

struct ContactData {
  GripContact contact;
  std::vector<double> facet_angles;
};

// Eight unit edges on the friction cone of a facet, by rotations.
std::vector<Eigen::Vector3d> edges_of(const GripContact& contact, double facet_angle,
                                      double friction) {
  const Eigen::Vector3d lateral = contact.normal.cross(contact.drag);
  const Eigen::Vector3d axis = Eigen::AngleAxisd(-facet_angle, lateral) * contact.normal;
  const Eigen::Vector3d steepest = Eigen::AngleAxisd(-std::atan(friction), lateral) * axis;
  std::vector<Eigen::Vector3d> edges;
  for (int n = 0; n < 8; ++n)
    edges.push_back(Eigen::AngleAxisd(n * std::numbers::pi / 4, axis) * steepest);
  return edges;
}

// Variables: the pull, then a weight per edge. Rows are as in the specification; the equilibrium
// has a tolerance of `slack` N and Nm.
double exact_force(const std::vector<ContactData>& contacts, const Eigen::Vector3d& direction,
                   double friction, double limit_n, const HoldingOptions& options, double slack) {
  using Program = CGAL::Quadratic_program<double>;
  Program program(CGAL::SMALLER, true, 0, false, 0);
  // Rows 0 to 5: equal, or at most the slack; rows 6 to 11: at least -slack.
  const bool is_exact = slack == 0.0;
  for (int row = 0; row < 6; ++row)
    if (is_exact) program.set_r(row, CGAL::EQUAL);
  for (int row = 0; row < 12; ++row) program.set_b(row, slack);
  for (int row = 0; row < 3; ++row) {
    program.set_a(0, row, direction[row]);
    if (!is_exact) program.set_a(0, 6 + row, -direction[row]);
  }
  program.set_c(0, -1.0);
  int variable = 1;
  int row = 12;
  std::size_t fingers = 0;
  for (const ContactData& one : contacts) fingers = std::max(fingers, one.contact.finger + 1);
  const int drives = row;
  row += static_cast<int>(fingers);
  for (std::size_t n = 0; n < fingers; ++n) {
    program.set_b(drives + static_cast<int>(n), options.closing_force_n);
  }
  if (options.holds_when_closed)
    for (const ContactData& one : contacts) {
      // One contact for each finger.
      const double slope = std::acos(one.contact.normal.dot(Eigen::Vector3d::UnitZ()));
      const double sine = one.contact.normal.dot(one.contact.outward);
      const double reaction =
          std::max(0.0, sine * std::cos(slope) / (1 + sine * sine)) / static_cast<double>(fingers);
      program.set_a(0, drives + static_cast<int>(one.contact.finger), -reaction);
    }
  for (const ContactData& one : contacts) {
    const auto add = [&](const Eigen::Vector3d& edge, int cap_row, double cost) {
      const Eigen::Vector3d moment = (one.contact.point - options.load_point).cross(edge);
      for (int axis = 0; axis < 3; ++axis) {
        for (const int sign : {1, -1}) {
          if (is_exact && sign < 0) continue;
          const int first = sign > 0 ? 0 : 6;
          program.set_a(variable, first + axis, sign * edge[axis]);
          program.set_a(variable, first + 3 + axis, sign * moment[axis]);
        }
      }
      program.set_a(variable, drives + static_cast<int>(one.contact.finger),
                    one.contact.outward.dot(edge));
      program.set_a(variable, cap_row, cost);
      ++variable;
    };
    auto facet_angles = one.facet_angles;
    std::sort(facet_angles.rbegin(), facet_angles.rend());
    const auto ground = edges_of(one.contact, 0, friction);
    if (options.sharing == SpineSharing::best) {
      for (const double facet_angle : facet_angles) {
        program.set_b(row, limit_n);
        for (const auto& edge : edges_of(one.contact, facet_angle, friction)) add(edge, row, 1.0);
        ++row;
      }
      program.set_b(row, limit_n * static_cast<double>(facet_angles.size()));
      for (const auto& edge : ground) add(edge, row, 1.0);
      ++row;
    } else {
      program.set_b(row, limit_n);
      for (std::size_t n = 0; n < facet_angles.size(); ++n)
        for (const auto& edge : edges_of(one.contact, facet_angles[n], friction))
          add(edge, row, 1.0 / static_cast<double>(n + 1));
      for (const auto& edge : ground)
        add(edge, row, 1.0 / static_cast<double>(facet_angles.size()));
      ++row;
    }
  }
  const auto solution = CGAL::solve_linear_program(program, CGAL::Gmpzf());
  EXPECT_TRUE(solution.is_optimal());
  return -CGAL::to_double(solution.objective_value());
}

// Contacts around the axis, on one side of it, in one plane or of two fingers, including sets that
// cannot hold.
std::vector<ContactData> random_set(libmap::RandomStream& random) {
  const int count = 2 + static_cast<int>(random.below(4));
  const bool one_side = random.uniform() < 0.15;
  const bool in_plane = random.uniform() < 0.3;
  std::vector<ContactData> contacts;
  for (int n = 0; n < count; ++n) {
    ContactData one;
    const double slope = random.uniform(0, 110) * libmap::radians_per_degree;
    one.contact =
        grasp_test::ring_of_contacts(one_side ? 4 * count : count, random.uniform(0.03, 0.12),
                                     slope)[static_cast<std::size_t>(n)];
    if (!in_plane) {
      one.contact.point.z() = random.uniform(-0.08, 0.0);
      const Eigen::AngleAxisd turn(random.uniform(-0.6, 0.6), one.contact.drag);
      one.contact.normal = turn * one.contact.normal;
    }
    const std::size_t spines = 1 + random.below(2);
    for (std::size_t spine = 0; spine < spines; ++spine)
      one.facet_angles.push_back(random.uniform(0, 90) * libmap::radians_per_degree);
    contacts.push_back(std::move(one));
  }
  return contacts;
}

TEST(LinearProgram, AgreesWithAnExactSolver) {
  int holding = 0;
  int regular = 0;
  for (std::uint64_t seed = 0; seed < 1000; ++seed) {
    libmap::RandomStream random(seed, 77);
    const std::vector<ContactData> contacts = random_set(random);
    const double friction = random.uniform(0.1, 0.8);
    const double limit_n = random.uniform(2, 20);
    const HoldingOptions options = {
        .load_point = {random.uniform(-0.01, 0.01), random.uniform(-0.01, 0.01), 0.03},
        .closing_force_n = random.uniform(2, 20),
        .holds_when_closed = random.uniform() < 0.5,
        .sharing = random.uniform() < 0.5 ? SpineSharing::best : SpineSharing::equally};
    const Eigen::Vector3d direction =
        libgtd::pull_directions()[random.below(libgtd::pull_directions().size())].vector;
    std::vector<BearingContact> bearing;
    for (const ContactData& one : contacts)
      bearing.emplace_back(one.contact, one.facet_angles, friction, limit_n);
    const double force = libgtd::holding_force(bearing, direction, options);
    // If the contacts do not resist some moment, exact equality of rounded numbers has a different
    // solution than the real problem.
    const bool is_regular = contacts.size() > 2 && contacts[0].contact.point.z() != 0.0;
    const double exact =
        exact_force(contacts, direction, friction, limit_n, options, is_regular ? 0.0 : 1e-12);
    EXPECT_NEAR(force, exact, (is_regular ? 1e-9 : 1e-6) * std::max(1.0, exact)) << seed;
    regular += is_regular ? 1 : 0;
    holding += exact > 1e-3 ? 1 : 0;
  }
  EXPECT_GT(regular, 400);
  EXPECT_GT(holding, 200);
  EXPECT_LT(holding, 800);
}

}  // namespace linear_program_test
