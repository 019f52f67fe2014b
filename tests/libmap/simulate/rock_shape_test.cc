// All rock shapes are closed solids of the requested size.
#include "libmap/simulate/site_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/libmap/scenes/mesh_topology.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace rock_shape_test {

using graspmap_test::Topology;
using graspmap_test::topology_of;

struct Extent {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e9);
  Eigen::Vector3d high = Eigen::Vector3d::Constant(-1e9);
};

// Bounding box of the surface above the ground, cut at z = 0.
Extent extent_above_ground(const Solid& solid) {
  Extent extent;
  for (const Eigen::Vector3d& vertex : solid.vertices) {
    if (vertex.z() < 0.0) continue;
    extent.low = extent.low.cwiseMin(vertex);
    extent.high = extent.high.cwiseMax(vertex);
  }
  return extent;
}

class RockShapes : public testing::TestWithParam<RockShape> {};

TEST_P(RockShapes, AreClosedAndOfTheirSize) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const double height = is_hold(GetParam()) ? 0.05 : 0.3;
    SiteRock rock = draw_rock(GetParam(), height, seed);
    const double edge = 0.07 * height;
    const Solid solid = rock_solid(rock, edge, 0.1);
    const Topology topology = topology_of(solid.vertices.size(), solid.triangles);
    EXPECT_EQ(topology.open_edges, 0U) << seed;
    EXPECT_EQ(topology.bad_edges, 0U) << seed;
    EXPECT_EQ(topology.parts, 1U) << seed;
    EXPECT_EQ(topology.euler, 2) << seed;
    EXPECT_EQ(graspmap_test::self_intersections(solid.vertices, solid.triangles), 0U) << seed;
    const Extent extent = extent_above_ground(solid);
    EXPECT_NEAR(extent.high.z(), rock.height_m, 1e-12) << seed;
    EXPECT_NEAR(extent.high.x() - extent.low.x(), rock.width_m, 1e-12) << seed;
    EXPECT_NEAR(extent.high.y() - extent.low.y(), rock.depth_m, 1e-12) << seed;
    EXPECT_NEAR(extent.high.x() + extent.low.x(), 0.0, 1e-12) << seed;
    TriangleMesh mesh;
    mesh.vertices = solid.vertices;
    mesh.triangles = solid.triangles;
    EXPECT_GT(signed_volume(mesh), 0.1 * rock.width_m * rock.depth_m * rock.height_m) << seed;
    // The rock extends into the ground.
    double lowest = 0.0;
    for (const Eigen::Vector3d& vertex : solid.vertices) lowest = std::min(lowest, vertex.z());
    EXPECT_LT(lowest, -0.1 * height) << seed;
  }
}

INSTANTIATE_TEST_SUITE_P(All, RockShapes,
                         testing::Values(RockShape::block, RockShape::cobble, RockShape::dome,
                                         RockShape::jug, RockShape::sloper, RockShape::crimp,
                                         RockShape::pinch),
                         [](const auto& test) {
                           for (const auto& [name, shape] : rock_shape_names())
                             if (shape == test.param) return name;
                           return std::string();
                         });

SiteRock plain_block() {
  SiteRock rock;
  rock.height_m = 0.5;
  rock.width_m = 0.6;
  rock.depth_m = 0.5;
  rock.roughness = 0.0;
  rock.seed = 5;
  return rock;
}

double largest_fraction_down(const SiteRock& rock) {
  // Area of walls above the ground that face down by more than 5 degrees.
  const Solid solid = rock_solid(rock, 0.02, 0.15);
  double down = 0.0;
  double all = 0.0;
  for (const Triangle& t : solid.triangles) {
    const Eigen::Vector3d a = solid.vertices[t[0]];
    const Eigen::Vector3d normal = (solid.vertices[t[1]] - a).cross(solid.vertices[t[2]] - a);
    if (a.z() < 0.05) continue;
    all += normal.norm();
    if (normal.normalized().z() < -0.087) down += normal.norm();
  }
  return down / all;
}

TEST(RockShape, OverhangsFaceDown) {
  SiteRock rock = plain_block();
  EXPECT_EQ(largest_fraction_down(rock), 0.0);
  rock.overhang_deg = 20.0;
  EXPECT_GT(largest_fraction_down(rock), 0.08);
}

TEST(RockShape, AClefTakesAWedgeOutOfTheTop) {
  SiteRock rock = plain_block();
  const auto volume = [](const SiteRock& one) {
    const Solid solid = rock_solid(one, 0.02, 0.15);
    TriangleMesh mesh;
    mesh.vertices = solid.vertices;
    mesh.triangles = solid.triangles;
    return signed_volume(mesh);
  };
  const double whole = volume(rock);
  rock.cleft_m = 0.2;
  const double cleft = volume(rock);
  EXPECT_LT(cleft, whole - 5e-4);
  EXPECT_GT(cleft, 0.7 * whole);
}

// CGAL's own order follows addresses in memory, which differ from one time to the next.
TEST(RockShape, IsTheSameEachTime) {
  for (std::uint64_t seed = 50; seed < 60; ++seed) {
    SiteRock rock = draw_rock(RockShape::block, 0.4, seed);
    rock.ledges = 2;
    rock.cleft_m = 0.1;
    const Solid first = rock_solid(rock, 0.04, 0.1);
    std::vector<Solid> kept;  // keeps memory in use, so that the next one lies elsewhere
    for (int trial = 0; trial < 10; ++trial) {
      kept.push_back(rock_solid(rock, 0.04, 0.1));
      ASSERT_EQ(kept.back().vertices, first.vertices) << seed;
      ASSERT_EQ(kept.back().triangles, first.triangles) << seed;
    }
  }
}

TEST(RockShape, FlatTopsAreFlat) {
  // The largest group of upward triangles agrees to within the top's slope of four degrees.
  const Solid solid = rock_solid(plain_block(), 0.02, 0.15);
  double flat = 0.0;
  for (const Triangle& t : solid.triangles) {
    const Eigen::Vector3d a = solid.vertices[t[0]];
    const Eigen::Vector3d normal = (solid.vertices[t[1]] - a).cross(solid.vertices[t[2]] - a);
    if (a.z() > 0.3 && normal.normalized().z() > std::cos(6.0 * M_PI / 180.0))
      flat += 0.5 * normal.norm();
  }
  EXPECT_GT(flat, 0.15 * 0.6 * 0.5);
}

}  // namespace rock_shape_test
}  // namespace libmap
