#include "libmap/mesh/reference_surface.h"
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "libmap/core/parallel.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace reference_surface_test {

using graspmap_test::ball_mesh;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::square_mesh;
using graspmap_test::uniform;

Eigen::Vector3d random_point(double half) {
  return {uniform(-half, half), uniform(-half, half), uniform(-half, half)};
}

// A closed box from -half to half, normals outwards.
TriangleMesh box_mesh(const Eigen::Vector3d& half) {
  TriangleMesh mesh;
  for (int n = 0; n < 8; ++n)
    mesh.vertices.emplace_back((n & 1 ? 1 : -1) * half.x(), (n & 2 ? 1 : -1) * half.y(),
                               (n & 4 ? 1 : -1) * half.z());
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

double box_distance(const Eigen::Vector3d& point, const Eigen::Vector3d& half) {
  const Eigen::Vector3d beyond = point.cwiseAbs() - half;
  return beyond.cwiseMax(0.0).norm() + std::min(0.0, beyond.maxCoeff());
}

TEST(ReferenceSurface, SignedDistanceOfABoxInClosedForm) {
  for (const Eigen::Vector3d& half :
       {Eigen::Vector3d(0.5, 0.3, 0.2), Eigen::Vector3d(0.5, 0.5, 0.001)}) {
    const ReferenceSurface surface(box_mesh(half));
    EXPECT_TRUE(surface.is_oriented());
    for (int n = 0; n < 2000; ++n) {
      const Eigen::Vector3d point = random_point(1.0);
      const NearestSurfacePoint place = surface.nearest(point);
      ASSERT_NEAR(place.signed_distance_m(point), box_distance(point, half), 1e-12)
          << point.transpose();
      ASSERT_NEAR(place.normal.norm(), 1.0, 1e-12);
      ASSERT_FALSE(place.on_border);
    }
  }
}

// Many points nearest to the tip of a needle are outside the planes of only some of its triangles.
TEST(ReferenceSurface, TipOfANeedleHasItsSides) {
  TriangleMesh needle;
  needle.vertices = {{0, 0, 1}, {0.1, 0, 0}, {-0.05, 0.08, 0}, {-0.05, -0.08, 0}};
  needle.triangles = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}};
  const ReferenceSurface surface(needle);
  for (int n = 0; n < 1000; ++n) {
    const Eigen::Vector3d point =
        Eigen::Vector3d(0, 0, 1) + random_point(0.3).cwiseProduct(Eigen::Vector3d(1, 1, 0.03));
    bool inside = true;
    for (const Triangle& t : needle.triangles)
      inside &= (point - needle.vertices[t[0]]).dot(area_normal(needle, t)) <= 0.0;
    ASSERT_EQ(surface.nearest(point).signed_distance_m(point) < 0.0, inside) << point.transpose();
  }
}

TEST(ReferenceSurface, BordersAreKnown) {
  const ReferenceSurface square(square_mesh(0.0));
  EXPECT_FALSE(square.nearest({0.3, 0.2, 0.5}).on_border);
  EXPECT_FALSE(square.nearest({0.0, 0.0, 0.5}).on_border) << "the diagonal is no border";
  EXPECT_TRUE(square.nearest({1.3, 0.2, 0.5}).on_border);
  EXPECT_TRUE(square.nearest({1.3, -1.2, 0.0}).on_border);
  EXPECT_NEAR(square.nearest({1.3, 0.2, -0.4}).signed_distance_m({1.3, 0.2, -0.4}), -0.5, 1e-12);
}

PointCloud lattice(double spacing_m, bool normals) {
  PointCloud cloud;
  for (int x = -20; x <= 20; ++x)
    for (int y = -20; y <= 20; ++y) {
      cloud.positions.emplace_back(spacing_m * x, spacing_m * y, 0.0);
      if (normals) cloud.normals.emplace_back(0.0F, 0.0F, 0.6F);
    }
  return cloud;
}

TEST(ReferenceSurface, CloudWithNormalsIsASurfaceOfDiscs) {
  const ReferenceSurface surface(lattice(0.01, true));
  EXPECT_TRUE(surface.is_oriented());
  for (int n = 0; n < 500; ++n) {
    const Eigen::Vector3d point(uniform(-0.19, 0.19), uniform(-0.19, 0.19), uniform(-0.1, 0.1));
    const NearestSurfacePoint place = surface.nearest(point);
    ASSERT_NEAR(place.signed_distance_m(point), point.z(), 1e-12) << "gaps do not count";
    ASSERT_FALSE(place.on_border);
  }
  // The last disc extends 2 cm beyond the last point at 0.2 m.
  const NearestSurfacePoint beyond = surface.nearest({0.26, 0.0, -0.03});
  EXPECT_TRUE(beyond.on_border);
  EXPECT_NEAR(beyond.distance_m, std::hypot(0.04, 0.03), 1e-9);
  EXPECT_LT(beyond.signed_distance_m({0.26, 0.0, -0.03}), 0.0);
}

TEST(ReferenceSurface, CloudWithoutNormalsIsItsPoints) {
  PointCloud cloud;
  for (int n = 0; n < 300; ++n) cloud.positions.push_back(random_point(1.0));
  const ReferenceSurface surface(cloud);
  EXPECT_FALSE(surface.is_oriented());
  std::vector<Eigen::Vector3d> places;
  for (int n = 0; n < 200; ++n) places.push_back(random_point(1.5));
  const PointDistances distances = distances_to(surface, places);
  for (std::size_t n = 0; n < places.size(); ++n) {
    double best = 9.0;
    for (const Eigen::Vector3d& point : cloud.positions)
      best = std::min(best, (point - places[n]).norm());
    ASSERT_NEAR(distances.distance_m[n], best, 1e-12);
    ASSERT_EQ(distances.signed_distance_m[n], distances.distance_m[n]);
  }
  // With one zero normal, the surface is not oriented, and that point is a point.
  PointCloud partly = lattice(0.01, true);
  partly.normals[0].setZero();
  EXPECT_FALSE(ReferenceSurface(partly).is_oriented());
  EXPECT_NEAR(ReferenceSurface(partly).nearest({-0.204, -0.203, 0.0}).distance_m, 0.005, 1e-9);
}

TEST(ReferenceSurface, FarFromTheOriginItIsTheSame) {
  const Eigen::Vector3d far(4e5, -3e6, 70);
  TriangleMesh mesh = box_mesh({0.5, 0.3, 0.2});
  for (Eigen::Vector3d& vertex : mesh.vertices) vertex += far;
  const ReferenceSurface surface(mesh);
  for (int n = 0; n < 300; ++n) {
    const Eigen::Vector3d point = random_point(1.0);
    ASSERT_NEAR(surface.nearest(far + point).signed_distance_m(far + point),
                box_distance(point, {0.5, 0.3, 0.2}), 1e-8);
  }
}

TEST(ReferenceSurface, ThreadsMakeNoDifference) {
  const ReferenceSurface surface(ball_mesh(20, 30, {0, 0, 0}));
  std::vector<Eigen::Vector3d> points;
  for (int n = 0; n < 20000; ++n) points.push_back(random_point(2.0));
  std::vector<double> first;
  for (const unsigned threads : {1U, 4U}) {
    const ThreadLimit limit(threads);
    const PointDistances distances = distances_to(surface, points);
    if (first.empty()) first = distances.signed_distance_m;
    EXPECT_EQ(distances.signed_distance_m, first);
  }
}

TEST(ReferenceSurface, WhatIsNoSurface) {
  EXPECT_TRUE(is_error(error_of([] { ReferenceSurface(TriangleMesh{}); }),
                       {.field = "triangles of the mesh"}));
  EXPECT_TRUE(
      is_error(error_of([] { ReferenceSurface(PointCloud{}); }), {.field = "points of the cloud"}));
  PointCloud cloud;
  cloud.positions = {{0, 0, 0}, {0, 0, std::numeric_limits<double>::infinity()}};
  EXPECT_TRUE(is_error(error_of([&] { ReferenceSurface{cloud}; }), {.field = "points"}));
  cloud.positions.pop_back();
  EXPECT_NEAR(ReferenceSurface(cloud).nearest({3, 4, 0}).distance_m, 5.0, 1e-12);
}

}  // namespace reference_surface_test
}  // namespace libmap
