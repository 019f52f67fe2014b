// Mesh cleaning as a whole: options, invariants, meshes with random and real defects.
#include "libmap/surface/mesh_cleaning.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "libmap/core/parallel.h"
#include "libmap/core/parameters.h"
#include "libmap/core/pose.h"
#include "libmap/io/mesh_io.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/surface_distance.h"
#include "libmap/surface/mesh_report.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/libmap/mesh/surface_samples.h"
#include "tests/libmap/surface/cleaning_checks.h"
#include "tests/support/test_support.h"

namespace mesh_cleaning_test {

using graspmap_test::cleaned;
using graspmap_test::cubes_mesh;
using graspmap_test::error_of;
using graspmap_test::expect_clean;
using graspmap_test::field_of;
using graspmap_test::geodesic_mesh;
using graspmap_test::holes_up_to;
using graspmap_test::is_error;
using graspmap_test::kept_where;
using graspmap_test::mesh_of;
using graspmap_test::repairs;
using graspmap_test::same_geometry;
using graspmap_test::same_mesh;
using graspmap_test::terrain_mesh;
using graspmap_test::uniform;
using graspmap_test::with_values;
using libmap::clean_mesh;
using libmap::MeshCleaningOptions;
using libmap::MeshCleaningResult;
using libmap::report_mesh;
using libmap::TriangleMesh;

TEST(MeshCleaning, CleanMeshesPassUnchanged) {
  const auto waves = [](double x, double y) { return 0.1 * std::sin(5 * x) * std::cos(4 * y); };
  for (const TriangleMesh& clean :
       {graspmap_test::torus_mesh(40, 20, 1.0, 0.3), geodesic_mesh(3, 1.0),
        terrain_mesh(40, 2.0, waves), graspmap_test::slab_with_holes(2)}) {
    const TriangleMesh mesh = with_values(clean);
    const MeshCleaningResult result = cleaned(mesh, {});
    EXPECT_TRUE(same_geometry(result.mesh, mesh));
    EXPECT_EQ(result.mesh.vertex_colors, mesh.vertex_colors);
    EXPECT_EQ(result.mesh.vertex_fields, mesh.vertex_fields);
    EXPECT_EQ(field_of(result.mesh.face_fields, "number").values,
              field_of(mesh.face_fields, "number").values);
    EXPECT_EQ(result.intersecting_triangles + result.cut_edges + result.merged_vertices, 0U);
  }
}

TEST(MeshCleaning, IslandsAreDropped) {
  TriangleMesh mesh = geodesic_mesh(4, 1.0);
  mesh = graspmap_test::join_meshes(mesh, geodesic_mesh(2, 0.2, {3, 0, 0}));  // 0.5 m2
  mesh = graspmap_test::join_meshes(mesh, geodesic_mesh(1, 0.1, {4, 0, 0}));  // 0.1 m2
  MeshCleaningOptions options = repairs();
  options.min_island_area_m2 = 0.2;
  MeshCleaningResult result = cleaned(mesh, options);
  EXPECT_EQ(result.islands, 1U);
  EXPECT_EQ(report_mesh(result.mesh).components, 2U);
  EXPECT_NEAR(result.island_area_m2 + libmap::surface_area(result.mesh), libmap::surface_area(mesh),
              1e-12);
  options.min_island_area_m2 = 0.0;
  options.min_island_fraction = 0.1;
  result = cleaned(mesh, options);
  EXPECT_EQ(result.islands, 2U);
  options.min_island_area_m2 = 100.0;
  const libmap::Error error = error_of([&] { clean_mesh(mesh, options); });
  EXPECT_EQ(error.context().field, "min_island_area_m2");
}

TEST(MeshCleaning, AllStepsTheSameForAnyNumberOfThreads) {
  TriangleMesh mesh = with_values(terrain_mesh(
      50, 1.0, [](double x, double y) { return 0.1 * std::sin(6 * x) + 0.05 * std::cos(9 * y); }));
  for (Eigen::Vector3d& v : mesh.vertices)
    v += 0.002 * Eigen::Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
  mesh = kept_where(mesh, [](const Eigen::Vector3d&) { return uniform(0, 1) < 0.97; });
  MeshCleaningOptions options;
  options.smoothing_iterations = 3;
  options.decimation_error_m = 0.004;
  const TriangleMesh many = clean_mesh(mesh, options).mesh;
  expect_clean(many);
  const libmap::ThreadLimit one(1);
  EXPECT_TRUE(same_mesh(clean_mesh(mesh, options).mesh, many));
}

TEST(MeshCleaning, TheSameWhereverItLies) {
  TriangleMesh mesh = terrain_mesh(60, 2.0, [](double x, double y) { return 0.2 * x * y; });
  for (Eigen::Vector3d& v : mesh.vertices)
    v += 0.012 * Eigen::Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
  mesh = kept_where(mesh, [](const Eigen::Vector3d&) { return uniform(0, 1) < 0.98; });
  libmap::Pose pose = libmap::Pose::Identity();
  pose.translate(Eigen::Vector3d(40.0, -20.0, 5.0));
  pose.rotate(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  const MeshCleaningResult here = clean_mesh(mesh, {});
  const MeshCleaningResult there = clean_mesh(libmap::transform_mesh(mesh, pose), {});
  EXPECT_GT(here.filling.holes, 20U);
  EXPECT_EQ(here.filling.holes, there.filling.holes);
  EXPECT_EQ(here.split_vertices, there.split_vertices);
  EXPECT_EQ(here.intersecting_triangles, there.intersecting_triangles);
  EXPECT_NEAR(libmap::surface_area(here.mesh), libmap::surface_area(there.mesh), 1e-3);
}

// Triangles between random points, which have every type of defect.
TEST(MeshCleaning, RandomTriangles) {
  for (int trial = 0; trial < 150; ++trial) {
    TriangleMesh mesh;
    const auto count = static_cast<std::uint32_t>(uniform(3, trial < 75 ? 12 : 60));
    for (std::uint32_t v = 0; v < count; ++v) {
      Eigen::Vector3d place(uniform(0, 1), uniform(0, 1), uniform(0, 1));
      if (trial % 3 == 0) place = (4.0 * place).array().floor();  // coincident and collinear points
      if (trial % 5 == 0) place.z() = 0.0;
      mesh.vertices.push_back(place);
    }
    const auto vertex = [&] { return static_cast<std::uint32_t>(uniform(0, count - 0.001)); };
    const auto triangles = static_cast<std::size_t>(uniform(1, 4 * count));
    for (std::size_t t = 0; t < triangles; ++t)
      mesh.triangles.push_back({vertex(), vertex(), vertex()});
    mesh = with_values(std::move(mesh));
    const MeshCleaningOptions options = trial % 2 == 0 ? repairs() : holes_up_to(0.8);
    SCOPED_TRACE(trial);
    try {
      const MeshCleaningResult result = clean_mesh(mesh, options);
      expect_clean(result.mesh);
      EXPECT_EQ(result.remaining_intersecting_triangles, 0U);
    } catch (const libmap::Error& error) {
      EXPECT_TRUE(is_error(error, {}));
    }
  }
}

TEST(MeshCleaning, HostileMeshes) {
  EXPECT_TRUE(is_error(error_of([] { clean_mesh({}); }), {.field = "triangles of the mesh"}));
  EXPECT_EQ(error_of([] {
              clean_mesh(mesh_of({{0, 0, 0}}, {{0, 1, 0}}));
            })
                .context()
                .field,
            "vertex of triangle 0");
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity(), 1e300})
    EXPECT_EQ(error_of([&] {
                clean_mesh(mesh_of({{0, 0, 0}, {0, bad, 0}, {1, 0, 0}}, {{0, 1, 2}}));
              })
                  .context()
                  .field,
              "vertex 1");
  TriangleMesh short_field = geodesic_mesh(1, 1.0);
  short_field.vertex_fields.push_back({"f", libmap::ScalarType::float32, {1.0}});
  EXPECT_EQ(error_of([&] { clean_mesh(short_field); }).context().field, "f");
  const auto none_left = [](const TriangleMesh& mesh) {
    EXPECT_TRUE(is_error(error_of([&] { clean_mesh(mesh, repairs()); }),
                         {.field = "number of triangles without area"}));
  };
  none_left(mesh_of({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{0, 1, 2}}));
  none_left(mesh_of({{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}, {{0, 1, 2}}));
  none_left(mesh_of({{0, 0, 0}, {1, 0, 0}}, {{0, 0, 1}, {1, 1, 1}}));
  // One vertex a billion meters away: relative to that, the others coincide.
  TriangleMesh far = geodesic_mesh(2, 1.0);
  far.vertices[0] = {1e9, 0, 0};
  EXPECT_NO_THROW({
    try {
      clean_mesh(far, repairs());
    } catch (const libmap::Error&) {
    }
  });
}

TEST(MeshCleaning, FarFromTheOrigin) {
  TriangleMesh mesh = terrain_mesh(20, 3.0, [](double x, double y) { return 0.2 * x * y; });
  for (Eigen::Vector3d& v : mesh.vertices) v += Eigen::Vector3d(5e5, 4.2e6, 100);
  const TriangleMesh holed = kept_where(mesh, [](const Eigen::Vector3d& p) {
    return (p - Eigen::Vector3d(5e5, 4.2e6, 100)).norm() > 0.4;
  });
  const MeshCleaningResult result = cleaned(holed, holes_up_to(1.5));
  EXPECT_EQ(result.filling.holes, 1U);
  EXPECT_NEAR(libmap::surface_area(result.mesh), libmap::surface_area(mesh), 0.01);
}

TEST(MeshCleaning, ManyIslands) {
  TriangleMesh mesh;
  for (std::uint32_t n = 0; n < 60000; ++n) {
    const Eigen::Vector3d at(n % 250, n / 250, 0);
    for (const Eigen::Vector3d& corner :
         {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.5, 0, 0), Eigen::Vector3d(0, 0.5, 0)})
      mesh.vertices.push_back(at + corner);
    mesh.triangles.push_back({3 * n, 3 * n + 1, 3 * n + 2});
  }
  const MeshCleaningResult result = clean_mesh(mesh, holes_up_to(0.1));
  EXPECT_TRUE(same_geometry(result.mesh, mesh));
}

TEST(MeshCleaning, OptionsOutOfRange) {
  const TriangleMesh mesh = geodesic_mesh(1, 1.0);
  const auto field = [&](const MeshCleaningOptions& options) {
    return error_of([&] { clean_mesh(mesh, options); }).context().field;
  };
  EXPECT_EQ(field({.merge_distance_m = -1}), "merge_distance_m");
  EXPECT_EQ(field({.min_island_area_m2 = std::nan("")}), "min_island_area_m2");
  EXPECT_EQ(field({.min_island_fraction = 1.5}), "min_island_fraction");
  EXPECT_EQ(field({.max_hole_m = -0.1}), "max_hole_m");
  EXPECT_EQ(field({.smoothing_iterations = -1}), "smoothing_iterations");
  EXPECT_EQ(field({.decimation_error_m = -1}), "decimation_error_m");
  MeshCleaningOptions options;
  libmap::ParameterTable table;
  libmap::bind(table, options);
  EXPECT_TRUE(is_error(error_of([&] { table.set("min_island_fraction", "2"); }),
                       {.field = "min_island_fraction", .value = "2", .bound = ">= 0 and <= 1"}));
  table.set("max_hole_m", "0.3");
  EXPECT_EQ(options.max_hole_m, 0.3);
}

TEST(MeshCleaning, WithoutRepair) {
  TriangleMesh mesh = cubes_mesh({{0, 0, 0}, {1, 1, 1}});
  MeshCleaningOptions options = repairs();
  options.repair = false;
  EXPECT_EQ(clean_mesh(mesh, options).mesh.triangles, mesh.triangles);
  options.max_hole_m = 0.1;
  EXPECT_EQ(error_of([&] { clean_mesh(mesh, options); }).context().field, "repair");
}

TEST(MeshCleaning, TrueSiteWithTrianglesKnockedOut) {
  GRASPMAP_REQUIRE_DATA();
  const TriangleMesh whole = kept_where(
      libmap::read_mesh(graspmap_test::data_folder() / "scans/site_ground_truth_mesh.ply").mesh,
      [](const Eigen::Vector3d& p) { return p.head<2>().cwiseAbs().maxCoeff() < 1.0; });
  const TriangleMesh mesh =
      kept_where(whole, [](const Eigen::Vector3d&) { return uniform(0, 1) < 0.995; });
  const std::size_t knocked_out = whole.triangles.size() - mesh.triangles.size();
  MeshCleaningOptions options;
  const MeshCleaningResult result = clean_mesh(mesh, options);
  expect_clean(result.mesh);
  EXPECT_GT(result.filling.holes, knocked_out / 2);
  EXPECT_EQ(result.filling.unfilled, 0U);
  EXPECT_NEAR(libmap::surface_area(result.mesh), libmap::surface_area(whole),
              0.003 * libmap::surface_area(whole));
  const auto distances =
      libmap::distance_statistics(libmap::distances_to_surface(result.mesh.vertices, whole));
  EXPECT_LT(distances.rmse_m, 0.0003);
  EXPECT_LT(distances.max_m, 0.02);
}

}  // namespace mesh_cleaning_test
