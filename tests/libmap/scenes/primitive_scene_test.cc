// Exact queries against closed forms, numeric derivatives and a slow search.
#include "libmap/scenes/primitive_scene.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>

#include "libmap/scenes/scene_geometry.h"
#include "scene_test_support.h"
#include "tests/libmap/scenes/scene_query.h"
#include "tests/support/test_support.h"
#include "tests/support/thesis_scene.h"

namespace libmap {
namespace primitive_scene_test {

using graspmap_test::error_of;
using graspmap_test::from_above;
using graspmap_test::ground_plane;
using graspmap_test::is_error;
using graspmap_test::mixed_scene;
using graspmap_test::pi;
using graspmap_test::scene_of;
using graspmap_test::thesis_primitive_scene;
using graspmap_test::uniform;

TEST(ThesisScene, holds_the_published_shapes_apart_from_each_other) {
  const PrimitiveScene scene = thesis_primitive_scene();
  ASSERT_EQ(scene.shapes.size(), 16U);
  EXPECT_EQ(std::get<Plane>(scene.shapes[0].geometry), (Plane{3.0, 3.0}));
  for (std::size_t i = 0; i < 5; ++i) {
    const double k = static_cast<double>(i);
    EXPECT_NEAR(std::get<Sphere>(scene.shapes[1 + i].geometry).radius_m, 0.05 * (k + 1), 1e-15);
    const Capsule capsule = std::get<Capsule>(scene.shapes[6 + i].geometry);
    EXPECT_NEAR(2.0 * capsule.radius_m, 0.1 + 0.05 * k, 1e-15);
    EXPECT_NEAR(capsule.length_m, 0.2 + 0.1 * k, 1e-15);
    const Cone cone = std::get<Cone>(scene.shapes[11 + i].geometry);
    EXPECT_EQ(cone.radius_m, 0.15);
    EXPECT_NEAR(cone.height_m, 0.05 + 0.0375 * k, 1e-15);
  }
  // Half extents in x and y: shapes must not touch, and must lie on the plane.
  const auto half_extent = [&](std::size_t i) -> Eigen::Vector2d {
    if (i < 6)
      return Eigen::Vector2d::Constant(std::get<Sphere>(scene.shapes[i].geometry).radius_m);
    if (i > 10) return Eigen::Vector2d::Constant(0.15);
    const Capsule capsule = std::get<Capsule>(scene.shapes[i].geometry);
    return {capsule.radius_m, 0.5 * capsule.length_m};
  };
  for (std::size_t i = 1; i < 16; ++i) {
    const Eigen::Vector2d a(scene.shapes[i].placement.x_m, scene.shapes[i].placement.y_m);
    EXPECT_LT((a.cwiseAbs() + half_extent(i)).maxCoeff(), 1.5);
    for (std::size_t j = i + 1; j < 16; ++j) {
      const Eigen::Vector2d b(scene.shapes[j].placement.x_m, scene.shapes[j].placement.y_m);
      EXPECT_GT(((a - b).cwiseAbs() - half_extent(i) - half_extent(j)).maxCoeff(), 0.04);
    }
  }
}

TEST(TruthFromAbove, is_the_closed_form_on_the_thesis_scene) {
  const SceneGeometry geometry(thesis_primitive_scene());
  // Hemisphere of radius 0.25 at (-1, -1).
  const SurfaceTruth ball = *from_above(geometry, -0.9, -1.1);
  EXPECT_EQ(ball.shape, 5);
  EXPECT_NEAR(ball.height, std::sqrt(0.25 * 0.25 - 0.02), 1e-14);
  EXPECT_NEAR((ball.normal - Eigen::Vector3d(0.1, -0.1, ball.height) / 0.25).norm(), 0.0, 1e-13);
  EXPECT_DOUBLE_EQ(ball.curvature_min, 4.0);
  EXPECT_DOUBLE_EQ(ball.curvature_max, 4.0);
  // Half-capsule 0.3 x 0.6 at (-1, 0): straight for |y| < 0.15, round beyond.
  const SurfaceTruth side = *from_above(geometry, -0.91, 0.1);
  EXPECT_EQ(side.shape, 10);
  EXPECT_NEAR(side.height, 0.12, 1e-14);
  EXPECT_NEAR((side.normal - Eigen::Vector3d(0.6, 0.0, 0.8)).norm(), 0.0, 1e-13);
  EXPECT_EQ(side.curvature_min, 0.0);
  EXPECT_NEAR(side.curvature_max, 1.0 / 0.15, 1e-12);
  const SurfaceTruth end = *from_above(geometry, -1.0, -0.24);
  EXPECT_NEAR(end.height, 0.12, 1e-14);
  EXPECT_NEAR(end.curvature_min, 1.0 / 0.15, 1e-12);
  EXPECT_NEAR((end.normal - Eigen::Vector3d(0.0, -0.6, 0.8)).norm(), 0.0, 1e-13);
  // Cone 0.15 x 0.2 at (-1, 1): at distance 0.05 of the axis it is 2/15 high and inclined by 3:4.
  const SurfaceTruth cone = *from_above(geometry, -1.0, 1.05);
  EXPECT_EQ(cone.shape, 15);
  EXPECT_NEAR(cone.height, 2.0 / 15.0, 1e-14);
  EXPECT_NEAR((cone.normal - Eigen::Vector3d(0.0, 0.8, 0.6)).norm(), 0.0, 1e-13);
  EXPECT_NEAR(cone.curvature_min, 0.0, 1e-15);
  EXPECT_NEAR(cone.curvature_max, 0.8 / 0.05, 1e-11);
  const SurfaceTruth ground = *from_above(geometry, 1.3, 0.4);
  EXPECT_EQ(ground.shape, 0);
  EXPECT_EQ(ground.height, 0.0);
  EXPECT_FALSE(from_above(geometry, 1.51, 0.0).has_value());
  EXPECT_FALSE(from_above(geometry, 0.0, -2.0).has_value());
}

// Descends the vertical line by the distance to the union: slow, and knows no formula but it.
std::optional<double> height_by_search(const PrimitiveScene& scene, double x, double y) {
  const SceneGeometry geometry(scene);
  double z = 2.0;
  for (int step = 0; step < 200'000 && z > -2.0; ++step) {
    const double distance = graspmap_test::distance_to_scene(geometry, {x, y, z});
    if (distance < 1e-10) return z;
    z -= 0.5 * distance;
  }
  return std::nullopt;
}

TEST(TruthFromAbove, agrees_with_a_search_by_signed_distance_on_any_shapes) {
  const PrimitiveScene scene = mixed_scene();
  const SceneGeometry geometry(scene);
  std::vector<int> seen(scene.shapes.size(), 0);
  for (int i = 0; i < 600; ++i) {
    const double x = uniform(-0.8, 0.8);
    const double y = uniform(-0.8, 0.8);
    const std::optional<SurfaceTruth> truth = from_above(geometry, x, y);
    const std::optional<double> z = height_by_search(scene, x, y);
    ASSERT_EQ(truth.has_value(), z.has_value()) << x << " " << y;
    if (!truth) continue;
    EXPECT_NEAR(truth->position.z(), *z, 1e-7) << x << " " << y << " shape " << truth->shape;
    EXPECT_NEAR(graspmap_test::distance_to_scene(geometry, truth->position), 0.0, 1e-12);
    ++seen[static_cast<std::size_t>(truth->shape)];
  }
  for (std::size_t shape = 0; shape < seen.size(); ++shape) EXPECT_GT(seen[shape], 0) << shape;
}

// Principal curvatures and normal of z = f(x, y) by central differences.
struct Numeric {
  Eigen::Vector3d normal;
  Eigen::Vector2d curvatures;
};
Numeric numeric_truth(const SceneGeometry& geometry, double x, double y) {
  constexpr double h = 1e-4;
  const auto z = [&](int i, int j) {
    return from_above(geometry, x + h * i, y + h * j)->position.z();
  };
  const double fx = (z(1, 0) - z(-1, 0)) / (2.0 * h);
  const double fy = (z(0, 1) - z(0, -1)) / (2.0 * h);
  const double fxx = (z(1, 0) - 2.0 * z(0, 0) + z(-1, 0)) / (h * h);
  const double fyy = (z(0, 1) - 2.0 * z(0, 0) + z(0, -1)) / (h * h);
  const double fxy = (z(1, 1) - z(1, -1) - z(-1, 1) + z(-1, -1)) / (4.0 * h * h);
  const double w = std::sqrt(1.0 + fx * fx + fy * fy);
  Eigen::Matrix2d first;
  first << 1.0 + fx * fx, fx * fy, fx * fy, 1.0 + fy * fy;
  Eigen::Matrix2d second;
  second << fxx, fxy, fxy, fyy;
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::Matrix2d> solver(-second / w, first);
  return {Eigen::Vector3d(-fx, -fy, 1.0) / w, solver.eigenvalues()};
}

// Returns true if the four points of the difference stencil are on one smooth face.
bool is_smooth_around(const SceneGeometry& geometry, double x, double y) {
  const std::optional<SurfaceTruth> middle = from_above(geometry, x, y);
  for (const double dx : {-3e-4, 3e-4}) {
    for (const double dy : {-3e-4, 3e-4}) {
      const std::optional<SurfaceTruth> near = from_above(geometry, x + dx, y + dy);
      if (!near || (near->normal - middle->normal).norm() > 0.02) return false;
      if (std::abs(near->curvature_max - middle->curvature_max) > 0.5) return false;
      if (std::abs(near->curvature_min - middle->curvature_min) > 0.5) return false;
    }
  }
  return middle->normal.z() > 0.3;
}

void expect_numeric_agreement(const PrimitiveScene& scene, double half_m) {
  const SceneGeometry geometry(scene);
  int checked = 0;
  for (int i = 0; i < 800; ++i) {
    const double x = uniform(-half_m, half_m);
    const double y = uniform(-half_m, half_m);
    if (!is_smooth_around(geometry, x, y)) continue;
    const SurfaceTruth truth = *from_above(geometry, x, y);
    const Numeric numeric = numeric_truth(geometry, x, y);
    EXPECT_NEAR((truth.normal - numeric.normal).norm(), 0.0, 3e-5) << x << " " << y;
    const double scale = 1.0 + std::abs(truth.curvature_max) + std::abs(truth.curvature_min);
    EXPECT_NEAR(truth.curvature_min, numeric.curvatures[0], 2e-3 * scale) << x << " " << y;
    EXPECT_NEAR(truth.curvature_max, numeric.curvatures[1], 2e-3 * scale) << x << " " << y;
    ++checked;
  }
  EXPECT_GT(checked, 400);
}

TEST(TruthFromAbove, normals_and_curvatures_agree_with_differences_of_heights) {
  expect_numeric_agreement(mixed_scene(), 0.8);
}

TEST(TruthFromAbove, bumps_agree_with_differences_of_heights) {
  expect_numeric_agreement(
      scene_of({ground_plane(),
                {Bump{0.2, 0.5, BumpProfile::cosine}, {.x_m = 0.2}, {}},
                {Bump{-0.3, 0.9, BumpProfile::gaussian}, {.x_m = -0.3, .y_m = 0.3}, {}},
                {Bump{0.1, 0.3, BumpProfile::gaussian}, {.y_m = -0.4}, {}}}),
      0.8);
}

TEST(Bump, follows_its_profile_and_its_curvature_at_the_top_is_the_closed_form) {
  for (const double height : {0.1, -0.1}) {
    const SceneGeometry cosine(
        scene_of({ground_plane(), {Bump{height, 0.4, BumpProfile::cosine}, {.x_m = 0.5}, {}}}));
    const SurfaceTruth top = *from_above(cosine, 0.5, 0.0);
    const double expected = height * pi * pi / (2.0 * 0.4 * 0.4);
    EXPECT_NEAR(top.height, height, 1e-15);
    EXPECT_NEAR(top.curvature_min, expected, 1e-12);  // positive on a bump, negative in a hollow
    EXPECT_NEAR(top.curvature_max, expected, 1e-12);
    EXPECT_EQ(top.shape, 1);
    const double at_quarter = std::pow(std::cos(pi / 8.0), 2);
    EXPECT_NEAR(from_above(cosine, 0.5, 0.1)->height, height * at_quarter, 1e-15);
    EXPECT_NEAR(from_above(cosine, 0.5, 0.1)->position.z(), height * at_quarter, 1e-15);
    const SurfaceTruth beyond = *from_above(cosine, 0.5, 0.41);
    EXPECT_EQ(beyond.height, 0.0);
    EXPECT_EQ(beyond.curvature_max, 0.0);
    EXPECT_EQ(beyond.shape, 0);
    const SceneGeometry gaussian(
        scene_of({ground_plane(), {Bump{height, 0.6, BumpProfile::gaussian}, {}, {}}}));
    EXPECT_NEAR(from_above(gaussian, 0.2, 0.0)->height, height * std::exp(-0.5), 1e-15);
    EXPECT_NEAR(from_above(gaussian, 0.0, 0.0)->curvature_min, height / 0.04, 1e-12);
  }
}

TEST(Bump, bends_a_tilted_ground_along_the_grounds_normal) {
  const Placement tilt{.x_m = 0.1, .z_m = 0.3, .roll_deg = 20.0, .pitch_deg = -15.0};
  const Pose pose = tilt.pose();
  const Eigen::Vector3d foot = pose * Eigen::Vector3d(0.2, -0.1, 0.0);
  const SceneGeometry geometry(
      scene_of({{Plane{2.0, 2.0}, tilt, {}},
                {Bump{0.2, 0.5, BumpProfile::cosine}, {foot.x(), foot.y(), foot.z()}, {}}}));
  for (int i = 0; i < 200; ++i) {
    const SurfaceTruth truth = *from_above(geometry, uniform(-0.5, 0.6), uniform(-0.5, 0.5));
    const Eigen::Vector3d local = pose.inverse() * truth.position;
    const double r = (local.head<2>() - Eigen::Vector2d(0.2, -0.1)).norm();
    const double expected = r < 0.5 ? 0.2 * std::pow(std::cos(pi * r), 2) : 0.0;
    EXPECT_NEAR(local.z(), expected, 1e-12);
    EXPECT_NEAR(truth.height, expected, 1e-12);
  }
}

TEST(Profile, a_share_of_the_area_lies_before_the_point_that_marks_it) {
  for (const ProfileSegment& segment :
       {ProfileSegment::line({0.0, 0.3}, {0.2, 0.0}), ProfileSegment::line({0.2, 0.0}, {0.0, 0.0}),
        ProfileSegment::line({0.2, 0.3}, {0.2, 0.0}), ProfileSegment::arc(0.1, 0.2, 0.0, pi),
        ProfileSegment::arc(0.1, 0.2, 0.5 * pi, pi)}) {
    for (int i = 0; i < 50; ++i) {
      const double t0 = uniform(0.0, 0.7);
      const double t1 = uniform(t0 + 0.01, 1.0);
      const double fraction = uniform(0.0, 1.0);
      const double t = segment.t_of_area_fraction(t0, t1, fraction);
      EXPECT_NEAR(segment.area_between(t0, t), fraction * segment.area_between(t0, t1), 1e-14);
    }
  }
}

TEST(SignedDistance, is_the_closed_form_of_each_solid) {
  const auto distance = [](ShapeGeometry geometry, double x, double y, double z) {
    return graspmap_test::distance_to_scene(
        SceneGeometry(scene_of({{std::move(geometry), {}, {}}})), {x, y, z});
  };
  EXPECT_NEAR(distance(Sphere{0.5}, 0.0, 3.0, 4.0), 4.5, 1e-14);
  EXPECT_NEAR(distance(Sphere{0.5}, 0.0, 0.0, 0.1), -0.4, 1e-14);
  EXPECT_NEAR(distance(Sphere{0.5}, 0.0, 0.0, -1.0), 0.5, 1e-14);
  EXPECT_NEAR(distance(Capsule{0.1, 1.0}, 0.4 + 0.3, 0.4, 0.0), 0.4, 1e-14);
  EXPECT_NEAR(distance(Capsule{0.1, 1.0}, -0.2, 0.03, 0.04), -0.05, 1e-14);
  EXPECT_NEAR(distance(Cylinder{0.2, 1.0}, 0.5, 0.0, 1.4), 0.5, 1e-14);
  EXPECT_NEAR(distance(Cylinder{0.2, 1.0}, 0.0, 0.1, 0.5), -0.1, 1e-14);
  EXPECT_NEAR(distance(Cone{0.3, 0.4}, 0.0, 0.0, 0.5), 0.1, 1e-14);
  EXPECT_NEAR(distance(Cone{0.3, 0.4}, 0.15 + 0.8, 0.0, 0.2 + 0.6), 1.0, 1e-14);
  EXPECT_NEAR(distance(Cone{0.3, 0.4}, 0.0, 0.0, -2.0), 2.0, 1e-14);
  EXPECT_NEAR(distance(Box{0.2, 0.4, 0.6}, 0.1 + 0.2, 0.2 + 0.2, 0.6 + 0.1), 0.3, 1e-14);
  EXPECT_NEAR(distance(Box{0.2, 0.4, 0.6}, 0.0, 0.0, 0.3), -0.1, 1e-14);
  EXPECT_NEAR(distance(Plane{2.0, 2.0}, 0.3, 0.3, 0.7), 0.7, 1e-14);
  EXPECT_NEAR(distance(Plane{2.0, 2.0}, 1.5, 0.0, -50.0), 0.5, 1e-14);
  EXPECT_NEAR(distance(Plane{2.0, 2.0}, 0.0, 0.0, -0.2), -0.2, 1e-14);
}

TEST(SceneCheck, names_shape_parameter_value_and_bound) {
  const auto message = [](SceneShape shape) {
    return error_of([&] { scene_of({std::move(shape)}).check(); });
  };
  EXPECT_TRUE(is_error(message({Capsule{0.2, 0.3}, {}, {}}),
                       {.field = "shapes[0].length_m", .value = "0.3", .bound = ">= 0.4"}));
  EXPECT_TRUE(is_error(message({Plane{1.0, 1.0}, {.roll_deg = 90.0}, {}}),
                       {.field = "shapes[0].roll_deg, pitch_deg", .value = "90, 0"}));
  EXPECT_TRUE(
      is_error(message({Bump{0.1, 0.2, BumpProfile::cosine}, {}, {}}), {.field = "shapes"}));
  EXPECT_TRUE(is_error(error_of([] { scene_of({}).check(); }), {.field = "shapes"}));
}

}  // namespace primitive_scene_test
}  // namespace libmap
