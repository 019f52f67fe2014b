// Smoothing and decimation, the last steps of cleaning.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/surface_distance.h"
#include "libmap/surface/mesh_cleaning.h"
#include "tests/libmap/mesh/surface_samples.h"
#include "tests/libmap/surface/cleaning_checks.h"
#include "tests/support/test_support.h"

namespace mesh_smoothing_test {

using graspmap_test::expect_clean;
using graspmap_test::field_of;
using graspmap_test::geodesic_mesh;
using graspmap_test::repairs;
using graspmap_test::terrain_mesh;
using graspmap_test::uniform;
using graspmap_test::with_values;
using libmap::clean_mesh;
using libmap::MeshCleaningOptions;
using libmap::MeshCleaningResult;
using libmap::TriangleMesh;

TEST(MeshSmoothing, LowersNoiseAndKeepsVolume) {
  TriangleMesh mesh = geodesic_mesh(5, 1.0);
  const double volume = libmap::signed_volume(mesh);
  for (Eigen::Vector3d& v : mesh.vertices) v *= 1.0 + 0.004 * uniform(-1, 1);
  const auto roughness = [](const TriangleMesh& m) {
    double sum = 0.0;
    for (const Eigen::Vector3d& v : m.vertices) sum += std::pow(v.norm() - 1.0, 2);
    return std::sqrt(sum / static_cast<double>(m.vertices.size()));
  };
  MeshCleaningOptions options = repairs();
  options.smoothing_iterations = 20;
  const MeshCleaningResult result = clean_mesh(mesh, options);
  expect_clean(result.mesh);
  EXPECT_EQ(result.mesh.triangles, mesh.triangles);
  EXPECT_LT(roughness(result.mesh), 0.4 * roughness(mesh));
  EXPECT_NEAR(libmap::signed_volume(result.mesh), volume, 0.002 * volume);
}

TEST(MeshSmoothing, LeavesBoundaries) {
  TriangleMesh mesh = terrain_mesh(30, 1.0, [](double, double) { return 0.0; });
  for (Eigen::Vector3d& v : mesh.vertices) v.z() += uniform(-0.002, 0.002);
  MeshCleaningOptions options = repairs();
  options.smoothing_iterations = 10;
  const TriangleMesh smooth = clean_mesh(mesh, options).mesh;
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const bool is_border =
        std::max(std::abs(mesh.vertices[v].x()), std::abs(mesh.vertices[v].y())) > 0.4999;
    EXPECT_EQ(smooth.vertices[v] == mesh.vertices[v], is_border);
  }
}

// Largest distance of corners and inner points of the triangles of `a` to the surface of `b`.
double sampled_distance(const TriangleMesh& a, const TriangleMesh& b) {
  std::vector<Eigen::Vector3d> points;
  constexpr int steps = 6;
  for (const libmap::Triangle& t : a.triangles)
    for (int i = 0; i <= steps; ++i)
      for (int j = 0; i + j <= steps; ++j)
        points.emplace_back(
            (i * a.vertices[t[0]] + j * a.vertices[t[1]] + (steps - i - j) * a.vertices[t[2]]) /
            steps);
  double largest = 0.0;
  for (const double d : libmap::distances_to_surface(points, b)) largest = std::max(largest, d);
  return largest;
}

TEST(MeshDecimation, KeepsItsBound) {
  const auto rocks = [](double x, double y) {
    return 0.1 * std::sin(4 * x) * std::cos(5 * y) + 0.003 * std::sin(31 * x + 17 * y);
  };
  TriangleMesh mesh = with_values(terrain_mesh(60, 1.0, rocks));
  for (Eigen::Vector3d& v : mesh.vertices) v.z() += uniform(-0.0002, 0.0002);
  for (const double bound : {0.001, 0.01}) {
    MeshCleaningOptions options = repairs();
    options.decimation_error_m = bound;
    const MeshCleaningResult result = clean_mesh(mesh, options);
    expect_clean(result.mesh);
    EXPECT_GT(result.decimation.removed_triangles, mesh.triangles.size() / 3);
    EXPECT_EQ(result.decimation.removed_triangles + result.mesh.triangles.size(),
              mesh.triangles.size());
    EXPECT_LE(result.decimation.deviation_m, bound);
    EXPECT_GT(result.decimation.deviation_m, 0.3 * bound);
    EXPECT_LE(sampled_distance(result.mesh, mesh), result.decimation.deviation_m + 1e-12);
    EXPECT_LE(sampled_distance(mesh, result.mesh), result.decimation.deviation_m + 1e-12);
    // Remaining vertices keep their values.
    const libmap::SurfaceDistance original(mesh);
    const auto& height = field_of(result.mesh.vertex_fields, "height").values;
    for (std::size_t v = 0; v < result.mesh.vertices.size(); ++v)
      ASSERT_NEAR(height[v], result.mesh.vertices[v].z() + 2 * result.mesh.vertices[v].x(), 0.0006);
    EXPECT_EQ(result.mesh.vertex_colors.size(), result.mesh.vertices.size());
    EXPECT_EQ(field_of(result.mesh.face_fields, "number").values.size(),
              result.mesh.triangles.size());
  }
}

TEST(MeshDecimation, FlatGroundNeedsFewTriangles) {
  const TriangleMesh mesh = terrain_mesh(40, 1.0, [](double, double) { return 1.0; });
  MeshCleaningOptions options = repairs();
  options.decimation_error_m = 0.002;
  const MeshCleaningResult result = clean_mesh(mesh, options);
  EXPECT_LT(result.mesh.triangles.size(), 100U);
  EXPECT_NEAR(libmap::surface_area(result.mesh), 1.0, 0.004);
}

}  // namespace mesh_smoothing_test
