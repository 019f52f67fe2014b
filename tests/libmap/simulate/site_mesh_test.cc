// Site meshes are closed, without self-intersections, and have rocks of given position and height.
#include "libmap/simulate/site_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "libmap/core/parallel.h"
#include "libmap/simulate/rock_site.h"
#include "tests/libmap/scenes/mesh_topology.h"
#include "tests/libmap/scenes/scene_test_support.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace site_mesh_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::self_intersections;
using graspmap_test::shipped_site;
using graspmap_test::Topology;
using graspmap_test::topology_of;

RockSite small_site() {
  return parse_site(
      "seed: 4\n"
      "ground: {size_x_m: 1.4, size_y_m: 1.2, relief_m: 0.02}\n"
      "layout: {site_size_m: 1.1, free_square_m: 0}\n"
      "rocks:\n"
      "  - {height_m: 0.3, width_m: 0.35, depth_m: 0.3, x_m: -0.2, y_m: 0.1, overhang_deg: 15,"
      " ledges: 1, cleft_m: 0.1}\n"
      "  - {height_m: 0.25, width_m: 0.3, depth_m: 0.3, x_m: 0.07, y_m: 0.15, ledges: 0}\n"
      "  - {shape: cobble, height_m: 0.12, x_m: 0.4, y_m: -0.2}\n",
      "small.yaml");
}

Topology topology(const TriangleMesh& mesh) {
  return topology_of(mesh.vertices.size(), mesh.triangles);
}

TEST(SiteMesh, ClosedIsTheSurfaceOfOneSolid) {
  // Two of the rocks overlap.
  const TriangleMesh mesh = site_mesh(small_site(), {.edge_length_m = 0.015, .closed = true});
  mesh.check();
  const Topology found = topology(mesh);
  EXPECT_EQ(found.open_edges, 0U);
  EXPECT_EQ(found.bad_edges, 0U);
  EXPECT_EQ(found.unused_vertices, 0U);
  EXPECT_EQ(found.parts, 1U);
  EXPECT_EQ(found.euler % 2, 0);
  EXPECT_LE(found.euler, 2);
  EXPECT_EQ(self_intersections(mesh.vertices, mesh.triangles), 0U);
  // The block alone, its base 0.4 + 0.3 m below the lowest ground, and some rock.
  const double volume = signed_volume(mesh);
  EXPECT_GT(volume, 1.4 * 1.2 * 0.7 + 0.02);
  EXPECT_LT(volume, 1.4 * 1.2 * 0.75 + 0.35 * 0.3 * 0.3 + 0.3 * 0.3 * 0.25 + 0.01);
}

TEST(SiteMesh, OpenIsADiscWithTheGroundsOutline) {
  const TriangleMesh mesh = site_mesh(small_site(), {.edge_length_m = 0.015});
  const Topology found = topology(mesh);
  EXPECT_EQ(found.bad_edges, 0U);
  EXPECT_EQ(found.parts, 1U);
  EXPECT_EQ(found.unused_vertices, 0U);
  // 1.4 / 0.015 and 1.2 / 0.015 steps along the sides, and nowhere else.
  EXPECT_EQ(found.open_edges, 2U * (94U + 80U));
  const Bounds3d bounds = bounds_of(mesh.vertices);
  EXPECT_NEAR(bounds.max.x() - bounds.min.x(), 1.4, 1e-12);
  EXPECT_NEAR(bounds.max.y() - bounds.min.y(), 1.2, 1e-12);
  EXPECT_GT(bounds.min.z(), -0.025);
}

// Highest vertex of each rock above the ground at its foot.
std::map<int, double> rock_heights(const RockSite& site, const TriangleMesh& mesh) {
  const GroundRelief relief(site);
  std::map<int, double> heights;
  for (std::size_t n = 0; n < mesh.triangles.size(); ++n) {
    const int number = static_cast<int>(mesh.face_fields[0].values[n]);
    if (number == 0) continue;
    const SiteRock& rock = site.rocks[static_cast<std::size_t>(number) - 1];
    for (const std::uint32_t vertex : mesh.triangles[n])
      heights[number] =
          std::max(heights[number], mesh.vertices[vertex].z() - relief.height(rock.x_m, rock.y_m));
  }
  return heights;
}

TEST(SiteMesh, HasNoSplintersThatSinglePrecisionFlattens) {
  const TriangleMesh mesh = site_mesh(shipped_site("rocks.yaml"), {.edge_length_m = 0.012});
  for (const Triangle& triangle : mesh.triangles) {
    TriangleMesh rounded;
    for (const std::uint32_t vertex : triangle)
      rounded.vertices.emplace_back(mesh.vertices[vertex].cast<float>().cast<double>());
    ASSERT_GT(area_normal(rounded, {0, 1, 2}).norm(), 1e-13);
  }
}

TEST(SiteMesh, TheThesissRocks) {
  const RockSite site = shipped_site("rocks.yaml");
  ASSERT_EQ(site.rocks.size(), 12U);
  const TriangleMesh mesh = site_mesh(site, {.edge_length_m = 0.025});
  const std::map<int, double> heights = rock_heights(site, mesh);
  ASSERT_EQ(heights.size(), 12U);
  double lowest = 1.0;
  double highest = 0.0;
  for (int n = 1; n <= 12; ++n) {
    EXPECT_NEAR(heights.at(n), site.rocks[static_cast<std::size_t>(n) - 1].height_m, 1e-3);
    if (n > 10) {
      EXPECT_NEAR(heights.at(n), 0.15, 1e-3);
      continue;
    }
    lowest = std::min(lowest, heights.at(n));
    highest = std::max(highest, heights.at(n));
  }
  EXPECT_NEAR(lowest, 0.20, 1e-3);
  EXPECT_NEAR(highest, 0.67, 1e-3);
  // The free square is ground alone, and rocks keep within 3 x 3 m.
  for (std::size_t n = 0; n < mesh.triangles.size(); ++n) {
    for (const std::uint32_t vertex : mesh.triangles[n]) {
      const double out = mesh.vertices[vertex].head<2>().cwiseAbs().maxCoeff();
      if (mesh.face_fields[0].values[n] == 0.0) {
        EXPECT_LT(std::abs(mesh.vertices[vertex].z()), 0.03);
      } else {
        EXPECT_GT(out, 0.75 - 0.01);
        EXPECT_LT(out, 1.5 + 0.01);
      }
    }
  }
}

TEST(SiteMesh, AClimbingWallStandsUp) {
  const RockSite site = shipped_site("bouldering_wall.yaml");
  EXPECT_EQ(site.rocks.size(), 58U);
  const TriangleMesh mesh = site_mesh(site, {.edge_length_m = 0.03});
  const Bounds3d bounds = bounds_of(mesh.vertices);
  const double tilt = 95.0 * M_PI / 180.0;
  EXPECT_NEAR(bounds.max.z() - bounds.min.z(), 3.2 * std::sin(tilt), 0.03);
  // Overhanging: the top is nearer to -y than the foot.
  std::map<int, std::size_t> triangles;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  for (std::size_t n = 0; n < mesh.triangles.size(); ++n) {
    ++triangles[static_cast<int>(mesh.face_fields[0].values[n])];
    if (mesh.face_fields[0].values[n] == 0.0) normal += area_normal(mesh, mesh.triangles[n]);
  }
  EXPECT_EQ(triangles.size(), 59U);
  EXPECT_NEAR(normal.normalized().dot(Eigen::Vector3d(0.0, -std::sin(tilt), std::cos(tilt))), 1.0,
              1e-3);
}

TEST(SiteMesh, SlopesAndBumps) {
  const RockSite site = shipped_site("slopes_and_bumps.yaml");
  const TriangleMesh mesh = site_mesh(site, {.edge_length_m = 0.04});
  EXPECT_EQ(topology(mesh).bad_edges, 0U);
  const GroundRelief relief(site);
  // A floor below its surroundings, corners above them.
  EXPECT_LT(relief.height(0.3, -0.1), -0.4);
  EXPECT_GT(relief.height(-2.7, 2.1), 0.4);
  EXPECT_GT(relief.height(2.7, -2.1), 0.3);
}

TEST(SiteMesh, SameBytesForAnyNumberOfThreadsAndOtherOnesForAnotherSeed) {
  const auto mesh_of = [](unsigned threads) {
    const ThreadLimit limit(threads);
    return site_mesh(small_site(), {.edge_length_m = 0.03});
  };
  const TriangleMesh one = mesh_of(1);
  const TriangleMesh four = mesh_of(4);
  EXPECT_EQ(one.vertices, four.vertices);
  EXPECT_EQ(one.triangles, four.triangles);
  EXPECT_EQ(one.vertex_colors, four.vertex_colors);
  const RockSite first = shipped_site("rocks.yaml", 1);
  const RockSite second = shipped_site("rocks.yaml", 2);
  EXPECT_NE(first.rocks[0].x_m, second.rocks[0].x_m);
  EXPECT_NE(first.rocks[0].seed, second.rocks[0].seed);
}

TEST(SiteMesh, EverySeedGivesASite) {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const RockSite site = shipped_site("rocks.yaml", seed);
    EXPECT_EQ(site.rocks.size(), 12U);
  }
  for (std::uint64_t seed = 30; seed < 33; ++seed) {
    const TriangleMesh mesh =
        site_mesh(shipped_site("rocks.yaml", seed), {.edge_length_m = 0.03, .closed = true});
    const Topology found = topology(mesh);
    EXPECT_EQ(found.open_edges + found.bad_edges, 0U) << seed;
    EXPECT_EQ(found.parts, 1U) << seed;
    EXPECT_EQ(self_intersections(mesh.vertices, mesh.triangles), 0U) << seed;
  }
}

// On the top of a bump that the ground's triangles miss.
TEST(SiteMesh, ARockInTheAirIsAnError) {
  RockSite site = parse_site(
      "ground: {relief_m: 0}\n"
      "bumps: [{x_m: 0.4, y_m: 0.4, height_m: 1, radius_m: 0.25}]\n"
      "rocks: [{height_m: 0.1, width_m: 0.1, depth_m: 0.1, x_m: 0.4, y_m: 0.4, ledges: 0,"
      " cleft_m: 0, overhang_deg: 0}]\n",
      "bump.yaml");
  EXPECT_TRUE(
      is_error(error_of([&] { site_mesh(site, {.edge_length_m = 1.0}); }), {.field = "rocks[0]"}));
  site.rocks[0].name = "boulder";
  EXPECT_TRUE(is_error(error_of([&] { site_mesh(site, {.edge_length_m = 1.0}); }),
                       {.field = "rocks[0] (boulder)"}));
  EXPECT_NO_THROW(site_mesh(site, {.edge_length_m = 0.05}));
}

TEST(SiteMesh, BadOptionsAreErrors) {
  RockSite site = small_site();
  EXPECT_TRUE(is_error(error_of([&] { site_mesh(site, {.edge_length_m = 1e-4}); }),
                       {.field = "edge_length_m", .value = "1e-04"}));
  site.rocks[1].x_m = 0.6;
  EXPECT_NE(error_of([&] { site_mesh(site, {}); }).context().field.find("rocks[1]"),
            std::string::npos);
}

}  // namespace site_mesh_test
}  // namespace libmap
