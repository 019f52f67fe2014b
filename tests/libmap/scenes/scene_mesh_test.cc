// Meshes against closed-form areas, and the exact distance of every vertex.
#include "libmap/scenes/scene_mesh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>

#include "libmap/scenes/scene_geometry.h"
#include "libmap/scenes/scene_sampling.h"
#include "scene_test_support.h"
#include "tests/libmap/scenes/scene_query.h"
#include "tests/support/test_support.h"
#include "tests/support/thesis_scene.h"

namespace libmap {
namespace scene_mesh_test {

using graspmap_test::error_of;
using graspmap_test::ground_plane;
using graspmap_test::is_error;
using graspmap_test::mixed_scene;
using graspmap_test::pi;
using graspmap_test::scene_of;
using graspmap_test::thesis_primitive_scene;
using graspmap_test::uniform;

double area_of_shape(const TriangleMesh& mesh, std::size_t shape) {
  double area = 0.0;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
    if (mesh.face_fields[0].values[i] == static_cast<double>(shape))
      area += 0.5 * area_normal(mesh, mesh.triangles[i]).norm();
  return area;
}

double visible_area(const SceneShape& shape) {
  if (const auto* sphere = std::get_if<Sphere>(&shape.geometry))
    return 2.0 * pi * sphere->radius_m * sphere->radius_m;
  if (const auto* capsule = std::get_if<Capsule>(&shape.geometry))
    return pi * capsule->radius_m * capsule->length_m;
  const Cone cone = std::get<Cone>(shape.geometry);
  return pi * cone.radius_m * std::hypot(cone.radius_m, cone.height_m);
}

double footprint_area(const SceneShape& shape) {
  if (const auto* sphere = std::get_if<Sphere>(&shape.geometry))
    return pi * sphere->radius_m * sphere->radius_m;
  if (const auto* capsule = std::get_if<Capsule>(&shape.geometry))
    return pi * capsule->radius_m * capsule->radius_m +
           2.0 * capsule->radius_m * (capsule->length_m - 2.0 * capsule->radius_m);
  const Cone cone = std::get<Cone>(shape.geometry);
  return pi * cone.radius_m * cone.radius_m;
}

struct EdgeUse {
  int forward = 0;
  int backward = 0;
};
std::map<std::pair<std::uint32_t, std::uint32_t>, EdgeUse> edges_of(const TriangleMesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, EdgeUse> edges;
  for (const Triangle& triangle : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = triangle[k];
      const std::uint32_t b = triangle[(k + 1) % 3];
      ++(a < b ? edges[{a, b}].forward : edges[{b, a}].backward);
    }
  }
  return edges;
}

TEST(SceneMesh, areas_of_the_thesis_scene_converge_to_the_closed_forms) {
  const PrimitiveScene scene = thesis_primitive_scene();
  const TriangleMesh coarse = scene_mesh(scene, {.edge_length_m = 0.04, .chord_error_m = 4e-3});
  const TriangleMesh fine = scene_mesh(scene, {.edge_length_m = 0.01, .chord_error_m = 2.5e-4});
  double ground = 9.0;
  for (std::size_t i = 1; i < scene.shapes.size(); ++i) {
    const double exact = visible_area(scene.shapes[i]);
    const double coarse_error = std::abs(area_of_shape(coarse, i) / exact - 1.0);
    const double fine_error = std::abs(area_of_shape(fine, i) / exact - 1.0);
    EXPECT_LT(fine_error, 0.012) << i;
    EXPECT_LT(fine_error, 0.25 * coarse_error + 1e-9) << i;
    ground -= footprint_area(scene.shapes[i]);
  }
  EXPECT_NEAR(area_of_shape(fine, 0), ground, 2e-3);
  EXPECT_NEAR(area_of_shape(coarse, 0), ground, 2e-2);
}

TEST(SceneMesh, the_thesis_scene_is_closed_but_for_the_outline_of_its_plane) {
  const TriangleMesh mesh = scene_mesh(thesis_primitive_scene(), {.edge_length_m = 0.02});
  mesh.check();
  std::size_t outline = 0;
  for (const auto& [edge, use] : edges_of(mesh)) {
    ASSERT_LE(use.forward, 1);
    ASSERT_LE(use.backward, 1);
    if (use.forward + use.backward == 2) continue;
    const Eigen::Vector3d& a = mesh.vertices[edge.first];
    const Eigen::Vector3d& b = mesh.vertices[edge.second];
    EXPECT_TRUE((std::abs(a.x()) == 1.5 && a.x() == b.x()) ||
                (std::abs(a.y()) == 1.5 && a.y() == b.y()))
        << a.transpose() << " to " << b.transpose();
    ++outline;
  }
  EXPECT_EQ(outline, 600U);
  std::set<std::uint32_t> used;
  for (const Triangle& triangle : mesh.triangles) used.insert(triangle.begin(), triangle.end());
  EXPECT_EQ(used.size(), mesh.vertices.size());
  // Euler: a disc.
  const auto edges = edges_of(mesh).size();
  EXPECT_EQ(mesh.vertices.size() + mesh.triangles.size() - edges, 1U);
}

// The solid whose mesh bears this shape's index: a bump's is the ground.
const SceneSolid& solid_of(const SceneGeometry& geometry, double shape) {
  for (const SceneSolid& solid : geometry.solids())
    if (solid.shape == static_cast<int>(shape)) return solid;
  return *geometry.ground();
}

void expect_on_surface_and_outward(const PrimitiveScene& scene, const SceneMeshOptions& options,
                                   double exact_fraction) {
  const SceneGeometry geometry(scene);
  const TriangleMesh mesh = scene_mesh(scene, options);
  mesh.check();
  const std::vector<double>& shapes = mesh.face_fields[0].values;
  EXPECT_EQ(std::set<double>(shapes.begin(), shapes.end()).size(), scene.shapes.size());
  std::size_t exact = 0;
  for (const Eigen::Vector3d& vertex : mesh.vertices) {
    const double distance = std::abs(graspmap_test::distance_to_scene(geometry, vertex));
    EXPECT_LT(distance, 2.0 * options.chord_error_m);
    exact += distance < 2e-9 ? 1 : 0;
  }
  EXPECT_GE(static_cast<double>(exact), exact_fraction * static_cast<double>(mesh.vertices.size()));
  const double step = 0.1 * options.edge_length_m;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Triangle& triangle = mesh.triangles[i];
    const Eigen::Vector3d normal = area_normal(mesh, triangle);
    if (normal.norm() < 1e-3 * options.edge_length_m * options.edge_length_m) continue;
    const Eigen::Vector3d center =
        (mesh.vertices[triangle[0]] + mesh.vertices[triangle[1]] + mesh.vertices[triangle[2]]) /
        3.0;
    const SceneSolid& solid = solid_of(geometry, shapes[i]);
    EXPECT_GT(geometry.signed_distance(solid, center + step * normal.normalized()), 0.0);
    EXPECT_LT(geometry.signed_distance(solid, center - step * normal.normalized()), 0.0);
    EXPECT_GT(graspmap_test::distance_to_scene(geometry, center), -step);
  }
}

TEST(SceneMesh, vertices_lie_on_the_union_and_triangles_look_outward) {
  expect_on_surface_and_outward(thesis_primitive_scene(), {.edge_length_m = 0.02}, 1.0);
  expect_on_surface_and_outward(mixed_scene(), {.edge_length_m = 0.01}, 0.999);
}

TEST(SceneMesh, area_agrees_with_the_number_of_samples_where_shapes_overlap) {
  const PrimitiveScene scene = mixed_scene();
  const TriangleMesh mesh = scene_mesh(scene, {.edge_length_m = 0.01});
  const PointCloud cloud = sample_scene(scene, {.spacing_m = 0.004}).cloud;
  EXPECT_NEAR(surface_area(mesh), static_cast<double>(cloud.size()) * 0.004 * 0.004,
              0.01 * surface_area(mesh));
  for (std::size_t shape = 0; shape < scene.shapes.size(); ++shape) {
    const auto& shapes = graspmap_test::values_of(cloud, "shape");
    const auto count =
        static_cast<double>(std::count(shapes.begin(), shapes.end(), static_cast<double>(shape)));
    EXPECT_NEAR(area_of_shape(mesh, shape), count * 0.004 * 0.004, 0.005) << shape;
  }
}

TEST(SceneMesh, area_agrees_with_the_number_of_samples_on_random_scenes) {
  for (int trial = 0; trial < 15; ++trial) {
    const PrimitiveScene scene = graspmap_test::random_scene();
    const TriangleMesh mesh = scene_mesh(scene, {.edge_length_m = 0.02});
    mesh.check();
    const PointCloud cloud = sample_scene(scene, {.spacing_m = 0.008}).cloud;
    const double area = static_cast<double>(cloud.size()) * 0.008 * 0.008;
    EXPECT_NEAR(surface_area(mesh), area, 0.003 * area) << trial;
  }
}

TEST(SceneMesh, of_two_equal_balls_one_is_seen) {
  const TriangleMesh mesh =
      scene_mesh(scene_of({{Sphere{0.2}, {}, {}}, {Sphere{0.2}, {}, {}}}), {.edge_length_m = 0.02});
  EXPECT_NEAR(area_of_shape(mesh, 0), 4.0 * pi * 0.04, 0.005);
  EXPECT_EQ(area_of_shape(mesh, 1), 0.0);
}

TEST(SceneMesh, a_solid_in_the_air_is_closed_and_has_its_volume) {
  const auto volume = [](ShapeGeometry geometry) {
    const TriangleMesh mesh = scene_mesh(
        scene_of({{std::move(geometry), {.x_m = 1.0, .z_m = 2.0, .roll_deg = 30.0}, {}}}),
        {.edge_length_m = 0.01, .chord_error_m = 5e-5});
    return signed_volume(mesh);
  };
  EXPECT_NEAR(volume(Sphere{0.2}) / (4.0 / 3.0 * pi * 0.008), 1.0, 3e-3);
  EXPECT_NEAR(volume(Capsule{0.1, 0.5}) / (pi * 0.01 * (0.3 + 4.0 / 3.0 * 0.1)), 1.0, 5e-3);
  EXPECT_NEAR(volume(Cone{0.2, 0.3}) / (pi * 0.04 * 0.1), 1.0, 3e-3);
  EXPECT_NEAR(volume(Cylinder{0.2, 0.3}) / (pi * 0.04 * 0.3), 1.0, 3e-3);
  EXPECT_NEAR(volume(Box{0.1, 0.2, 0.3}), 0.006, 1e-12);
}

TEST(SceneMesh, solids_on_bent_ground_share_their_edges_with_it_at_any_turn) {
  for (int trial = 0; trial < 60; ++trial) {
    const Placement placement{
        .z_m = -0.1, .roll_deg = uniform(-20.0, 20.0), .yaw_deg = uniform(0.0, 180.0)};
    const std::vector<ShapeGeometry> choices = {Box{0.3, 0.2, 0.3}, Cone{0.2, 0.4},
                                                Cylinder{0.15, 0.3}};
    const PrimitiveScene scene =
        scene_of({ground_plane(1.0),
                  {choices[static_cast<std::size_t>(trial % 3)], placement, {}},
                  {Bump{0.1, 0.45, BumpProfile::cosine}, {.x_m = 0.1}, {}}});
    const TriangleMesh mesh = scene_mesh(scene, {.edge_length_m = 0.04, .chord_error_m = 0.001});
    std::size_t open = 0;
    for (const auto& [edge, use] : edges_of(mesh)) {
      if (use.forward == 1 && use.backward == 1) continue;
      for (const std::uint32_t vertex : {edge.first, edge.second})
        open += mesh.vertices[vertex].head<2>().cwiseAbs().maxCoeff() < 0.5 - 1e-12 ? 1 : 0;
    }
    EXPECT_EQ(open, 0U) << trial;
  }
}

TEST(SceneMesh, refuses_what_it_cannot_do) {
  const auto message = [](const SceneMeshOptions& options) {
    return error_of([&] { scene_mesh(thesis_primitive_scene(), options); });
  };
  EXPECT_TRUE(
      is_error(message({.edge_length_m = 1e-5}), {.field = "edge_length_m", .value = "1e-05"}));
}

TEST(SceneMesh, is_the_same_on_every_run) {
  const TriangleMesh first = scene_mesh(mixed_scene(), {.edge_length_m = 0.03});
  const TriangleMesh second = scene_mesh(mixed_scene(), {.edge_length_m = 0.03});
  EXPECT_EQ(first.vertices, second.vertices);
  EXPECT_EQ(first.triangles, second.triangles);
}

}  // namespace scene_mesh_test
}  // namespace libmap
