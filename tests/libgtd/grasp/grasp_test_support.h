// Grippers, meshes and contacts for the tests of the virtual field test.
#pragma once

#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "libgtd/grasp/bearing.h"
#include "libgtd/gripper/gripper_io.h"
#include "libmap/core/angle.h"
#include "libmap/core/triangle_mesh.h"
#include "tests/support/test_support.h"

namespace grasp_test {

// Returns a gripper with known parameters: 10 N per spine and closing force.
inline libgtd::Gripper gripper(std::vector<std::pair<std::string, std::string>> overrides = {},
                               const std::string& name = "scar-e") {
  for (const char* key : {"fingers.closing_force_n", "fingers.spine_force_limit_n"})
    overrides.insert(overrides.begin(), {key, "10"});
  libgtd::Gripper made = libgtd::read_gripper(
      graspmap_test::source_folder() / "data/grippers" / (name + ".yaml"), overrides);
  made.ranges = {};
  return made;
}

// Sets all facets to this angle.
inline libgtd::Gripper with_lean(libgtd::Gripper gripper, double psi_deg) {
  gripper.engagement.asperity_min_deg = gripper.engagement.asperity_max_deg = psi_deg;
  gripper.engagement.engagement_rate = 100;
  return gripper;
}

// Returns z = height(x, y) on a square of this half side, with 2 * cells squares along each edge.
inline libmap::TriangleMesh height_mesh(double half_m, int cells,
                                        const std::function<double(double, double)>& height) {
  libmap::TriangleMesh mesh;
  const int points = 2 * cells + 1;
  for (int i = 0; i < points; ++i)
    for (int j = 0; j < points; ++j) {
      const double x = half_m * (i - cells) / cells;
      const double y = half_m * (j - cells) / cells;
      mesh.vertices.emplace_back(x, y, height(x, y));
    }
  const auto index = [&](int i, int j) { return static_cast<std::uint32_t>(i * points + j); };
  for (int i = 0; i + 1 < points; ++i)
    for (int j = 0; j + 1 < points; ++j) {
      mesh.triangles.push_back({index(i, j), index(i + 1, j), index(i + 1, j + 1)});
      mesh.triangles.push_back({index(i, j), index(i + 1, j + 1), index(i, j + 1)});
    }
  return mesh;
}

// Returns a body of revolution about z by its profile (radius, z) from top to bottom.
inline libmap::TriangleMesh revolved(const std::vector<Eigen::Vector2d>& profile, int sides) {
  libmap::TriangleMesh mesh;
  for (const Eigen::Vector2d& point : profile)
    for (int n = 0; n < sides; ++n) {
      const double angle = 2.0 * std::numbers::pi * (n + 0.5) / sides;
      mesh.vertices.emplace_back(point.x() * std::cos(angle), point.x() * std::sin(angle),
                                 point.y());
    }
  const auto index = [&](std::size_t ring, int n) {
    return static_cast<std::uint32_t>(ring * static_cast<std::size_t>(sides) +
                                      static_cast<std::size_t>(n % sides));
  };
  for (std::size_t ring = 0; ring + 1 < profile.size(); ++ring)
    for (int n = 0; n < sides; ++n) {
      mesh.triangles.push_back({index(ring, n), index(ring + 1, n), index(ring + 1, n + 1)});
      mesh.triangles.push_back({index(ring, n), index(ring + 1, n + 1), index(ring, n + 1)});
    }
  return mesh;
}

// Returns `count` contacts evenly around z at this radius, on ground that falls outward by
// `slope_rad`, dragged up the slope.
inline std::vector<libgtd::GripContact> ring_of_contacts(int count, double radius,
                                                         double slope_rad) {
  std::vector<libgtd::GripContact> contacts;
  for (int n = 0; n < count; ++n) {
    const double azimuth = 2.0 * std::numbers::pi * n / count;
    libgtd::GripContact contact;
    contact.finger = static_cast<std::size_t>(n);
    contact.by_spines = true;
    contact.outward = {std::cos(azimuth), std::sin(azimuth), 0.0};
    contact.point = radius * contact.outward;
    const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
    contact.normal = std::cos(slope_rad) * up + std::sin(slope_rad) * contact.outward;
    contact.drag = std::sin(slope_rad) * up - std::cos(slope_rad) * contact.outward;
    contacts.push_back(contact);
  }
  return contacts;
}

}  // namespace grasp_test
