#include "libmap/mesh/ray_caster.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "libmap/core/parallel.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/support/lower_limit.h"
#include "tests/support/sanitizers.h"
#include "tests/support/test_support.h"

namespace ray_caster_test {

using graspmap_test::ball_mesh;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::square_mesh;
using graspmap_test::uniform;
using libmap::RayCaster;
using libmap::RayHit;
using libmap::TriangleMesh;

Eigen::Vector3d random_vector(double size) {
  return {uniform(-size, size), uniform(-size, size), uniform(-size, size)};
}

TriangleMesh random_triangles(int count, double edge) {
  TriangleMesh mesh;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d at = random_vector(1.0);
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (int k = 0; k < 3; ++k) mesh.vertices.push_back(at + random_vector(edge));
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

// Brute force by Moeller and Trumbore 1997 in double precision.
std::optional<RayHit> cast_slowly(const TriangleMesh& mesh, const Eigen::Vector3d& origin,
                                  const Eigen::Vector3d& direction, double near, double far) {
  std::optional<RayHit> best;
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    const Eigen::Vector3d& a = mesh.vertices[mesh.triangles[i][0]];
    const Eigen::Vector3d e1 = mesh.vertices[mesh.triangles[i][1]] - a;
    const Eigen::Vector3d e2 = mesh.vertices[mesh.triangles[i][2]] - a;
    const Eigen::Vector3d p = direction.cross(e2);
    const double determinant = e1.dot(p);
    if (determinant == 0) continue;
    const Eigen::Vector3d s = origin - a;
    const double u = s.dot(p) / determinant;
    const Eigen::Vector3d q = s.cross(e1);
    const double v = direction.dot(q) / determinant;
    const double t = e2.dot(q) / determinant;
    if (u < 0 || v < 0 || u + v > 1 || t < near || t > far) continue;
    if (!best || t < best->distance) best = RayHit{t, i, u, v};
  }
  return best;
}

Eigen::Vector3d point_of(const TriangleMesh& mesh, const RayHit& hit) {
  const auto& t = mesh.triangles[hit.triangle];
  return (1 - hit.u - hit.v) * mesh.vertices[t[0]] + hit.u * mesh.vertices[t[1]] +
         hit.v * mesh.vertices[t[2]];
}

TEST(RayCaster, MeetsAPlaneWhereTheEquationSays) {
  const TriangleMesh mesh = square_mesh(0.3);
  const RayCaster caster(mesh);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d origin(uniform(-3, 3), uniform(-3, 3), uniform(0.5, 3));
    const Eigen::Vector3d target(uniform(-1, 1), uniform(-1, 1), 0.3);
    const double length = uniform(0.1, 10.0);
    const Eigen::Vector3d direction = (target - origin).normalized() * length;
    const auto hit = caster.cast(origin, direction);
    ASSERT_TRUE(hit);
    EXPECT_NEAR(hit->distance * length, (target - origin).norm(), 1e-12);
    EXPECT_LT((point_of(mesh, *hit) - target).norm(), 1e-6);
  }
}

TEST(RayCaster, SeesBothSidesAndHonoursNearAndFar) {
  const RayCaster caster(square_mesh(0.0));
  const Eigen::Vector3d down(0, 0, -2);
  EXPECT_DOUBLE_EQ(caster.cast({0.1, 0.2, 1}, down)->distance, 0.5);
  EXPECT_DOUBLE_EQ(caster.cast({0.1, 0.2, -1}, -down)->distance, 0.5);
  EXPECT_FALSE(caster.cast({0.1, 0.2, 1}, down, 0.0, 0.49));
  EXPECT_TRUE(caster.cast({0.1, 0.2, 1}, down, 0.0, 0.51));
  EXPECT_FALSE(caster.cast({0.1, 0.2, 1}, down, 0.51));
  EXPECT_TRUE(caster.cast({0.1, 0.2, 1}, down, 0.49));
  EXPECT_FALSE(caster.cast({0.1, 0.2, 1}, -down));
  EXPECT_FALSE(caster.cast({3, 0, 1}, down));
}

TEST(RayCaster, NoRayPassesBetweenTrianglesOfAClosedBall) {
  const TriangleMesh mesh = ball_mesh(40, 80, {0.3, -0.2, 7.0});
  const RayCaster caster(mesh);
  const Eigen::Vector3d inside(0.3, -0.2, 7.0);
  std::vector<Eigen::Vector3d> directions;
  // Rays at vertices, at midpoints of edges, and at random points.
  for (const auto& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d& a = mesh.vertices[t[static_cast<std::size_t>(k)]];
      const Eigen::Vector3d& b = mesh.vertices[t[static_cast<std::size_t>((k + 1) % 3)]];
      directions.push_back(a - inside);
      directions.push_back((a + b) / 2 - inside);
    }
  for (int i = 0; i < 20000; ++i) directions.push_back(random_vector(1.0));
  std::vector<RayHit> hits(directions.size());
  caster.cast_bundle(inside, directions, hits);
  for (std::size_t i = 0; i < directions.size(); ++i) {
    ASSERT_NE(hits[i].triangle, RayHit::no_triangle) << directions[i].transpose();
    const double range = hits[i].distance * directions[i].norm();
    EXPECT_LE(range, 1.0 + 1e-6);
    EXPECT_GE(range, std::cos(std::numbers::pi / 40) * std::cos(std::numbers::pi / 80) - 1e-6);
    ASSERT_TRUE(caster.cast(inside, directions[i]));
  }
}

TEST(RayCaster, AgreesWithTestingEveryTriangle) {
  const TriangleMesh mesh = random_triangles(300, 0.4);
  const RayCaster caster(mesh);
  int hits = 0;
  for (int i = 0; i < 5000; ++i) {
    const Eigen::Vector3d origin = random_vector(2.0);
    const Eigen::Vector3d direction = random_vector(1.0);
    const double near = uniform(0.0, 0.5);
    const double far = uniform(near, 5.0);
    const auto slow = cast_slowly(mesh, origin, direction, near, far);
    const auto fast = caster.cast(origin, direction, near, far);
    if (slow && fast && slow->triangle == fast->triangle) {
      ++hits;
      EXPECT_NEAR(slow->distance, fast->distance, 1e-9);
      EXPECT_NEAR(slow->u, fast->u, 1e-6);
      EXPECT_NEAR(slow->v, fast->v, 1e-6);
      continue;
    }
    if (!slow && !fast) continue;
    // Results may differ only if the ray is within single precision of an edge or a limit.
    const RayHit& odd = fast ? *fast : *slow;
    const double margin =
        std::min({odd.u, odd.v, 1 - odd.u - odd.v, odd.distance - near, far - odd.distance});
    EXPECT_LT(margin, 1e-5) << "ray " << i;
  }
  EXPECT_GT(hits, 500);
}

TEST(RayCaster, ABundleIsItsRaysOneByOne) {
  const TriangleMesh mesh = random_triangles(500, 0.3);
  const RayCaster caster(mesh);
  for (const std::size_t count : {0UL, 1UL, 7UL, 8UL, 9UL, 1001UL}) {
    const Eigen::Vector3d origin = random_vector(2.0);
    std::vector<Eigen::Vector3d> directions;
    for (std::size_t i = 0; i < count; ++i) directions.push_back(random_vector(1.0));
    if (count > 8) directions[3] = Eigen::Vector3d::Zero();
    std::vector<RayHit> hits(count);
    caster.cast_bundle(origin, directions, hits, 0.1, 4.0);
    for (std::size_t i = 0; i < count; ++i) {
      const auto one = caster.cast(origin, directions[i], 0.1, 4.0);
      ASSERT_EQ(one.has_value(), hits[i].triangle != RayHit::no_triangle);
      if (!one) continue;
      EXPECT_EQ(one->triangle, hits[i].triangle);
      EXPECT_NEAR(one->distance, hits[i].distance, 1e-9);
    }
  }
}

TEST(RayCaster, FarFromTheOriginAndFromTheMeshItIsAsExact) {
  // Map coordinates of 500 km, seen from 10 km above.
  TriangleMesh mesh = square_mesh(0.0);
  const Eigen::Vector3d place(500000, 4000000, 700);
  for (Eigen::Vector3d& vertex : mesh.vertices) vertex += place;
  const RayCaster caster(mesh);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d target = place + Eigen::Vector3d(uniform(-1, 1), uniform(-1, 1), 0);
    const Eigen::Vector3d origin = place + Eigen::Vector3d(uniform(-99, 99), 50, 10000);
    const auto hit = caster.cast(origin, target - origin);
    ASSERT_TRUE(hit);
    EXPECT_NEAR(hit->distance, 1.0, 1e-12);
  }
}

TEST(RayCaster, SameHitsHoweverManyThreadsBuildTheScene) {
  const TriangleMesh mesh = ball_mesh(100, 200, {0, 0, 0});
  std::vector<Eigen::Vector3d> directions;
  for (int i = 0; i < 4000; ++i) directions.push_back(random_vector(1.0));
  // Through vertices, where up to six triangles have equal distances.
  for (const Eigen::Vector3d& vertex : mesh.vertices) directions.push_back(vertex);
  std::vector<RayHit> reference(directions.size());
  for (const unsigned threads : {1U, 2U, 3U, 4U}) {
    const libmap::ThreadLimit limit(threads);
    const RayCaster caster(mesh);
    std::vector<RayHit> hits(directions.size());
    caster.cast_bundle({0, 0, 0}, directions, hits);
    if (threads == 1) reference = hits;
    for (std::size_t i = 0; i < hits.size(); ++i) {
      ASSERT_EQ(hits[i].triangle, reference[i].triangle);
      ASSERT_EQ(hits[i].distance, reference[i].distance);
    }
  }
}

TEST(RayCaster, RaysThatPointNowhereMeetNothing) {
  const RayCaster caster(square_mesh(0.0));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(caster.cast({0, 0, 1}, {0, 0, 0}));
  EXPECT_FALSE(caster.cast({0, 0, 1}, {0, 0, nan}));
  EXPECT_FALSE(caster.cast({0, 0, 1}, {0, 0, -inf}));
  EXPECT_FALSE(caster.cast({0, nan, 1}, {0, 0, -1}));
  EXPECT_TRUE(caster.cast({0, 0, 1}, {0, 0, -1}, 0.0, inf));
  EXPECT_TRUE(caster.cast({0, 0, 1}, {0, 0, -1e-200}, 0.0, inf));
}

TEST(RayCaster, RefusesMeshesThatAreNone) {
  TriangleMesh mesh;
  EXPECT_TRUE(is_error(error_of([&] { RayCaster{mesh}; }), {.field = "triangles of the mesh"}));
  mesh = square_mesh(0.0);
  mesh.triangles.push_back({0, 1, 9});
  EXPECT_EQ(error_of([&] { RayCaster{mesh}; }).context().value, "9");
  mesh = square_mesh(std::numeric_limits<double>::quiet_NaN());
  EXPECT_TRUE(is_error(error_of([&] { RayCaster{mesh}; }), {.field = "vertices of the mesh"}));
  std::vector<RayHit> hits(2);
  const RayCaster caster(square_mesh(0.0));
  EXPECT_EQ(error_of([&] {
              caster.cast_bundle({0, 0, 1}, std::vector<Eigen::Vector3d>(3, {0, 0, -1}), hits);
            })
                .context()
                .bound,
            "3");
  // Triangles without area are never hit.
  mesh = square_mesh(0.0);
  mesh.triangles = {{0, 0, 0}, {1, 1, 2}};
  EXPECT_FALSE(RayCaster(mesh).cast({0, 0, 1}, {0, 0, -1}));
}

// Memory suffices for the caster's copy of the triangles, but not for Embree's.
TEST(RayCaster, SaysThatEmbreeCannotBuildTheScene) {
  if (!graspmap_test::memory_can_be_limited) return;
  TriangleMesh mesh = square_mesh(0.0);
  const RayCaster before(mesh);  // starts Embree's threads
  constexpr std::size_t count = std::size_t{1} << 22;
  mesh.triangles.resize(count, mesh.triangles[0]);
  std::ifstream status("/proc/self/status");
  std::string word;
  std::uint64_t data_kib = 0;
  while (status >> word)
    if (word == "VmData:") status >> data_kib;
  ASSERT_GT(data_kib, 0U);
  const libmap::Error error = error_of([&] {
    const graspmap_test::LowerLimit limit(
        RLIMIT_DATA, data_kib * 1024 + count * sizeof(libmap::Triangle) * 3 / 2);
    RayCaster{mesh};
  });
  EXPECT_EQ(error.kind(), libmap::ErrorKind::failed);
  EXPECT_TRUE(is_error(error, {.about = "Embree", .kind = libmap::ErrorKind::failed}));
  EXPECT_TRUE(before.cast({0, 0, 1}, {0, 0, -1}));
}

}  // namespace ray_caster_test
