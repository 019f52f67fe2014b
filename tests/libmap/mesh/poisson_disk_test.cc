// Poisson-disk samples: minimum distance, maximality, even density on any slope, the spectrum of
// blue noise, and identical bytes for any number of threads.
#include "libmap/mesh/poisson_disk.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>
#include <set>

#include "libmap/core/parallel.h"
#include "libmap/geometry/spatial_index.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "libmap/mesh/mesh_parts.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace poisson_disk_test {

using graspmap_test::ball_mesh;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::random_engine;
using graspmap_test::square_mesh;
using graspmap_test::uniform;

PoissonDiskResult by_radius(const TriangleMesh& mesh, double radius_m, std::uint64_t seed = 1) {
  return sample_poisson_disk(mesh, {.radius_m = radius_m, .count = 0, .seed = seed});
}

PoissonDiskResult by_count(const TriangleMesh& mesh, std::uint64_t count, std::uint64_t seed = 1) {
  return sample_poisson_disk(mesh, {.radius_m = 0.005, .count = count, .seed = seed});
}

TriangleMesh moved(const TriangleMesh& mesh, const Eigen::Vector3d& by,
                   const Eigen::Vector3d& roll_pitch_yaw_deg = Eigen::Vector3d::Zero()) {
  return transform_mesh(mesh, make_pose_from_rpy(by, roll_pitch_yaw_deg));
}

// Rough ground of 1 x 1 m with slopes up to about 60 degrees, in triangles of about `cell_m`.
TriangleMesh rough_mesh(double cell_m) {
  TriangleMesh mesh;
  const auto n = static_cast<std::uint32_t>(std::lround(1.0 / cell_m));
  for (std::uint32_t y = 0; y <= n; ++y)
    for (std::uint32_t x = 0; x <= n; ++x) {
      const double u = static_cast<double>(x) / n;
      const double v = static_cast<double>(y) / n;
      mesh.vertices.emplace_back(u, v, 0.08 * std::sin(17 * u + 3 * v) * std::cos(13 * v - 2 * u));
    }
  for (std::uint32_t y = 0; y < n; ++y)
    for (std::uint32_t x = 0; x < n; ++x) {
      const std::uint32_t a = y * (n + 1) + x;
      mesh.triangles.push_back({a, a + 1, a + n + 2});
      mesh.triangles.push_back({a, a + n + 2, a + n + 1});
    }
  return mesh;
}

double smallest_pair(const std::vector<Eigen::Vector3d>& points) {
  double square = std::numeric_limits<double>::infinity();
  if (points.size() < 3000) {
    for (std::size_t a = 0; a < points.size(); ++a)
      for (std::size_t b = 0; b < a; ++b)
        square = std::min(square, (points[a] - points[b]).squaredNorm());
  } else {
    const PointTree tree(points);
    for (const Eigen::Vector3d& point : points)
      square = std::min(square, tree.nearest(point, 2)[1].square_m2);
  }
  return std::sqrt(square);
}

// Largest distance of random points of the surface to the nearest sample.
double largest_hole(const TriangleMesh& mesh, const std::vector<Eigen::Vector3d>& points,
                    int darts) {
  std::vector<double> areas;
  for (const Triangle& triangle : mesh.triangles)
    areas.push_back(area_normal(mesh, triangle).norm());
  std::discrete_distribution<std::uint32_t> draw(areas.begin(), areas.end());
  const PointTree tree(points);
  double square = 0.0;
  for (int n = 0; n < darts; ++n) {
    double u = uniform(0.0, 1.0);
    double v = uniform(0.0, 1.0);
    if (u + v > 1.0) {
      u = 1.0 - u;
      v = 1.0 - v;
    }
    const Eigen::Vector3d dart = position_on(mesh, {draw(random_engine()), u, v});
    square = std::max(square, tree.nearest(dart).square_m2);
  }
  return std::sqrt(square);
}

// All pairs have the minimum distance, no dart is accepted, and the reported values are correct.
void expect_maximal(const TriangleMesh& mesh, const PoissonDiskResult& result, int darts = 50000) {
  const std::vector<Eigen::Vector3d>& points = result.cloud.positions;
  ASSERT_FALSE(points.empty());
  result.cloud.check();
  EXPECT_NEAR(result.area_m2, surface_area(mesh), 1e-9 * result.area_m2);
  EXPECT_LE(largest_hole(mesh, points, darts), 1.001 * result.radius_m + 1e-7);
  if (points.size() == 1) {
    EXPECT_EQ(result.smallest_distance_m, 0.0);
    return;
  }
  const double smallest = smallest_pair(points);
  EXPECT_GE(smallest, result.radius_m);
  EXPECT_NEAR(result.smallest_distance_m, smallest, 1e-15);
  const double densest =
      2 * std::sqrt(result.area_m2 / (2 * std::sqrt(3.0) * static_cast<double>(points.size())));
  EXPECT_NEAR(result.relative_radius, smallest / densest, 1e-12);
}

bool same_bytes(const PoissonDiskResult& a, const PoissonDiskResult& b) {
  return a.radius_m == b.radius_m && a.cloud.positions == b.cloud.positions &&
         a.cloud.normals == b.cloud.normals && a.cloud.fields == b.cloud.fields;
}

TEST(TileSampler, SeamsAreSampledAsAllElse) {
  const TriangleMesh mesh = rough_mesh(0.02);
  // In squares of 0.25 m; triangles on seams are in either square.
  constexpr std::size_t pieces = 16;
  std::vector<TriangleMesh> parts;
  std::vector<Bounds3d> boxes;
  for (std::size_t n = 0; n < pieces; ++n) {
    std::vector<bool> keep;
    for (const Triangle& triangle : mesh.triangles) {
      const Eigen::Vector3d center = center_of(mesh, triangle);
      keep.push_back(std::floor(4 * center.x()) + 4 * std::floor(4 * center.y()) ==
                     static_cast<double>(n));
    }
    parts.push_back(select_triangles(mesh, keep));
    boxes.push_back(bounds_of(parts.back().vertices));
  }
  const PoissonDiskOptions options = {.radius_m = 0.01};
  TileSampler sampler(boxes, options);
  PoissonDiskResult joined;
  for (std::size_t n = 0; n < pieces; ++n) {
    const PoissonDiskResult part = sampler.sample(parts[n], n);
    EXPECT_GE(part.smallest_distance_m, options.radius_m);
    joined.area_m2 += part.area_m2;
    joined.cloud.positions.insert(joined.cloud.positions.end(), part.cloud.positions.begin(),
                                  part.cloud.positions.end());
  }
  EXPECT_GE(smallest_pair(joined.cloud.positions), options.radius_m);
  EXPECT_LE(largest_hole(mesh, joined.cloud.positions, 50000), 1.001 * options.radius_m + 1e-7);
  const auto whole = static_cast<double>(by_radius(mesh, 0.01).cloud.size());
  EXPECT_NEAR(static_cast<double>(joined.cloud.size()) / whole, 1.0, 0.01);
  EXPECT_TRUE(TileSampler(boxes, options).sample(TriangleMesh(), 0).cloud.empty());
  EXPECT_EQ(error_of([&] { TileSampler(boxes, {.count = 100}); }).context().field, "count");
}

TEST(PoissonDisk, MaximalOnAnyTessellation) {
  for (const double radius : {0.3, 0.05, 0.02}) {
    SCOPED_TRACE(radius);
    expect_maximal(square_mesh(0.0), by_radius(square_mesh(0.0), radius));
    const TriangleMesh ball = ball_mesh(40, 60, {0.1, 0.2, 0.3}, 0.5);
    expect_maximal(ball, by_radius(ball, radius));
    for (const double cell : {0.2, 0.02, 0.006})
      expect_maximal(rough_mesh(cell), by_radius(rough_mesh(cell), radius));
  }
}

TEST(PoissonDisk, ManyDartsFindNoRoom) {
  const TriangleMesh mesh = rough_mesh(0.02);
  const PoissonDiskResult result = by_radius(mesh, 0.04);
  expect_maximal(mesh, result, 2000000);
  EXPECT_GT(result.relative_radius, 0.7);
}

TEST(PoissonDisk, DensityDoesNotDependOnTheTriangles) {
  const double coarse = static_cast<double>(by_radius(square_mesh(0.0), 0.02).cloud.size());
  // Saturated random discs cover 0.547 of the plane, and more at the border.
  const double expected = 0.6965 * std::pow((2.0 + 0.01) / 0.02, 2);
  EXPECT_NEAR(coarse / expected, 1.0, 0.02);
  TriangleMesh fine;
  const std::uint32_t n = 300;
  for (std::uint32_t y = 0; y <= n; ++y)
    for (std::uint32_t x = 0; x <= n; ++x)
      fine.vertices.emplace_back(-1.0 + 2.0 * x / n, -1.0 + 2.0 * y / n, 0.0);
  for (std::uint32_t y = 0; y < n; ++y)
    for (std::uint32_t x = 0; x < n; ++x) {
      const std::uint32_t a = y * (n + 1) + x;
      fine.triangles.push_back({a, a + 1, a + n + 2});
      fine.triangles.push_back({a, a + n + 2, a + n + 1});
    }
  EXPECT_NEAR(static_cast<double>(by_radius(fine, 0.02).cloud.size()) / coarse, 1.0, 0.01);
}

TEST(PoissonDisk, WallsAsDenseAsFloors) {
  const TriangleMesh floor = square_mesh(0.0);
  TriangleMesh mesh = graspmap_test::join_meshes(floor, moved(floor, {10, 0, 0}, {90, 0, 0}));
  mesh = graspmap_test::join_meshes(mesh, moved(floor, {20, 0, 0}, {30, 40, 10}));
  std::array<double, 3> counts{};
  for (const Eigen::Vector3d& point : by_radius(mesh, 0.02).cloud.positions)
    counts[static_cast<std::size_t>(std::lround(point.x() / 10))] += 1.0;
  // About 7100 samples each, with a scatter of about 0.2 %.
  EXPECT_NEAR(counts[1] / counts[0], 1.0, 0.012) << "upright";
  EXPECT_NEAR(counts[2] / counts[0], 1.0, 0.012) << "oblique";
}

TEST(PoissonDisk, BlueNoise) {
  const double radius = 0.02;
  const auto power = [&](const std::vector<Eigen::Vector3d>& points, double low, double high) {
    double sum = 0.0;
    int frequencies = 0;
    // Integer numbers of waves on the square, at which its own spectrum is zero.
    for (int a = -60; a <= 60; ++a)
      for (int b = 0; b <= 60; ++b) {
        const double frequency = std::hypot(a, b) / 2.0;  // per meter
        if (frequency < low / radius || frequency > high / radius || (a == 0 && b == 0)) continue;
        std::complex<double> wave = 0.0;
        for (const Eigen::Vector3d& p : points)
          wave += std::polar(1.0, std::numbers::pi * (a * p.x() + b * p.y()));
        sum += std::norm(wave) / static_cast<double>(points.size());
        ++frequencies;
      }
    return sum / frequencies;
  };
  const std::vector<Eigen::Vector3d> points = by_radius(square_mesh(0.0), radius).cloud.positions;
  std::vector<Eigen::Vector3d> white(points.size());
  for (Eigen::Vector3d& point : white) point = {uniform(-1, 1), uniform(-1, 1), 0};
  EXPECT_NEAR(power(white, 0.02, 0.2), 1.0, 0.15);
  EXPECT_LT(power(points, 0.02, 0.2), 0.15);
  EXPECT_LT(power(points, 0.2, 0.4), 0.3);

  // Pair distances of the points away from the border, relative to white noise.
  const PointTree tree(points);
  std::array<double, 12> pairs{};  // in bins of a quarter of the radius
  double inner = 0.0;
  for (const Eigen::Vector3d& p : points) {
    if (p.cwiseAbs().maxCoeff() > 1.0 - 3.0 * radius) continue;
    inner += 1.0;
    for (const NeighborPoint& other : tree.within(p, 2.9999 * radius))
      if (other.square_m2 > 0.0)
        pairs[static_cast<std::size_t>(4.0 * std::sqrt(other.square_m2) / radius)] += 1.0;
  }
  const double per_m2 = static_cast<double>(points.size()) / 4.0;
  for (std::size_t n = 0; n < pairs.size(); ++n) {
    const double ring =
        std::numbers::pi * radius * radius / 16.0 * (2.0 * static_cast<double>(n) + 1.0);
    pairs[n] /= inner * per_m2 * ring;
  }
  for (std::size_t n = 0; n < 4; ++n) EXPECT_EQ(pairs[n], 0.0);
  EXPECT_GT(pairs[4], 1.8) << "the first peak begins at the radius";
  EXPECT_LT(pairs[6], 1.0);
  for (std::size_t n = 9; n < 12; ++n) EXPECT_NEAR(pairs[n], 1.0, 0.1);
}

TEST(PoissonDisk, Count) {
  const TriangleMesh mesh = rough_mesh(0.03);
  for (const std::uint64_t count : {100u, 500u, 3000u, 20000u}) {
    const PoissonDiskResult result = by_count(mesh, count);
    EXPECT_NEAR(static_cast<double>(result.cloud.size()), static_cast<double>(count),
                static_cast<double>(count) / 100);
    expect_maximal(mesh, result);
    EXPECT_EQ(by_radius(mesh, result.radius_m).cloud.positions, result.cloud.positions);
  }
  for (const std::uint64_t count : {1u, 2u, 3u, 4u, 7u, 10u, 25u, 60u, 99u}) {
    const PoissonDiskResult result = by_count(mesh, count);
    EXPECT_EQ(result.cloud.size(), count);
    expect_maximal(mesh, result, 5000);
  }
}

TEST(PoissonDisk, CountOfIslandsFarApart) {
  TriangleMesh mesh;
  for (int n = 0; n < 3; ++n)
    mesh = graspmap_test::join_meshes(mesh, moved(square_mesh(0.0, 0.01), {n * n * 20.0, 0, 0}));
  for (const std::uint64_t count : {1u, 2u, 3u, 12u})
    EXPECT_EQ(by_count(mesh, count).cloud.size(), count);
}

TEST(PoissonDisk, SameBytesForAnyThreads) {
  TriangleMesh mesh = graspmap_test::join_meshes(rough_mesh(0.01), square_mesh(0.5));
  PoissonDiskResult first;
  PoissonDiskResult counted;
  {
    const ThreadLimit limit(1);
    first = by_radius(mesh, 0.015);
    counted = by_count(mesh, 2000);
  }
  for (const unsigned threads : {1U, 2U, 8U}) {
    const ThreadLimit limit(threads);
    EXPECT_TRUE(same_bytes(by_radius(mesh, 0.015), first)) << threads;
    EXPECT_TRUE(same_bytes(by_count(mesh, 2000), counted)) << threads;
  }
}

TEST(PoissonDisk, SeedsDiffer) {
  const TriangleMesh mesh = rough_mesh(0.05);
  const PoissonDiskResult a = by_radius(mesh, 0.05, 1);
  const PoissonDiskResult b = by_radius(mesh, 0.05, 2);
  const PointTree tree(a.cloud.positions);
  std::size_t shared = 0;
  for (const Eigen::Vector3d& point : b.cloud.positions)
    shared += tree.nearest(point).square_m2 < 1e-12 ? 1 : 0;
  EXPECT_EQ(shared, 0U);
  expect_maximal(mesh, b);
}

TEST(PoissonDisk, OrderOfTriangles) {
  TriangleMesh mesh = rough_mesh(0.02);
  const auto before = static_cast<double>(by_radius(mesh, 0.02).cloud.size());
  std::shuffle(mesh.triangles.begin(), mesh.triangles.end(), random_engine());
  const PoissonDiskResult result = by_radius(mesh, 0.02);
  expect_maximal(mesh, result);
  EXPECT_NEAR(static_cast<double>(result.cloud.size()) / before, 1.0, 0.02);
}

TEST(PoissonDisk, SheetsNearerThanTheRadius) {
  const double radius = 0.05;
  const TriangleMesh plate =
      graspmap_test::join_meshes(square_mesh(0.0), square_mesh(0.3 * radius));
  const PoissonDiskResult result = by_radius(plate, radius);
  expect_maximal(plate, result);
  const auto one = static_cast<double>(by_radius(square_mesh(0.0), radius).cloud.size());
  EXPECT_NEAR(static_cast<double>(result.cloud.size()) / one, 1.0, 0.15);
}

TEST(PoissonDisk, TrianglesWithoutAreaHoldNoSample) {
  TriangleMesh mesh = square_mesh(0.0);
  mesh.vertices.insert(mesh.vertices.end(), {{5, 0, 0}, {6, 0, 0}, {7, 0, 0}});
  mesh.triangles.insert(mesh.triangles.end(), {{4, 5, 6}, {4, 4, 4}, {4, 6, 6}, {0, 0, 1}});
  for (const double radius : {0.1, 1.0}) {
    const PoissonDiskResult result = by_radius(mesh, radius);
    expect_maximal(mesh, result);
    for (const Eigen::Vector3d& point : result.cloud.positions) EXPECT_LE(point.x(), 1.0);
  }
}

TEST(PoissonDisk, Slivers) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0.3, 1e-9, 0}, {0, 1, 0}, {1, 1, 0}, {1, 1.0005, 0}};
  mesh.triangles = {{0, 1, 2}, {3, 4, 5}};
  const PoissonDiskResult result = by_radius(mesh, 0.01);
  expect_maximal(mesh, result);
  std::array<std::size_t, 2> counts{};
  for (const Eigen::Vector3d& point : result.cloud.positions) ++counts[point.y() > 0.5 ? 1 : 0];
  // Cars parked at random on a street cover 0.7476 of it (Renyi 1958).
  EXPECT_NEAR(static_cast<double>(counts[0]), 75.0, 8.0);
  EXPECT_NEAR(static_cast<double>(counts[1]), 75.0, 8.0);
}

TEST(PoissonDisk, IslandsSmallerThanTheRadius) {
  TriangleMesh mesh;
  for (int n = 0; n < 300; ++n) {
    TriangleMesh island = square_mesh(0.0, 0.001);
    island.triangles.pop_back();
    mesh = graspmap_test::join_meshes(
        mesh, moved(island, Eigen::Vector3i(n % 20, n / 20, 0).cast<double>()));
  }
  const PoissonDiskResult result = by_radius(mesh, 0.5);
  EXPECT_EQ(result.cloud.size(), 300U);
  expect_maximal(mesh, result, 5000);
  EXPECT_NEAR(result.smallest_distance_m, 1.0, 0.004);
  EXPECT_EQ(by_radius(mesh, 50.0).cloud.size(), 1U) << "larger than the mesh";
}

TEST(PoissonDisk, FarFromTheOrigin) {
  const TriangleMesh mesh = moved(rough_mesh(0.05), {500000.0, -4000000.0, 3000.0});
  const PoissonDiskResult result = by_radius(mesh, 0.02);
  expect_maximal(mesh, result);
  EXPECT_GT(result.relative_radius, 0.7);
  const auto path = graspmap_test::scratch_folder() / "far.pcd";
  write_cloud(path, result.cloud);
  EXPECT_GE(smallest_pair(read_cloud(path).cloud.positions), result.radius_m);
}

TEST(PoissonDisk, FilesKeepTheSpacing) {
  for (const double offset : {0.0, 3.3, 250.0, 300.0}) {
    const TriangleMesh mesh = moved(rough_mesh(0.05), {offset, 0.1, -offset / 2});
    const PoissonDiskResult result = by_radius(mesh, 0.01);
    for (const char* name : {"a.pcd", "a.ply"}) {
      const auto path = graspmap_test::scratch_folder() / name;
      write_cloud(path, result.cloud);
      const PointCloud read = read_cloud(path).cloud;
      EXPECT_GE(smallest_pair(read.positions), result.radius_m) << name << " " << offset;
    }
  }
}

TEST(PoissonDisk, RadiusBelowSinglePrecision) {
  // The resolution of single precision is 15 micrometers there: 15 x 15 positions.
  const TriangleMesh mesh = moved(square_mesh(0.0, 1e-4), {200.0, 200.0, 0.0});
  const PoissonDiskResult result = by_radius(mesh, 1e-6);
  EXPECT_GE(smallest_pair(result.cloud.positions), 1e-6);
  EXPECT_LE(result.cloud.size(), 15U * 15U);
  EXPECT_GE(result.cloud.size(), 100U);
}

TEST(PoissonDisk, CarriesWhatTheMeshKnows) {
  TriangleMesh mesh = square_mesh(0.0);
  mesh.vertex_colors = {{0, 0, 0}, {200, 0, 0}, {200, 100, 0}, {0, 100, 0}};
  mesh.vertex_fields = {{"height", ScalarType::float32, {-1, 1, 1, -1}}};
  mesh.face_fields = {{"filled", ScalarType::uint8, {0, 1}}};
  const PointCloud cloud = by_radius(mesh, 0.05).cloud;
  ASSERT_NE(cloud.find_field("height"), nullptr);
  ASSERT_NE(cloud.find_field("filled"), nullptr);
  EXPECT_EQ(cloud.find_field("filled")->type, ScalarType::uint8);
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    const Eigen::Vector3d& p = cloud.positions[n];
    EXPECT_EQ(cloud.normals[n], Eigen::Vector3f(0, 0, 1));
    EXPECT_NEAR(cloud.find_field("height")->values[n], p.x(), 1e-6);
    EXPECT_NEAR(cloud.colors[n][0], 100 + 100 * p.x(), 0.51);
    EXPECT_NEAR(cloud.colors[n][1], 50 + 50 * p.y(), 0.51);
    EXPECT_EQ(cloud.find_field("filled")->values[n], p.y() > p.x() ? 1.0 : 0.0);
  }
}

TEST(PoissonDisk, BadInput) {
  const TriangleMesh mesh = square_mesh(0.0);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double radius : {0.0, -1.0, nan, std::numeric_limits<double>::infinity()})
    EXPECT_EQ(error_of([&] { by_radius(mesh, radius); }).context().field, "radius_m");
  EXPECT_EQ(error_of([&] { by_radius(mesh, 1e-7); }).context().field, "radius_m");
  EXPECT_EQ(error_of([&] { by_count(mesh, 100000001); }).context().field, "count");
  // A few large triangles.
  TriangleMesh wide = mesh;
  for (Eigen::Vector3d& vertex : wide.vertices) vertex *= 10.0;
  const Error many = error_of([&] { by_radius(wide, 0.005); });
  EXPECT_TRUE(is_error(many, {.field = "radius_m", .value = "0.005"}));
  EXPECT_EQ(many.context().field, "radius_m");

  const auto refusal = [](const TriangleMesh& bad) {
    return error_of([&] { by_radius(bad, 0.1); });
  };
  EXPECT_TRUE(is_error(refusal({}), {.field = "mesh"}));
  TriangleMesh line = mesh;
  line.triangles = {{0, 0, 1}, {2, 2, 2}};
  EXPECT_TRUE(is_error(refusal(line), {.field = "mesh"}));
  EXPECT_TRUE(is_error(error_of([&] { by_count(line, 10); }), {.field = "mesh"}));
  TriangleMesh broken = mesh;
  broken.vertices[1].y() = nan;
  EXPECT_TRUE(is_error(refusal(broken), {.field = "vertices of the mesh"}));
  broken = mesh;
  broken.triangles[1][2] = 4;
  EXPECT_TRUE(is_error(refusal(broken), {.field = "vertex of triangle 1", .value = "4"}));
  // A thin triangle with hardly any area, too long for the radius.
  TriangleMesh thread;
  thread.vertices = {{0, 0, 0}, {1e6, 0, 0}, {0, 1e-12, 0}};
  thread.triangles = {{0, 1, 2}};
  EXPECT_EQ(error_of([&] { by_radius(thread, 1e-3); }).context().field, "fragment size");
}

TEST(PoissonDisk, RealSite) {
  GRASPMAP_REQUIRE_DATA();
  const TriangleMesh mesh =
      read_mesh(graspmap_test::data_folder() / "scans/site_ground_truth_mesh.ply").mesh;
  const PoissonDiskResult result = by_count(mesh, 73000);
  EXPECT_NEAR(static_cast<double>(result.cloud.size()), 73000, 730);
  EXPECT_GE(result.relative_radius, 0.70);
  expect_maximal(mesh, result, 500000);
}

}  // namespace poisson_disk_test
}  // namespace libmap
