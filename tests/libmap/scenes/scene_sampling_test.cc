// Every sample against the closed form of its shape.
#include "libmap/scenes/scene_sampling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "libmap/core/parallel.h"
#include "libmap/scenes/scene_geometry.h"
#include "scene_test_support.h"
#include "tests/libmap/scenes/scene_query.h"
#include "tests/support/test_support.h"
#include "tests/support/thesis_scene.h"

namespace libmap {
namespace scene_sampling_test {

using graspmap_test::error_of;
using graspmap_test::from_above;
using graspmap_test::ground_plane;
using graspmap_test::is_error;
using graspmap_test::mixed_scene;
using graspmap_test::pi;
using graspmap_test::scene_of;
using graspmap_test::thesis_primitive_scene;
using graspmap_test::uniform;
using graspmap_test::values_of;

class ThesisSamples : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    scene_ = new PrimitiveScene(thesis_primitive_scene());
    samples_ = new SceneSamples(sample_scene(*scene_, {.spacing_m = 0.01}));
  }
  static void TearDownTestSuite() {
    delete scene_;
    delete samples_;
  }
  // Calls visit(offset from the shape's position, normal, height, curvatures).
  template <typename Geometry, typename Visit>
  static std::size_t for_samples_on(const Visit& visit) {
    const PointCloud& cloud = samples_->cloud;
    std::size_t count = 0;
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const auto& shape = scene_->shapes[static_cast<std::size_t>(values_of(cloud, "shape")[i])];
      const auto* geometry = std::get_if<Geometry>(&shape.geometry);
      if (geometry == nullptr) continue;
      const Eigen::Vector3d origin = shape.placement.pose().translation();
      EXPECT_NEAR(values_of(cloud, "height")[i], cloud.positions[i].z(), 1e-15);
      visit(*geometry, cloud.positions[i] - origin, cloud.normals[i].cast<double>().eval(),
            Eigen::Vector2d(values_of(cloud, "curvature_min")[i],
                            values_of(cloud, "curvature_max")[i]));
      ++count;
    }
    return count;
  }
  static PrimitiveScene* scene_;
  static SceneSamples* samples_;
};
PrimitiveScene* ThesisSamples::scene_ = nullptr;
SceneSamples* ThesisSamples::samples_ = nullptr;

TEST_F(ThesisSamples, hemispheres_are_exact) {
  const std::size_t count =
      for_samples_on<Sphere>([](const Sphere& sphere, auto offset, auto normal, auto curvatures) {
        EXPECT_NEAR(offset.norm(), sphere.radius_m, 1e-12);
        EXPECT_GE(offset.z(), -1e-9);
        EXPECT_NEAR((normal - offset / sphere.radius_m).norm(), 0.0, 2e-7);
        EXPECT_NEAR(curvatures[0], 1.0 / sphere.radius_m, 1e-12);
        EXPECT_NEAR(curvatures[1], 1.0 / sphere.radius_m, 1e-12);
      });
  const double area = 2.0 * pi * (0.05 * 0.05 + 0.1 * 0.1 + 0.15 * 0.15 + 0.2 * 0.2 + 0.25 * 0.25);
  EXPECT_NEAR(static_cast<double>(count), area / 1e-4, 0.02 * area / 1e-4);
}

TEST_F(ThesisSamples, half_capsules_are_exact) {
  std::size_t straight_count = 0;
  const std::size_t count = for_samples_on<Capsule>(
      [&](const Capsule& capsule, auto offset, auto normal, auto curvatures) {
        const double half = 0.5 * capsule.length_m - capsule.radius_m;
        const Eigen::Vector3d nearest(0.0, std::clamp(offset.y(), -half, half), 0.0);
        EXPECT_NEAR((offset - nearest).norm(), capsule.radius_m, 1e-12);
        EXPECT_GE(offset.z(), -1e-9);
        EXPECT_NEAR((normal - (offset - nearest) / capsule.radius_m).norm(), 0.0, 2e-7);
        EXPECT_NEAR(curvatures[1], 1.0 / capsule.radius_m, 1e-12);
        const bool straight = std::abs(offset.y()) < half;
        straight_count += straight ? 1 : 0;
        EXPECT_NEAR(curvatures[0], straight ? 0.0 : 1.0 / capsule.radius_m, 1e-12);
      });
  double straight_area = 0.0;
  double round_area = 0.0;
  for (std::size_t i = 6; i < 11; ++i) {
    const Capsule capsule = std::get<Capsule>(scene_->shapes[i].geometry);
    straight_area += pi * capsule.radius_m * (capsule.length_m - 2.0 * capsule.radius_m);
    round_area += 2.0 * pi * capsule.radius_m * capsule.radius_m;
  }
  EXPECT_NEAR(static_cast<double>(straight_count), straight_area / 1e-4,
              0.03 * straight_area / 1e-4);
  EXPECT_NEAR(static_cast<double>(count - straight_count), round_area / 1e-4,
              0.03 * round_area / 1e-4);
}

TEST_F(ThesisSamples, cones_are_exact) {
  const std::size_t count = for_samples_on<Cone>([](const Cone& cone, auto offset, auto normal,
                                                    auto curvatures) {
    const double rho = offset.template head<2>().norm();
    EXPECT_NEAR(rho / cone.radius_m + offset.z() / cone.height_m, 1.0, 1e-12);
    const double slant = std::hypot(cone.radius_m, cone.height_m);
    const Eigen::Vector3d expected(offset.x() / rho * cone.height_m / slant,
                                   offset.y() / rho * cone.height_m / slant, cone.radius_m / slant);
    EXPECT_NEAR((normal - expected).norm(), 0.0, 2e-7);
    EXPECT_EQ(curvatures[0], 0.0);
    EXPECT_NEAR(curvatures[1] * rho, cone.height_m / slant, 1e-9);
  });
  double area = 0.0;
  for (std::size_t i = 11; i < 16; ++i)
    area += pi * 0.15 * std::hypot(0.15, std::get<Cone>(scene_->shapes[i].geometry).height_m);
  EXPECT_NEAR(static_cast<double>(count), area / 1e-4, 0.02 * area / 1e-4);
}

TEST_F(ThesisSamples, ground_is_flat_and_leaves_the_footprints_out) {
  const std::size_t count = for_samples_on<Plane>([&](const Plane&, auto offset, auto normal,
                                                      auto curvatures) {
    EXPECT_EQ(offset.z(), 0.0);
    EXPECT_EQ(normal, Eigen::Vector3d::UnitZ());
    EXPECT_EQ(curvatures, Eigen::Vector2d::Zero());
    EXPECT_LE(offset.cwiseAbs().maxCoeff(), 1.5);
    for (std::size_t i = 1; i < 16; ++i) {
      const SceneShape& shape = scene_->shapes[i];
      const Eigen::Vector2d at(offset.x() - shape.placement.x_m, offset.y() - shape.placement.y_m);
      if (const auto* capsule = std::get_if<Capsule>(&shape.geometry)) {
        const double half = 0.5 * capsule->length_m - capsule->radius_m;
        EXPECT_GE((at - Eigen::Vector2d(0.0, std::clamp(at.y(), -half, half))).norm(),
                  capsule->radius_m - 1e-9);
      } else {
        const double radius = i < 6 ? std::get<Sphere>(shape.geometry).radius_m : 0.15;
        EXPECT_GE(at.norm(), radius - 1e-9);
      }
    }
  });
  double area = 9.0 - 5.0 * pi * 0.15 * 0.15;
  for (std::size_t i = 1; i < 6; ++i)
    area -= pi * std::pow(std::get<Sphere>(scene_->shapes[i].geometry).radius_m, 2);
  for (std::size_t i = 6; i < 11; ++i) {
    const Capsule c = std::get<Capsule>(scene_->shapes[i].geometry);
    area -= pi * c.radius_m * c.radius_m + 2.0 * c.radius_m * (c.length_m - 2.0 * c.radius_m);
  }
  EXPECT_NEAR(static_cast<double>(count), area / 1e-4, 0.005 * area / 1e-4);
}

TEST(SampleScene, lies_on_the_union_and_inside_no_shape) {
  const PrimitiveScene scene = mixed_scene();
  const SceneGeometry geometry(scene);
  const SceneSamples samples = sample_scene(scene, {.spacing_m = 0.01});
  samples.cloud.check();
  std::set<double> shapes;
  for (std::size_t i = 0; i < samples.cloud.size(); ++i) {
    const Eigen::Vector3d& point = samples.cloud.positions[i];
    const Eigen::Vector3d normal = samples.cloud.normals[i].cast<double>();
    EXPECT_NEAR(graspmap_test::distance_to_scene(geometry, point), 0.0, 1.1e-9);
    EXPECT_GT(graspmap_test::distance_to_scene(geometry, point + 1e-5 * normal), 0.0);
    EXPECT_NEAR(normal.norm(), 1.0, 1e-6);
    shapes.insert(values_of(samples.cloud, "shape")[i]);
  }
  EXPECT_EQ(shapes.size(), scene.shapes.size());
}

TEST(SampleScene, agrees_with_the_truth_from_above_wherever_it_is_the_highest) {
  const SceneGeometry geometry(mixed_scene());
  const PointCloud cloud = sample_scene(mixed_scene(), {.spacing_m = 0.02}).cloud;
  std::size_t highest = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Eigen::Vector3d& point = cloud.positions[i];
    const std::optional<SurfaceTruth> truth = from_above(geometry, point.x(), point.y());
    ASSERT_TRUE(truth.has_value());
    EXPECT_GE(truth->position.z(), point.z() - 1e-9);
    if (truth->position.z() > point.z() + 1e-7) continue;
    ++highest;
    EXPECT_EQ(truth->shape, values_of(cloud, "shape")[i]);
    EXPECT_NEAR(truth->height, values_of(cloud, "height")[i], 1e-7);
    if (truth->normal.z() < 1e-3) continue;
    EXPECT_NEAR(truth->curvature_max, values_of(cloud, "curvature_max")[i], 1e-5);
    EXPECT_NEAR((truth->normal - cloud.normals[i].cast<double>()).norm(), 0.0, 1e-5);
  }
  EXPECT_GT(highest, cloud.size() / 2);
}

TEST(SampleScene, no_gap_is_wider_than_promised) {
  // Flat: every square of (1 + jitter) spacings holds a point.
  constexpr double spacing = 0.02;
  const PointCloud flat =
      sample_scene(scene_of({ground_plane(1.0)}), {.spacing_m = spacing, .jitter = 0.3}).cloud;
  for (int trial = 0; trial < 3000; ++trial) {
    const double side = 1.3 * spacing;
    const Eigen::Vector2d corner(uniform(-0.5, 0.5 - side), uniform(-0.5, 0.5 - side));
    const bool holds = std::any_of(flat.positions.begin(), flat.positions.end(), [&](auto& p) {
      const Eigen::Vector2d at = p.template head<2>() - corner;
      return at.minCoeff() >= 0.0 && at.maxCoeff() <= side;
    });
    EXPECT_TRUE(holds);
  }
  // Curved and overlapping: the nearest sample of any visible point.
  const SceneGeometry geometry(mixed_scene());
  const PointCloud mixed = sample_scene(mixed_scene(), {.spacing_m = spacing}).cloud;
  const PointCloud probes = sample_scene(mixed_scene(), {.spacing_m = 0.03, .seed = 99}).cloud;
  for (const Eigen::Vector3d& probe : probes.positions) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& point : mixed.positions)
      nearest = std::min(nearest, (point - probe).norm());
    EXPECT_LT(nearest, 1.5 * spacing);
  }
}

TEST(SampleScene, is_even_by_area_on_steep_bumps) {
  // Share of the samples on the steep flank against the share of the area, by quadrature.
  const PrimitiveScene scene =
      scene_of({ground_plane(2.0), {Bump{0.6, 0.8, BumpProfile::cosine}, {}, {}}});
  const PointCloud cloud = sample_scene(scene, {.spacing_m = 0.01}).cloud;
  double area = 0.0;
  constexpr int rings = 10000;
  for (int i = 0; i < rings; ++i) {
    const double r = 0.3 + 0.2 * (i + 0.5) / rings;
    const double slope = 0.6 * pi / 1.6 * std::sin(pi * r / 0.8);
    area += 2.0 * pi * r * 0.2 / rings * std::sqrt(1.0 + slope * slope);
  }
  const auto count = std::count_if(cloud.positions.begin(), cloud.positions.end(), [](auto& p) {
    const double r = p.template head<2>().norm();
    return r > 0.3 && r < 0.5;
  });
  EXPECT_NEAR(static_cast<double>(count), area / 1e-4, 0.02 * area / 1e-4);
}

TEST(SampleScene, random_scenes_have_no_sample_inside_a_shape) {
  for (int trial = 0; trial < 10; ++trial) {
    const PrimitiveScene scene = graspmap_test::random_scene();
    const SceneGeometry geometry(scene);
    const PointCloud cloud = sample_scene(scene, {.spacing_m = 0.02}).cloud;
    for (const Eigen::Vector3d& point : cloud.positions)
      ASSERT_NEAR(graspmap_test::distance_to_scene(geometry, point), 0.0, 1.1e-9);
  }
}

TEST(SampleScene, thin_faces_keep_their_density) {
  const PointCloud cloud =
      sample_scene(scene_of({{Box{0.013, 0.013, 1.0}, {}, {}}}), {.spacing_m = 0.01}).cloud;
  EXPECT_NEAR(static_cast<double>(cloud.size()), 4.0 * 130.0 + 2.0 * 1.69, 5.0);
}

TEST(SampleScene, samples_move_rigidly_with_their_shape) {
  const Placement placement{
      .x_m = 0.3, .y_m = -0.2, .z_m = 0.5, .roll_deg = 20.0, .pitch_deg = 40.0, .yaw_deg = -70.0};
  const std::vector<ShapeGeometry> geometries = {Sphere{0.1},        Capsule{0.1, 0.4},
                                                 Cone{0.1, 0.2},     Cylinder{0.1, 0.2},
                                                 Box{0.1, 0.2, 0.3}, Plane{0.5, 0.7}};
  for (const ShapeGeometry& geometry : geometries) {
    const PointCloud still =
        sample_scene(scene_of({{geometry, {}, {}}}), {.spacing_m = 0.02}).cloud;
    const PointCloud moved =
        sample_scene(scene_of({{geometry, placement, {}}}), {.spacing_m = 0.02}).cloud;
    const Pose pose = make_pose_from_rpy({0.3, -0.2, 0.5}, {20.0, 40.0, -70.0});
    ASSERT_EQ(still.size(), moved.size());
    ASSERT_GT(still.size(), 100U);
    for (std::size_t i = 0; i < still.size(); ++i) {
      EXPECT_NEAR((pose * still.positions[i] - moved.positions[i]).norm(), 0.0, 1e-14);
      EXPECT_NEAR((pose.linear().cast<float>() * still.normals[i] - moved.normals[i]).norm(), 0.0,
                  1e-6);
    }
    EXPECT_EQ(values_of(still, "curvature_max"), values_of(moved, "curvature_max"));
  }
}

TEST(SampleScene, faces_that_coincide_are_seen_once_or_not_at_all) {
  // A box on the ground: no bottom. Two boxes on each other: no floor between them. Two planes at
  // one height: one surface.
  const PointCloud stack = sample_scene(scene_of({ground_plane(1.0),
                                                  {Box{0.4, 0.4, 0.2}, {}, {}},
                                                  {Box{0.2, 0.2, 0.2}, {.z_m = 0.2}, {}}}),
                                        {.spacing_m = 0.01})
                               .cloud;
  const double area = 1.0 + 4.0 * 0.4 * 0.2 + 4.0 * 0.2 * 0.2;
  EXPECT_NEAR(static_cast<double>(stack.size()), area * 1e4, 0.01 * area * 1e4);
  for (const Eigen::Vector3f& normal : stack.normals) EXPECT_GE(normal.z(), -1e-6F);
  const PointCloud planes =
      sample_scene(scene_of({ground_plane(1.0), ground_plane(0.5)}), {.spacing_m = 0.01}).cloud;
  EXPECT_EQ(planes.size(), 10000U);
}

TEST(SampleScene, the_same_bytes_for_a_seed_at_any_thread_count) {
  const SceneSamplingOptions options{.spacing_m = 0.02, .noise_m = 0.001, .seed = 7};
  std::optional<PointCloud> first;
  for (const unsigned threads : {1U, 2U, 5U}) {
    const ThreadLimit limit(threads);
    const PointCloud cloud = sample_scene(mixed_scene(), options).cloud;
    if (first) {
      EXPECT_EQ(cloud.positions, first->positions);
      EXPECT_EQ(cloud.normals, first->normals);
      EXPECT_EQ(cloud.fields, first->fields);
    }
    first = cloud;
  }
  SceneSamplingOptions other = options;
  other.seed = 8;
  EXPECT_NE(sample_scene(mixed_scene(), other).cloud.positions, first->positions);
}

TEST(SampleScene, noise_shifts_along_the_normal_and_leaves_the_truth) {
  const PrimitiveScene scene = scene_of({{Sphere{1.0}, {}, {}}});
  const PointCloud clean = sample_scene(scene, {.spacing_m = 0.02}).cloud;
  const PointCloud noisy = sample_scene(scene, {.spacing_m = 0.02, .noise_m = 0.01}).cloud;
  ASSERT_EQ(clean.size(), noisy.size());
  EXPECT_EQ(clean.normals, noisy.normals);
  EXPECT_EQ(clean.fields, noisy.fields);
  double sum = 0.0;
  double squares = 0.0;
  for (std::size_t i = 0; i < clean.size(); ++i) {
    const Eigen::Vector3d shift = noisy.positions[i] - clean.positions[i];
    const double along = shift.dot(clean.positions[i]);
    EXPECT_NEAR((shift - along * clean.positions[i]).norm(), 0.0, 1e-12);
    sum += along;
    squares += along * along;
  }
  const auto n = static_cast<double>(clean.size());
  EXPECT_NEAR(sum / n, 0.0, 5.0 * 0.01 / std::sqrt(n));
  EXPECT_NEAR(std::sqrt(squares / n), 0.01, 5.0 * 0.01 / std::sqrt(2.0 * n));
}

TEST(SampleScene, a_count_is_met_within_two_percent) {
  for (const std::uint64_t count : {2000U, 50'000U}) {
    const SceneSamples samples = sample_scene(mixed_scene(), {.count = count});
    const auto size = static_cast<double>(samples.cloud.size());
    EXPECT_NEAR(size / static_cast<double>(count), 1.0, 0.02);
    EXPECT_GT(samples.spacing_m, 0.0);
  }
}

TEST(SampleScene, shapes_smaller_than_the_spacing_still_get_points) {
  const PointCloud cloud =
      sample_scene(scene_of({ground_plane(1.0), {Sphere{0.001}, {}, {}}}), {.spacing_m = 0.1})
          .cloud;
  EXPECT_GE(cloud.size(), 100U);
}

TEST(SampleScene, refuses_what_it_cannot_do) {
  const PrimitiveScene scene = thesis_primitive_scene();
  const auto message = [&](const SceneSamplingOptions& options) {
    return error_of([&] { sample_scene(scene, options); });
  };
  EXPECT_TRUE(
      is_error(message({.count = 1'000'000'000}), {.field = "count", .value = "1000000000"}));
  EXPECT_TRUE(is_error(message({.spacing_m = 1e-4}), {.field = "spacing_m", .value = "1e-04"}));
  EXPECT_TRUE(is_error(message({.spacing_m = 1e-4}), {.field = "spacing_m", .value = "1e-04"}));
  EXPECT_TRUE(is_error(message({.spacing_m = 1e-200}), {.field = "spacing_m", .value = "1e-200"}));
  EXPECT_TRUE(is_error(error_of([&] { sample_scene(PrimitiveScene{}, {}); }), {.field = "shapes"}));
}

}  // namespace scene_sampling_test
}  // namespace libmap
