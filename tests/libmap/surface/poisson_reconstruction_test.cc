#include "libmap/surface/poisson_reconstruction.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <thread>

#include "libmap/cloud/cloud_io.h"
#include "libmap/core/parallel.h"
#include "libmap/mesh/surface_distance.h"
#include "libmap/surface/mesh_cleaning.h"
#include "libmap/surface/mesh_report.h"
#include "libmap/surface/pcl_poisson.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace poisson_reconstruction_test {

using graspmap_test::error_of;
using graspmap_test::random_engine;
using graspmap_test::uniform;
using ::testing::HasSubstr;

constexpr double pi = std::numbers::pi;

// Nearly even on a sphere (Fibonacci lattice), about `spacing_m` apart.
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

PoissonReconstructionOptions cells_of(double cell_size_m) {
  PoissonReconstructionOptions options;
  options.cell_size_m = cell_size_m;
  return options;
}

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

TEST(PoissonReconstruction, Sphere) {
  constexpr double radius = 0.25;
  const PoissonReconstructionResult result = reconstruct_surface(ball(radius, 0.01));
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

TEST(PoissonReconstruction, CellsHaveTheWantedSize) {
  const PointCloud cloud = ball(0.25, 0.005);
  double last = 0.0;
  for (const double cell : {0.01, 0.013, 0.02, 0.04}) {
    const PoissonReconstructionResult result = reconstruct_surface(cloud, cells_of(cell));
    EXPECT_EQ(result.cell_size_m, cell);
    // Marching cubes makes edges a little shorter than its cells.
    const double edge = report_mesh(result.mesh).edge_lengths.median_m;
    EXPECT_GT(edge, 0.6 * cell);
    EXPECT_LT(edge, 1.3 * cell);
    EXPECT_GT(edge, last);
    last = edge;
  }
}

TEST(PoissonReconstruction, PlaneIsFlatAndEndsWithThePoints) {
  for (const double slope : {0.0, 0.4}) {
    const PoissonReconstructionResult result =
        reconstruct_surface(plane(0.6, 0.01, slope), cells_of(0.01));
    ASSERT_FALSE(result.mesh.triangles.empty());
    double reach = 0.0;
    for (const Eigen::Vector3d& vertex : result.mesh.vertices) {
      const double out = vertex.head<2>().cwiseAbs().maxCoeff();
      EXPECT_NEAR(vertex.z(), slope * vertex.x(), out < 0.29 ? 0.0005 : 0.004);
      reach = std::max(reach, out);
    }
    EXPECT_GT(reach, 0.3 - 0.01);
    EXPECT_LT(reach, 0.3 + 0.025);
    EXPECT_GT(result.trimmed_triangles, 0U);
    const MeshReport report = cleaned_report(result.mesh);
    EXPECT_EQ(report.components, 1U);
    EXPECT_EQ(report.boundaries.size(), 1U);
  }
}

TEST(PoissonReconstruction, TwoBallsStayApart) {
  const PointCloud cloud = joined(ball(0.1, 0.008, {-0.2, 0, 0}), ball(0.1, 0.008, {0.2, 0, 0}));
  const MeshReport report = cleaned_report(reconstruct_surface(cloud).mesh);
  EXPECT_EQ(report.components, 2U);
  EXPECT_TRUE(report.is_watertight());
  EXPECT_NEAR(report.area_m2, 8 * pi * 0.01, 0.005);
}

TEST(PoissonReconstruction, OpenHalfBallGetsNoLidAndNoBalloon) {
  const PointCloud whole = ball(0.25, 0.01);
  PointCloud half;
  for (std::size_t n = 0; n < whole.size(); ++n)
    if (whole.positions[n].z() > 0) {
      half.positions.push_back(whole.positions[n]);
      half.normals.push_back(whole.normals[n]);
    }
  const TriangleMesh mesh = reconstruct_surface(half, cells_of(0.01)).mesh;
  for (const Eigen::Vector3d& vertex : mesh.vertices) {
    EXPECT_GT(vertex.z(), -0.03);
    EXPECT_NEAR(vertex.norm(), 0.25, 0.006);
  }
  EXPECT_NEAR(surface_area(mesh), 2 * pi * 0.25 * 0.25, 0.05);
  EXPECT_EQ(report_mesh(mesh).boundaries.size(), 1U);
}

TEST(PoissonReconstruction, GapsAreLeftOpen) {
  PointCloud cloud;
  const PointCloud full = plane(0.6, 0.01);
  for (std::size_t n = 0; n < full.size(); ++n)
    if (full.positions[n].head<2>().norm() > 0.1) {
      cloud.positions.push_back(full.positions[n]);
      cloud.normals.push_back(full.normals[n]);
    }
  const TriangleMesh mesh = reconstruct_surface(cloud, cells_of(0.01)).mesh;
  EXPECT_EQ(cleaned_report(mesh).boundaries.size(), 2U);  // the gap is wider than holes are filled
  for (const Eigen::Vector3d& vertex : mesh.vertices)
    EXPECT_GT(vertex.head<2>().norm(), 0.1 - 0.025);
}

TEST(PoissonReconstruction, NoiseIsAveraged) {
  PointCloud cloud = ball(0.25, 0.005);
  std::normal_distribution<double> noise(0.0, 0.003);
  double squares = 0.0;
  for (Eigen::Vector3d& position : cloud.positions) {
    const double off = noise(random_engine());
    position *= 1 + off / 0.25;
    squares += off * off;
  }
  const double of_points = std::sqrt(squares / static_cast<double>(cloud.size()));
  const TriangleMesh mesh = reconstruct_surface(cloud, cells_of(0.015)).mesh;
  EXPECT_LT(rms_off_sphere(mesh, 0.25), 0.6 * of_points);
}

TEST(PoissonReconstruction, UncertainPointsCountForLess) {
  // Every other point 8 mm too far out, and known to be bad.
  PointCloud cloud = ball(0.25, 0.006);
  ScalarField& errors = cloud.add_field("expected_error", ScalarType::float32);
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    const bool is_bad = n % 3 == 0;
    if (is_bad) cloud.positions[n] *= 1 + 0.008 / 0.25;
    errors.values[n] = is_bad ? 0.01 : 0.001;
  }
  PoissonReconstructionOptions options = cells_of(0.012);
  const double weighted = rms_off_sphere(reconstruct_surface(cloud, options).mesh, 0.25);
  options.weigh_by_error = false;
  const double equal = rms_off_sphere(reconstruct_surface(cloud, options).mesh, 0.25);
  EXPECT_LT(weighted, 0.6 * equal);
}

TEST(PoissonReconstruction, SameBytesForThreadsAndOrder) {
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
    return reconstruct_surface(cloud).mesh;
  }();
  std::vector<std::size_t> order(cloud.size());
  std::iota(order.begin(), order.end(), 0U);
  std::shuffle(order.begin(), order.end(), random_engine());
  PointCloud shuffled = select_points(cloud, order);
  for (PointCloud* other : {&cloud, &shuffled})
    for (const unsigned threads : {2U, 4U}) {
      const ThreadLimit limit(threads);
      const TriangleMesh mesh = reconstruct_surface(*other).mesh;
      EXPECT_EQ(mesh.vertices, first.vertices);
      EXPECT_EQ(mesh.triangles, first.triangles);
      EXPECT_EQ(mesh.vertex_normals, first.vertex_normals);
      EXPECT_EQ(mesh.vertex_colors, first.vertex_colors);
      EXPECT_EQ(mesh.vertex_fields, first.vertex_fields);
    }
}

TEST(PoissonReconstruction, CallsFromSeveralThreadsDoNotDisturbEachOther) {
  const PointCloud cloud = ball(0.1, 0.01);
  const TriangleMesh alone = reconstruct_surface(cloud).mesh;
  std::array<TriangleMesh, 3> meshes;
  std::vector<std::thread> threads;
  for (TriangleMesh& mesh : meshes)
    threads.emplace_back([&] { mesh = reconstruct_surface(cloud).mesh; });
  for (std::thread& thread : threads) thread.join();
  for (const TriangleMesh& mesh : meshes) EXPECT_EQ(mesh.vertices, alone.vertices);
}

TEST(PoissonReconstruction, FarAway) {
  const Eigen::Vector3d far(5e5, 4.1e6, 120);
  const TriangleMesh near_mesh = reconstruct_surface(ball(0.2, 0.01), cells_of(0.01)).mesh;
  const TriangleMesh far_mesh = reconstruct_surface(ball(0.2, 0.01, far), cells_of(0.01)).mesh;
  EXPECT_NEAR(static_cast<double>(far_mesh.vertices.size()),
              static_cast<double>(near_mesh.vertices.size()),
              0.02 * static_cast<double>(near_mesh.vertices.size()));
  for (const Eigen::Vector3d& vertex : far_mesh.vertices)
    EXPECT_NEAR((vertex - far).norm(), 0.2, 0.001);
}

TEST(PoissonReconstruction, ColorsAndFieldsAreCarriedOver) {
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
  const TriangleMesh mesh = reconstruct_surface(cloud, cells_of(0.01)).mesh;
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

TEST(PoissonReconstruction, PointsWithoutANormalAreLeftOutAndCounted) {
  PointCloud cloud = ball(0.2, 0.01);
  for (std::size_t n = 0; n < cloud.size(); n += 10) cloud.normals[n].setZero();
  cloud.normals[1].setConstant(std::numeric_limits<float>::quiet_NaN());
  const PoissonReconstructionResult result = reconstruct_surface(cloud, cells_of(0.01));
  EXPECT_EQ(result.dropped_points, (cloud.size() + 9) / 10 + 1);
  EXPECT_LT(rms_off_sphere(result.mesh, 0.2), 0.001);
}

TEST(PoissonReconstruction, RepeatedPointsChangeNothing) {
  const PointCloud once = ball(0.2, 0.01);
  PointCloud thrice = joined(once, joined(once, once));
  const PoissonReconstructionResult one = reconstruct_surface(once);
  const PoissonReconstructionResult three = reconstruct_surface(thrice);
  EXPECT_EQ(three.samples, one.samples);
  EXPECT_EQ(three.spacing_m, one.spacing_m);
  EXPECT_NEAR(surface_area(three.mesh), surface_area(one.mesh), 1e-4);
}

TEST(PoissonReconstruction, LengthsOfNormalsDoNotCount) {
  PointCloud cloud = ball(0.2, 0.01);
  const TriangleMesh unit = reconstruct_surface(cloud).mesh;
  for (Eigen::Vector3f& normal : cloud.normals) normal *= 0.5F;
  EXPECT_EQ(reconstruct_surface(cloud).mesh.vertices, unit.vertices);
}

TEST(PoissonReconstruction, CloudsThatAreTooThin) {
  const auto refusal = [](const PointCloud& cloud) {
    return std::string(error_of([&] { reconstruct_surface(cloud); }).what());
  };
  EXPECT_THAT(refusal({}), HasSubstr("no normals"));
  PointCloud cloud = plane(0.1, 0.01);
  cloud.normals.clear();
  EXPECT_THAT(refusal(cloud), HasSubstr("no normals"));
  cloud.normals.assign(cloud.size(), Eigen::Vector3f::Zero());
  EXPECT_THAT(refusal(cloud), HasSubstr("no point of the cloud has a normal"));
  PointCloud two;
  two.positions = {{0, 0, 0}, {1, 0, 0}, {1, 0, 0}};
  two.normals.assign(3, Eigen::Vector3f::UnitZ());
  EXPECT_THAT(refusal(two), HasSubstr("2 places: too few points"));
  PointCloud line;
  for (int n = 0; n < 100; ++n) line.positions.emplace_back(0.01 * n, 1.0, 2.0);
  line.normals.assign(100, Eigen::Vector3f::UnitZ());
  EXPECT_THAT(refusal(line), HasSubstr("on a line"));
}

TEST(PoissonReconstruction, AFewPointsDoNoHarm) {
  for (const int count : {3, 4, 10}) {
    PointCloud cloud;
    for (int n = 0; n < count; ++n)
      cloud.positions.emplace_back(uniform(0, 1), uniform(0, 1), uniform(0, 1));
    cloud.normals.assign(cloud.size(), Eigen::Vector3f::UnitZ());
    EXPECT_NO_THROW(reconstruct_surface(cloud).mesh.check());
  }
}

TEST(PoissonReconstruction, OptionsOutOfTheirRangesAreNamed) {
  const PointCloud cloud = plane(0.2, 0.01);
  const auto refusal = [&](const auto& change) {
    PoissonReconstructionOptions options;
    change(options);
    return std::string(error_of([&] { reconstruct_surface(cloud, options); }).what());
  };
  EXPECT_THAT(refusal([](auto& o) { o.cell_size_m = -1; }), HasSubstr("cell_size_m is -1"));
  EXPECT_THAT(refusal([](auto& o) { o.screening = -1; }), HasSubstr("screening is -1"));
  EXPECT_THAT(refusal([](auto& o) { o.samples_per_cell = 0; }), HasSubstr("samples_per_cell is 0"));
  EXPECT_THAT(refusal([](auto& o) { o.trim_distance_cells = 0; }),
              HasSubstr("trim_distance_cells is 0"));
  // 0.2 m and a margin of a tenth in 4096 cells.
  EXPECT_THAT(refusal([](auto& o) { o.cell_size_m = 1e-5; }),
              ::testing::AllOf(HasSubstr("cell_size_m is 1e-05"), HasSubstr(">= 5.37"),
                               HasSubstr("deeper than 12")));
}

TEST(PoissonReconstruction, CellsLargerThanTheCloudAreRefused) {
  PointCloud cloud;
  for (int x = 0; x <= 20; ++x)
    for (int y = 0; y <= 10; ++y) {
      cloud.positions.emplace_back(0.05 * x, 0.05 * y, 3.0);
      cloud.normals.emplace_back(0, 0, 1);
    }
  const Error error = graspmap_test::error_of([&] { reconstruct_surface(cloud, cells_of(1.01)); });
  EXPECT_EQ(error.context().field, "cell_size_m");
  EXPECT_EQ(error.context().bound, "<= 1 m");
  EXPECT_LT(surface_area(reconstruct_surface(cloud, cells_of(0.1)).mesh), 1.1);
}

// Deeper than reconstruct_surface lets it go, PCL's tables have no size.
TEST(PoissonReconstruction, WhatPclThrowsIsSaid) {
  std::vector<PoissonSample> samples;
  for (int x = -2; x <= 2; ++x)
    for (int y = -2; y <= 2; ++y) {
      const Eigen::Vector2f place = 0.1F * Eigen::Vector2i(x, y).cast<float>();
      samples.push_back({{place.x(), place.y(), 0.0F}, Eigen::Vector3f::UnitZ()});
    }
  const Error error = error_of([&] { solve_poisson(samples, {.depth = 15, .cube_m = 0.5}); });
  EXPECT_EQ(error.kind(), ErrorKind::failed);
  EXPECT_THAT(error.what(), HasSubstr("Poisson reconstruction failed: std::bad_array_new_length"));
}

TEST(PoissonReconstruction, StandardOutputStaysClean) {
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  // A tangle in which PCL drops faces and says so.
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
    PoissonReconstructionOptions options = cells_of(0.012);
    options.samples_per_cell = 1.0;
    reconstruct_surface(cloud, options);
  }
  std::printf("after");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "after");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

}  // namespace poisson_reconstruction_test
}  // namespace libmap
