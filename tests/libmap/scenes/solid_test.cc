// Solids against closed-form volumes and areas.
#include "libmap/scenes/solid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "mesh_topology.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace solid_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::Topology;
using graspmap_test::topology_of;
using graspmap_test::uniform;

TriangleMesh mesh_of(const Solid& solid) {
  TriangleMesh mesh;
  mesh.vertices = solid.vertices;
  mesh.triangles = solid.triangles;
  return mesh;
}

double volume(const Solid& solid) { return signed_volume(mesh_of(solid)); }
double area(const Solid& solid) { return surface_area(mesh_of(solid)); }

testing::AssertionResult is_closed_ball(const Solid& solid) {
  const Topology topology = topology_of(solid.vertices.size(), solid.triangles);
  if (topology.open_edges == 0 && topology.bad_edges == 0 && topology.unused_vertices == 0 &&
      topology.parts == 1 && topology.euler == 2 && solid.labels.size() == solid.triangles.size())
    return testing::AssertionSuccess();
  return testing::AssertionFailure()
         << topology.open_edges << " open edges, " << topology.bad_edges << " bad ones, "
         << topology.unused_vertices << " vertices of no triangle, " << topology.parts
         << " parts, Euler characteristic " << topology.euler;
}

Solid box(const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  std::vector<HalfSpace> planes;
  for (int axis = 0; axis < 3; ++axis) {
    planes.push_back({Eigen::Vector3d::Unit(axis), high[axis]});
    planes.push_back({-Eigen::Vector3d::Unit(axis), -low[axis]});
  }
  return convex_solid(planes, 10.0);
}

TEST(ConvexSolid, IsWhatItsHalfSpacesHaveInCommon) {
  const Solid cube = box({-1.0, -1.0, -1.0}, {1.0, 2.0, 3.0});
  EXPECT_TRUE(is_closed_ball(cube));
  EXPECT_NEAR(volume(cube), 2.0 * 3.0 * 4.0, 1e-12);
  EXPECT_EQ(std::set<int>(cube.labels.begin(), cube.labels.end()).size(), 6U);
}

TEST(ConvexSolid, RandomOnesKeepToTheirPlanes) {
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<HalfSpace> planes;
    for (int n = 0; n < 20; ++n)
      planes.push_back(
          {Eigen::Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)).normalized(),
           uniform(0.5, 1.0)});
    for (int axis = 0; axis < 3; ++axis) {
      planes.push_back({Eigen::Vector3d::Unit(axis), 1.1});
      planes.push_back({-Eigen::Vector3d::Unit(axis), 1.2});
    }
    const Solid solid = convex_solid(planes, 10.0);
    ASSERT_TRUE(is_closed_ball(solid));
    for (const Eigen::Vector3d& vertex : solid.vertices)
      for (const HalfSpace& plane : planes)
        ASSERT_LE(plane.normal.dot(vertex), plane.offset_m + 1e-9);
    for (std::size_t n = 0; n < solid.triangles.size(); ++n) {
      const HalfSpace& plane = planes[static_cast<std::size_t>(solid.labels[n])];
      for (const std::uint32_t vertex : solid.triangles[n])
        ASSERT_NEAR(plane.normal.dot(solid.vertices[vertex]), plane.offset_m, 1e-9);
    }
    EXPECT_GT(volume(solid), 4.0 / 3.0 * M_PI * 0.125);  // the ball of radius 0.5 lies within
  }
}

TEST(ConvexSolid, NothingOrTooMuchIsAnError) {
  EXPECT_TRUE(is_error(
      error_of([] {
        convex_solid({{Eigen::Vector3d::UnitX(), -2.0}, {-Eigen::Vector3d::UnitX(), 1.0}}, 10.0);
      }),
      {.field = "half-spaces"}));
  EXPECT_TRUE(is_error(error_of([] {
                         convex_solid({{Eigen::Vector3d::UnitX(), 1.0}}, 10.0);
                       }),
                       {.about = "10 m"}));
}

TEST(EllipsoidSolid, HasTheVolumeOfAnEllipsoid) {
  const Solid solid = ellipsoid_solid({0.3, 0.2, 0.1}, 0.01);
  EXPECT_TRUE(is_closed_ball(solid));
  EXPECT_NEAR(volume(solid), 4.0 / 3.0 * M_PI * 0.006, 4e-5);
  for (const Eigen::Vector3d& v : solid.vertices)
    EXPECT_NEAR(v.cwiseQuotient(Eigen::Vector3d(0.3, 0.2, 0.1)).norm(), 1.0, 1e-12);
}

TEST(BlockSolid, IsTheGroundUnderItsHeights) {
  HeightGrid grid;
  grid.size_x_m = 2.0;
  grid.size_y_m = 1.0;
  grid.columns = 5;
  grid.rows = 4;
  for (std::size_t row = 0; row < grid.rows; ++row)
    for (std::size_t column = 0; column < grid.columns; ++column)
      grid.heights_m.push_back(0.1 * grid.at(column, row).x() + 0.2 * grid.at(column, row).y());
  const Solid solid = block_solid(grid, -1.0);
  EXPECT_TRUE(is_closed_ball(solid));
  EXPECT_NEAR(volume(solid), 2.0, 1e-12);  // a sloping top, 1 m above the base in the middle
}

TEST(RefineFacets, KeepsShapeAndLabelsAndMakesTrianglesEven) {
  const Solid coarse = box({0.0, 0.0, 0.0}, {0.5, 0.4, 0.3});
  const Solid fine = refine_facets(coarse, 0.02);
  EXPECT_TRUE(is_closed_ball(fine));
  EXPECT_NEAR(volume(fine), 0.06, 1e-12);
  EXPECT_NEAR(area(fine), area(coarse), 1e-12);
  EXPECT_EQ(std::set<int>(fine.labels.begin(), fine.labels.end()).size(), 6U);
  double longest = 0.0;
  double shortest = 1.0;
  for (const Triangle& t : fine.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const double length = (fine.vertices[t[k]] - fine.vertices[t[(k + 1) % 3]]).norm();
      longest = std::max(longest, length);
      shortest = std::min(shortest, length);
    }
  }
  EXPECT_LT(longest, 2.0 * 0.02);
  EXPECT_GT(shortest, 0.3 * 0.02);
}

TEST(RefineFacets, KeepsHolesInAFacet) {
  // A box with a square hole through it: its top and bottom are rings.
  Solid hole = box({0.3, 0.31, -0.2}, {0.7, 0.72, 0.8});
  for (int& label : hole.labels) label += 100;
  const Solid ring = subtract(box({0.0, 0.0, 0.0}, {1.0, 1.0, 0.5}), hole);
  const Solid fine = refine_facets(ring, 0.05);
  const Topology topology = topology_of(fine.vertices.size(), fine.triangles);
  EXPECT_EQ(topology.open_edges, 0U);
  EXPECT_EQ(topology.euler, 0);  // a torus
  EXPECT_NEAR(volume(fine), 0.5 * (1.0 - 0.4 * 0.41), 1e-12);
}

// A box with three walls of one label: edges of the first and the last wall overlap in projection.
TEST(RefineFacets, ARegionThatIsNotFlatIsAnError) {
  Solid solid = box({0.0, 0.0, 0.0}, {1.0, 1.0, 1.0});
  for (int& label : solid.labels)
    if (label == 1 || label == 3) label = 0;
  EXPECT_TRUE(is_error(error_of([&] { refine_facets(solid, 0.5); }), {.field = "corners"}));
}

TEST(Booleans, FollowInclusionAndExclusion) {
  Solid a = box({0.0, 0.0, 0.0}, {1.0, 1.0, 1.0});
  Solid b = box({0.51, 0.52, 0.53}, {1.5, 1.5, 1.5});
  std::fill(a.labels.begin(), a.labels.end(), 1);
  std::fill(b.labels.begin(), b.labels.end(), 2);
  const double common = 0.49 * 0.48 * 0.47;
  const Solid both = unite({a, b});
  EXPECT_TRUE(is_closed_ball(both));
  EXPECT_NEAR(volume(both), 1.0 + 0.99 * 0.98 * 0.97 - common, 1e-12);
  const Solid rest = subtract(a, b);
  EXPECT_TRUE(is_closed_ball(rest));
  EXPECT_NEAR(volume(rest), 1.0 - common, 1e-12);
  // Each triangle keeps the label of the face that it is part of.
  for (std::size_t n = 0; n < both.triangles.size(); ++n) {
    const Eigen::Vector3d center =
        (both.vertices[both.triangles[n][0]] + both.vertices[both.triangles[n][1]] +
         both.vertices[both.triangles[n][2]]) /
        3.0;
    const double to_a = (center - Eigen::Vector3d::Constant(0.5)).cwiseAbs().maxCoeff();
    EXPECT_EQ(both.labels[n], std::abs(to_a - 0.5) < 1e-9 ? 1 : 2);
  }
}

TEST(Booleans, ManyAtOnceWithAndWithoutOverlap) {
  // A row of boxes on a plate: the second and third overlap.
  std::vector<Solid> solids = {
      box({-2.0, -1.0, -0.5}, {2.0, 1.0, 0.0}), box({-1.5, -0.3, -0.1}, {-0.9, 0.3, 0.4}),
      box({-0.3, -0.31, -0.11}, {0.3, 0.3, 0.41}), box({0.1, -0.2, -0.12}, {0.9, 0.25, 0.3})};
  const Solid all = unite(solids);
  EXPECT_TRUE(is_closed_ball(all));
  const double above = 0.6 * 0.6 * 0.4 + 0.6 * 0.61 * 0.41 + 0.8 * 0.45 * 0.3 - 0.2 * 0.45 * 0.3;
  EXPECT_NEAR(volume(all), 4.0 + above, 1e-12);
}

TEST(Booleans, TouchingSolidsAreAnErrorOrAManifold) {
  // Two boxes that share one edge alone have no manifold union.
  const Solid a = box({0.0, 0.0, 0.0}, {1.0, 1.0, 1.0});
  const Solid b = box({1.0, 1.0, 0.0}, {2.0, 2.0, 1.0});
  EXPECT_TRUE(is_error(error_of([&] { unite({a, b}); }), {.field = "union"}));
  // A box without two opposite quarters is not a manifold, either.
  const Solid rest = subtract(a, box({-1.0, -1.0, -1.0}, {0.5, 0.5, 2.0}));
  EXPECT_TRUE(is_error(error_of([&] {
                         subtract(rest, box({0.5, 0.5, -1.0}, {2.0, 2.0, 2.0}));
                       }),
                       {.field = "difference of two solids"}));
}

TEST(Booleans, SplintersGoWithoutMovingTheSurface) {
  // The second box cuts the first just beside its corners.
  const Solid a = refine_facets(box({0.0, 0.0, 0.0}, {1.0, 1.0, 1.0}), 0.1);
  const Solid b = refine_facets(box({0.2003, 0.3001, 0.5}, {0.6002, 0.7004, 1.5}), 0.1);
  const auto shortest = [](const Solid& solid) {
    double length = 1.0;
    for (const Triangle& t : solid.triangles)
      for (std::size_t k = 0; k < 3; ++k)
        length = std::min(length, (solid.vertices[t[k]] - solid.vertices[t[(k + 1) % 3]]).norm());
    return length;
  };
  const Solid plain = unite({a, b});
  const Solid clean = unite({a, b}, 0.002);
  EXPECT_TRUE(is_closed_ball(clean));
  EXPECT_LT(shortest(plain), 0.002);
  EXPECT_LT(clean.triangles.size(), plain.triangles.size());
  EXPECT_NEAR(volume(clean), volume(plain), 1e-3);
  EXPECT_EQ(graspmap_test::self_intersections(clean.vertices, clean.triangles), 0U);
}

}  // namespace solid_test
}  // namespace libmap
