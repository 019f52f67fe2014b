#include "tests/libmap/world/falling_balls.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "libmap/mesh/ray_caster.h"
#include "libmap/mesh/surface_distance.h"
#include "tests/support/test_support.h"

namespace graspmap_test {

std::vector<Eigen::Vector3d> places_above(const libmap::TriangleMesh& mesh, std::size_t count,
                                          double margin_m) {
  const libmap::RayCaster rays(mesh);
  const libmap::Bounds3d bounds = libmap::bounds_of(mesh.vertices);
  std::vector<Eigen::Vector3d> places;
  while (places.size() < count) {
    const Eigen::Vector3d from(uniform(bounds.min.x() + margin_m, bounds.max.x() - margin_m),
                               uniform(bounds.min.y() + margin_m, bounds.max.y() - margin_m),
                               bounds.max.z() + 1.0);
    if (const auto hit = rays.cast(from, -Eigen::Vector3d::UnitZ()))
      places.emplace_back(from - Eigen::Vector3d(0, 0, hit->distance - 0.05));
  }
  return places;
}

void expect_on_surface(const FallenBalls& balls, const libmap::TriangleMesh& surface,
                       double bound_m) {
  const std::vector<double> heights = libmap::distances_to_surface(balls.centers, surface);
  const std::vector<double> contacts = libmap::distances_to_surface(balls.contacts, surface);
  double lowest = 1.0;
  for (std::size_t n = 0; n < balls.centers.size(); ++n) {
    EXPECT_NEAR(heights[n], ball_radius_m, 0.002 + bound_m)
        << n << ": " << balls.centers[n].transpose();
    EXPECT_LT(balls.speeds[n], 0.01) << n << ": " << balls.centers[n].transpose();
    lowest = std::min(lowest, heights[n]);
  }
  for (std::size_t n = 0; n < contacts.size(); ++n)
    EXPECT_LE(contacts[n], 0.002 + bound_m) << balls.contacts[n].transpose();
  EXPECT_GE(balls.contacts.size(), balls.centers.size());
  std::printf("lowest ball %.4f m, farthest contact %.4f m, fastest %.5f m/s\n", lowest,
              *std::max_element(contacts.begin(), contacts.end()),
              *std::max_element(balls.speeds.begin(), balls.speeds.end()));
}

}  // namespace graspmap_test
