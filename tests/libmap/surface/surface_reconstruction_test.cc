#include "libmap/surface/surface_reconstruction.h"
#include "libmap/surface/surface_solvers.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <thread>

#include "libmap/core/parallel.h"
#include "libmap/io/cloud_io.h"
#include "libmap/mesh/surface_distance.h"
#include "libmap/surface/mesh_cleaning.h"
#include "libmap/surface/mesh_report.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace surface_reconstruction_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::random_engine;
using graspmap_test::uniform;
using ::testing::HasSubstr;

constexpr double pi = std::numbers::pi;

// Nearly even points on a sphere (Fibonacci lattice) with a spacing of about `spacing_m`.
PointCloud ball(double radius, double spacing_m, const Eigen::Vector3d& center = {0, 0, 0}) {
  PointCloud cloud;
  const int count = static_cast<int>(4 * pi * radius * radius / (spacing_m * spacing_m));
  for (int n = 0; n < count; ++n) {
    const double z = 1 - (2 * n + 1.0) / count;
    const double angle = n * pi * (3 - std::sqrt(5.0));
    const double r = std::sqrt(1 - z * z);
    const Eigen::Vector3d out(r * std::cos(angle), r * std::sin(angle), z);
    cloud.positions.push_back(center + radius * out);
    cloud.normals.push_back(out.cast<float>());
  }
  return cloud;
}

// A square of `size_m` about the origin, z = slope * x.
PointCloud plane(double size_m, double spacing_m, double slope = 0.0) {
  PointCloud cloud;
  const int side = static_cast<int>(std::lround(size_m / spacing_m));
  const Eigen::Vector3f normal = Eigen::Vector3d(-slope, 0, 1).normalized().cast<float>();
  for (int i = 0; i <= side; ++i)
    for (int j = 0; j <= side; ++j) {
      const double x = i * spacing_m - size_m / 2;
      cloud.positions.emplace_back(x, j * spacing_m - size_m / 2, slope * x);
      cloud.normals.push_back(normal);
    }
  return cloud;
}

PointCloud joined(PointCloud one, const PointCloud& two) {
  one.positions.insert(one.positions.end(), two.positions.begin(), two.positions.end());
  one.normals.insert(one.normals.end(), two.normals.begin(), two.normals.end());
  return one;
}

SurfaceReconstructionOptions cells_of(double cell_size_m) {
  SurfaceReconstructionOptions options;
  options.cell_size_m = cell_size_m;
  return options;
}

class Reconstruction : public testing::TestWithParam<SurfaceMethod> {
 protected:
  static SurfaceReconstructionResult reconstruct(const PointCloud& cloud,
                                                 SurfaceReconstructionOptions options = {}) {
    options.method = GetParam();
    return reconstruct_surface(cloud, options);
  }
};
INSTANTIATE_TEST_SUITE_P(Method, Reconstruction,
                         testing::Values(SurfaceMethod::implicit, SurfaceMethod::poisson),
                         [](const auto& one) {
                           return one.param == SurfaceMethod::poisson ? "Poisson" : "Implicit";
                         });

MeshReport cleaned_report(const TriangleMesh& mesh) {
  MeshCleaningOptions options;
  options.min_island_area_m2 = 0.001;
  return report_mesh(clean_mesh(mesh, options).mesh);
}

double rms_off_sphere(const TriangleMesh& mesh, double radius) {
  double squares = 0.0;
  for (const Eigen::Vector3d& vertex : mesh.vertices)
    squares += std::pow(vertex.norm() - radius, 2);
  return std::sqrt(squares / static_cast<double>(mesh.vertices.size()));
}

TEST_P(Reconstruction, Sphere) {
  constexpr double radius = 0.25;
  const SurfaceReconstructionResult result = reconstruct(ball(radius, 0.01));
  EXPECT_NEAR(result.cell_size_m, 0.01, 0.002);
  EXPECT_EQ(result.cell_size_m, result.spacing_m);
  EXPECT_LT(rms_off_sphere(result.mesh, radius), 0.0005);
  EXPECT_NEAR(surface_area(result.mesh), 4 * pi * radius * radius, 0.01 * pi * radius * radius);
  for (std::size_t n = 0; n < result.mesh.vertices.size(); ++n)
    EXPECT_GT(
        result.mesh.vertex_normals[n].cast<double>().dot(result.mesh.vertices[n].normalized()),
        0.97);
  const MeshReport report = cleaned_report(result.mesh);
  EXPECT_TRUE(report.is_watertight());
  EXPECT_EQ(report.genus, 0);
  EXPECT_NEAR(report.volume_m3, 4 * pi / 3 * std::pow(radius, 3), 0.01 * std::pow(radius, 3));
}

TEST_P(Reconstruction, CellsHaveTheWantedSize) {
  const PointCloud cloud = ball(0.25, 0.005);
  double last = 0.0;
  for (const double cell : {0.01, 0.013, 0.02, 0.04}) {
    const SurfaceReconstructionResult result = reconstruct(cloud, cells_of(cell));
    EXPECT_EQ(result.cell_size_m, cell);
    // Edges of marching cubes are slightly shorter than the cells.
    const double edge = report_mesh(result.mesh).edge_lengths.median_m;
    EXPECT_GT(edge, 0.6 * cell);
    EXPECT_LT(edge, 1.3 * cell);
    EXPECT_GT(edge, last);
    last = edge;
  }
}

// Half of the samples yields the same surface as all of them, except near its border.
TEST(ImplicitSurface, DependsOnNearSamplesOnly) {
  std::vector<SurfaceSample> all;
  for (const Eigen::Vector3d& position : ball(0.25, 0.01).positions) {
    const double off = 1.0 + uniform(-0.01, 0.01);
    all.push_back({(off * position).cast<float>(), position.normalized().cast<float>(),
                   static_cast<float>(uniform(0.2, 1.0)), 0.01F});
  }
  std::vector<SurfaceSample> half;
  for (const SurfaceSample& sample : all)
    if (sample.position.x() > -0.05F) half.push_back(sample);
  const TriangleMesh whole = implicit_surface(all, 0.01, 2.5);
  const TriangleMesh part = implicit_surface(half, 0.01, 2.5);
  const auto corners_of = [](const TriangleMesh& mesh) {
    std::vector<std::array<double, 9>> corners;
    for (const Triangle& triangle : mesh.triangles) {
      std::array<double, 9> one{};
      for (std::size_t c = 0; c < 3; ++c)
        for (int axis = 0; axis < 3; ++axis)
          one[3 * c + static_cast<std::size_t>(axis)] = mesh.vertices[triangle[c]][axis];
      if (std::min({one[0], one[3], one[6]}) > 0.0) corners.push_back(one);
    }
    std::sort(corners.begin(), corners.end());
    return corners;
  };
  const auto expected = corners_of(whole);
  EXPECT_GT(expected.size(), 5000U);
  EXPECT_EQ(corners_of(part), expected);
}

// Algebraic spheres fit balls exactly for any distribution of samples. Linear interpolation along
// an edge of the grid causes an error of at most cell^2 / 8 radius.
TEST(ImplicitSurface, SpheresAreExact) {
  constexpr double cell_m = 0.01;
  for (const double radius : {0.04, 0.1, 0.5}) {
    std::vector<SurfaceSample> samples;
    for (const Eigen::Vector3d& position : ball(radius, 0.006).positions)
      if (uniform(0, 1) < 0.7)
        samples.push_back({position.cast<float>(), position.normalized().cast<float>(),
                           static_cast<float>(uniform(0.1, 1.0)), 0.01F});
    const TriangleMesh mesh = implicit_surface(samples, cell_m, 2.5);
    ASSERT_GT(mesh.vertices.size(), 100U);
    for (const Eigen::Vector3d& vertex : mesh.vertices)
      EXPECT_NEAR(vertex.norm(), radius, 1.1 * cell_m * cell_m / (8 * radius) + 0.01 * cell_m);
  }
}

TEST_P(Reconstruction, PlaneIsFlatAndEndsWithThePoints) {
  for (const double slope : {0.0, 0.4}) {
    const SurfaceReconstructionResult result = reconstruct(plane(0.6, 0.01, slope), cells_of(0.01));
    ASSERT_FALSE(result.mesh.triangles.empty());
    double reach = 0.0;
    for (const Eigen::Vector3d& vertex : result.mesh.vertices) {
      const double out = vertex.head<2>().cwiseAbs().maxCoeff();
      EXPECT_NEAR(vertex.z(), slope * vertex.x(), out < 0.29 ? 0.0005 : 0.004);
      reach = std::max(reach, out);
    }
    EXPECT_GT(reach, 0.3 - 0.01);
    EXPECT_LT(reach, 0.3 + 0.025);
    EXPECT_EQ(result.trimmed_triangles > 0, GetParam() == SurfaceMethod::poisson);
    const MeshReport report = cleaned_report(result.mesh);
    EXPECT_EQ(report.components, 1U);
    EXPECT_EQ(report.boundaries.size(), 1U);
  }
}

TEST_P(Reconstruction, TwoBallsStayApart) {
  const PointCloud cloud = joined(ball(0.1, 0.008, {-0.2, 0, 0}), ball(0.1, 0.008, {0.2, 0, 0}));
  const MeshReport report = cleaned_report(reconstruct(cloud).mesh);
  EXPECT_EQ(report.components, 2U);
  EXPECT_TRUE(report.is_watertight());
  EXPECT_NEAR(report.area_m2, 8 * pi * 0.01, 0.005);
}

TEST_P(Reconstruction, OpenHalfBallGetsNoLidAndNoBalloon) {
  const PointCloud whole = ball(0.25, 0.01);
  PointCloud half;
  for (std::size_t n = 0; n < whole.size(); ++n)
    if (whole.positions[n].z() > 0) {
      half.positions.push_back(whole.positions[n]);
      half.normals.push_back(whole.normals[n]);
    }
  const TriangleMesh mesh = reconstruct(half, cells_of(0.01)).mesh;
  for (const Eigen::Vector3d& vertex : mesh.vertices) {
    EXPECT_GT(vertex.z(), -0.03);
    EXPECT_NEAR(vertex.norm(), 0.25, 0.006);
  }
  EXPECT_NEAR(surface_area(mesh), 2 * pi * 0.25 * 0.25, 0.05);
  EXPECT_EQ(report_mesh(mesh).boundaries.size(), 1U);
}

TEST_P(Reconstruction, GapsAreLeftOpen) {
  PointCloud cloud;
  const PointCloud full = plane(0.6, 0.01);
  for (std::size_t n = 0; n < full.size(); ++n)
    if (full.positions[n].head<2>().norm() > 0.1) {
      cloud.positions.push_back(full.positions[n]);
      cloud.normals.push_back(full.normals[n]);
    }
  const TriangleMesh mesh = reconstruct(cloud, cells_of(0.01)).mesh;
  EXPECT_EQ(cleaned_report(mesh).boundaries.size(), 2U);  // the gap is wider than filled holes
  for (const Eigen::Vector3d& vertex : mesh.vertices)
    EXPECT_GT(vertex.head<2>().norm(), 0.1 - 0.025);
}

// An isolated distant point costs no time and creates no surface.
TEST(ImplicitSurface, LonePointsMakeNoSurface) {
  PointCloud cloud = plane(0.4, 0.01);
  for (int n = 0; n < 20; ++n) {
    cloud.positions.emplace_back(uniform(-9, 9), uniform(-9, 9), 3 + n);
    cloud.normals.emplace_back(0, 0, 1);
  }
  for (const Eigen::Vector3d& vertex :
       clean_mesh(reconstruct_surface(cloud, cells_of(0.01)).mesh, {}).mesh.vertices)
    EXPECT_LT(vertex.z(), 0.1);
}

TEST_P(Reconstruction, NoiseIsAveraged) {
  PointCloud cloud = ball(0.25, 0.005);
  std::normal_distribution<double> noise(0.0, 0.003);
  double squares = 0.0;
  for (Eigen::Vector3d& position : cloud.positions) {
    const double off = noise(random_engine());
    position *= 1 + off / 0.25;
    squares += off * off;
  }
  const double of_points = std::sqrt(squares / static_cast<double>(cloud.size()));
  const TriangleMesh mesh = reconstruct(cloud, cells_of(0.015)).mesh;
  EXPECT_LT(rms_off_sphere(mesh, 0.25), 0.6 * of_points);
}

TEST_P(Reconstruction, UncertainPointsCountForLess) {
  // Every second point is 8 mm too far out and has a large expected error.
  PointCloud cloud = ball(0.25, 0.006);
  ScalarField& errors = cloud.add_field("expected_error", ScalarType::float32);
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    const bool is_bad = n % 3 == 0;
    if (is_bad) cloud.positions[n] *= 1 + 0.008 / 0.25;
    errors.values[n] = is_bad ? 0.01 : 0.001;
  }
  SurfaceReconstructionOptions options = cells_of(0.012);
  const double weighted = rms_off_sphere(reconstruct(cloud, options).mesh, 0.25);
  options.weigh_by_error = false;
  const double equal = rms_off_sphere(reconstruct(cloud, options).mesh, 0.25);
  EXPECT_LT(weighted, 0.6 * equal);
}

TEST_P(Reconstruction, SameBytesForThreadsAndOrder) {
  PointCloud cloud = ball(0.2, 0.008);
  cloud.add_field("expected_error", ScalarType::float32);
  cloud.colors.resize(cloud.size());
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    cloud.positions[n] += 0.002 * Eigen::Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    cloud.fields[0].values[n] = uniform(0.001, 0.003);
    cloud.colors[n] = {static_cast<std::uint8_t>(n % 256), 7, 9};
  }
  const TriangleMesh first = [&] {
    const ThreadLimit limit(1);
    return reconstruct(cloud).mesh;
  }();
  std::vector<std::size_t> order(cloud.size());
  std::iota(order.begin(), order.end(), 0U);
  std::shuffle(order.begin(), order.end(), random_engine());
  PointCloud shuffled = select_points(cloud, order);
  for (PointCloud* other : {&cloud, &shuffled})
    for (const unsigned threads : {2U, 4U}) {
      const ThreadLimit limit(threads);
      const TriangleMesh mesh = reconstruct(*other).mesh;
      EXPECT_EQ(mesh.vertices, first.vertices);
      EXPECT_EQ(mesh.triangles, first.triangles);
      EXPECT_EQ(mesh.vertex_normals, first.vertex_normals);
      EXPECT_EQ(mesh.vertex_colors, first.vertex_colors);
      EXPECT_EQ(mesh.vertex_fields, first.vertex_fields);
    }
}

TEST_P(Reconstruction, CallsFromSeveralThreadsDoNotDisturbEachOther) {
  const PointCloud cloud = ball(0.1, 0.01);
  const TriangleMesh alone = reconstruct(cloud).mesh;
  std::array<TriangleMesh, 3> meshes;
  std::vector<std::thread> threads;
  for (TriangleMesh& mesh : meshes) threads.emplace_back([&] { mesh = reconstruct(cloud).mesh; });
  for (std::thread& thread : threads) thread.join();
  for (const TriangleMesh& mesh : meshes) EXPECT_EQ(mesh.vertices, alone.vertices);
}

TEST_P(Reconstruction, FarAway) {
  const Eigen::Vector3d far(5e5, 4.1e6, 120);
  const TriangleMesh near_mesh = reconstruct(ball(0.2, 0.01), cells_of(0.01)).mesh;
  const TriangleMesh far_mesh = reconstruct(ball(0.2, 0.01, far), cells_of(0.01)).mesh;
  EXPECT_NEAR(static_cast<double>(far_mesh.vertices.size()),
              static_cast<double>(near_mesh.vertices.size()),
              0.02 * static_cast<double>(near_mesh.vertices.size()));
  for (const Eigen::Vector3d& vertex : far_mesh.vertices)
    EXPECT_NEAR((vertex - far).norm(), 0.2, 0.001);
}

TEST_P(Reconstruction, ColorsAndFieldsAreCarriedOver) {
  PointCloud cloud = plane(0.4, 0.01);
  cloud.colors.resize(cloud.size());
  cloud.add_field("ramp", ScalarType::float32);
  cloud.add_field("views", ScalarType::uint16);
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    const bool right = cloud.positions[n].x() > 0;
    cloud.colors[n] = right ? Color{200, 10, 20} : Color{10, 100, 20};
    cloud.find_field("ramp")->values[n] = cloud.positions[n].y();
    cloud.find_field("views")->values[n] = right ? 7 : 3;
  }
  const TriangleMesh mesh = reconstruct(cloud, cells_of(0.01)).mesh;
  mesh.check();
  ASSERT_EQ(mesh.vertex_fields.size(), 2U);
  EXPECT_EQ(mesh.vertex_fields[0].name, "ramp");
  EXPECT_EQ(mesh.vertex_fields[1].type, ScalarType::uint16);
  for (std::size_t n = 0; n < mesh.vertices.size(); ++n) {
    const Eigen::Vector3d& vertex = mesh.vertices[n];
    if (vertex.head<2>().cwiseAbs().maxCoeff() > 0.19 || std::abs(vertex.x()) < 0.02) continue;
    const bool right = vertex.x() > 0;
    EXPECT_EQ(mesh.vertex_colors[n], (right ? Color{200, 10, 20} : Color{10, 100, 20}));
    EXPECT_NEAR(mesh.vertex_fields[0].values[n], vertex.y(), 0.006);
    EXPECT_EQ(mesh.vertex_fields[1].values[n], right ? 7 : 3);
  }
}

TEST_P(Reconstruction, PointsWithoutANormalAreLeftOutAndCounted) {
  PointCloud cloud = ball(0.2, 0.01);
  for (std::size_t n = 0; n < cloud.size(); n += 10) cloud.normals[n].setZero();
  cloud.normals[1].setConstant(std::numeric_limits<float>::quiet_NaN());
  const SurfaceReconstructionResult result = reconstruct(cloud, cells_of(0.01));
  EXPECT_EQ(result.dropped_points, (cloud.size() + 9) / 10 + 1);
  EXPECT_LT(rms_off_sphere(result.mesh, 0.2), 0.001);
}

TEST_P(Reconstruction, RepeatedPointsChangeNothing) {
  const PointCloud once = ball(0.2, 0.01);
  PointCloud thrice = joined(once, joined(once, once));
  const SurfaceReconstructionResult one = reconstruct(once);
  const SurfaceReconstructionResult three = reconstruct(thrice);
  EXPECT_EQ(three.samples, one.samples);
  EXPECT_EQ(three.spacing_m, one.spacing_m);
  EXPECT_NEAR(surface_area(three.mesh), surface_area(one.mesh), 1e-4);
}

TEST_P(Reconstruction, LengthsOfNormalsDoNotCount) {
  PointCloud cloud = ball(0.2, 0.01);
  const TriangleMesh unit = reconstruct(cloud).mesh;
  for (Eigen::Vector3f& normal : cloud.normals) normal *= 0.5F;
  EXPECT_EQ(reconstruct(cloud).mesh.vertices, unit.vertices);
}

TEST_P(Reconstruction, CloudsThatAreTooThin) {
  const auto refusal = [&](const PointCloud& cloud) {
    return error_of([&] { reconstruct(cloud); });
  };
  EXPECT_TRUE(is_error(refusal({}), {.field = "normals"}));
  PointCloud cloud = plane(0.1, 0.01);
  cloud.normals.clear();
  EXPECT_TRUE(is_error(refusal(cloud), {.field = "normals"}));
  cloud.normals.assign(cloud.size(), Eigen::Vector3f::Zero());
  EXPECT_TRUE(is_error(refusal(cloud), {.field = "normals"}));
  PointCloud two;
  two.positions = {{0, 0, 0}, {1, 0, 0}, {1, 0, 0}};
  two.normals.assign(3, Eigen::Vector3f::UnitZ());
  EXPECT_EQ(refusal(two).context().field, "number of distinct points");
  PointCloud line;
  for (int n = 0; n < 100; ++n) line.positions.emplace_back(0.01 * n, 1.0, 2.0);
  line.normals.assign(100, Eigen::Vector3f::UnitZ());
  EXPECT_TRUE(is_error(refusal(line), {.field = "number of distinct points", .value = "100"}));
}

TEST_P(Reconstruction, AFewPointsDoNoHarm) {
  for (const int count : {3, 4, 10}) {
    PointCloud cloud;
    for (int n = 0; n < count; ++n)
      cloud.positions.emplace_back(uniform(0, 1), uniform(0, 1), uniform(0, 1));
    cloud.normals.assign(cloud.size(), Eigen::Vector3f::UnitZ());
    EXPECT_NO_THROW(reconstruct(cloud).mesh.check());
  }
}

TEST_P(Reconstruction, NormalsWithoutSidesAreRefused) {
  PointCloud cloud = plane(0.3, 0.01);
  for (std::size_t n = 0; n < cloud.size(); ++n)
    if (uniform(0, 1) < 0.5) cloud.normals[n] = -cloud.normals[n];
  const Error error = error_of([&] { reconstruct(cloud); });
  EXPECT_EQ(error.context().field, "share of neighbors with normals on opposite sides");
}

// First and last returns, 1 mm apart.
TEST_P(Reconstruction, NearDuplicatesAreNoSpacing) {
  PointCloud cloud = plane(1.0, 0.02);
  const PointCloud once = cloud;
  for (std::size_t n = 0; n < once.size(); ++n) {
    cloud.positions.push_back(once.positions[n] + Eigen::Vector3d(0.0005, 0, -0.001));
    cloud.normals.push_back(once.normals[n]);
  }
  EXPECT_NEAR(reconstruct(cloud).cell_size_m, 0.02, 0.002);
}

TEST_P(Reconstruction, WorkIsAnnounced) {
  SurfaceReconstructionOptions options = cells_of(0.01);
  options.method = GetParam();
  SurfaceWork work;
  const auto result = reconstruct_surface(plane(1.0, 0.02), options, no_progress(),
                                          [&](const SurfaceWork& announced) { work = announced; });
  const auto triangles = static_cast<double>(result.mesh.triangles.size());
  // Poisson's octree is coarser where points are sparse.
  const double factor = GetParam() == SurfaceMethod::poisson ? 4.0 : 1.6;
  EXPECT_LT(std::abs(std::log(work.triangles / triangles)), std::log(factor));
  EXPECT_GT(work.bytes, 0.0);
  EXPECT_GT(work.seconds, 0.0);
}

TEST_P(Reconstruction, OptionsOutOfTheirRangesAreNamed) {
  const PointCloud cloud = plane(0.2, 0.01);
  const auto refusal = [&](const auto& change) {
    SurfaceReconstructionOptions options;
    change(options);
    return error_of([&] { reconstruct(cloud, options); });
  };
  EXPECT_TRUE(is_error(refusal([](auto& o) { o.cell_size_m = -1; }),
                       {.field = "cell_size_m", .value = "-1"}));
  EXPECT_TRUE(
      is_error(refusal([](auto& o) { o.screening = -1; }), {.field = "screening", .value = "-1"}));
  EXPECT_TRUE(is_error(refusal([](auto& o) { o.samples_per_cell = 0; }),
                       {.field = "samples_per_cell", .value = "0"}));
  EXPECT_TRUE(is_error(refusal([](auto& o) { o.trim_distance_cells = 0; }),
                       {.field = "trim_distance_cells", .value = "0"}));
  // Poisson: 0.2 m and a margin of a tenth in 4096 cells; implicit: a quarter of the spacing.
  const bool is_poisson = GetParam() == SurfaceMethod::poisson;
  const libmap::Error small = refusal([](auto& o) { o.cell_size_m = 1e-5; });
  EXPECT_TRUE(is_error(small, {.field = "cell_size_m", .value = "1e-05"}));
  EXPECT_THAT(small.context().bound, HasSubstr(is_poisson ? ">= 5.37" : ">= 0.0025 m"));
}

TEST_P(Reconstruction, CellsLargerThanTheCloudAreRefused) {
  PointCloud cloud;
  for (int x = 0; x <= 20; ++x)
    for (int y = 0; y <= 10; ++y) {
      cloud.positions.emplace_back(0.05 * x, 0.05 * y, 3.0);
      cloud.normals.emplace_back(0, 0, 1);
    }
  const Error error = graspmap_test::error_of([&] { reconstruct(cloud, cells_of(1.01)); });
  EXPECT_EQ(error.context().field, "cell_size_m");
  EXPECT_EQ(error.context().bound, "<= 1 m");
  EXPECT_LT(surface_area(reconstruct(cloud, cells_of(0.1)).mesh), 1.1);
}

// For an octree deeper than reconstruct_surface allows, PCL cannot allocate its tables.
TEST(PclPoisson, WhatPclThrowsIsSaid) {
  std::vector<SurfaceSample> samples;
  for (int x = -2; x <= 2; ++x)
    for (int y = -2; y <= 2; ++y) {
      const Eigen::Vector2f place = 0.1F * Eigen::Vector2i(x, y).cast<float>();
      samples.push_back({{place.x(), place.y(), 0.0F}, Eigen::Vector3f::UnitZ()});
    }
  const Error error = error_of([&] { solve_poisson(samples, {.depth = 15, .cube_m = 0.5}); });
  EXPECT_EQ(error.kind(), ErrorKind::failed);
  EXPECT_TRUE(
      is_error(error, {.about = "bad_array_new_length", .kind = libmap::ErrorKind::failed}));
}

TEST(PclPoisson, StandardOutputStaysClean) {
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  // Irregular points for which PCL drops faces and prints messages.
  for (const unsigned seed : {0U, 2U, 3U, 4U}) {
    std::mt19937_64 engine(seed);
    std::normal_distribution<double> normal;
    const auto arrow = [&] {
      const double x = normal(engine);
      const double y = normal(engine);
      return Eigen::Vector3d(x, y, normal(engine));
    };
    PointCloud cloud;
    for (int n = 0; n < 3000; ++n) {
      const Eigen::Vector3d out = arrow().normalized();
      cloud.positions.push_back(0.2 * out + 0.04 * arrow());
      cloud.normals.push_back((out + 0.7 * arrow()).normalized().cast<float>());
    }
    SurfaceReconstructionOptions options = cells_of(0.012);
    options.samples_per_cell = 1.0;
    reconstruct_surface(cloud, options);
  }
  std::printf("after");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "after");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

}  // namespace surface_reconstruction_test
}  // namespace libmap
