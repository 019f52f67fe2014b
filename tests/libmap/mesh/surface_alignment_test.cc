#include "libmap/mesh/surface_alignment.h"
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "libmap/core/parallel.h"
#include "libmap/mesh/surface_distance.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace surface_alignment_test {

using graspmap_test::ball_mesh;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::random_engine;
using graspmap_test::square_mesh;
using graspmap_test::uniform;

// Hills of 2 x 2 m without symmetry.
TriangleMesh hills() {
  constexpr std::uint32_t n = 60;
  TriangleMesh mesh;
  for (std::uint32_t y = 0; y < n; ++y)
    for (std::uint32_t x = 0; x < n; ++x) {
      const double u = 2.0 * x / (n - 1) - 1;
      const double v = 2.0 * y / (n - 1) - 1;
      mesh.vertices.emplace_back(
          u, v, 0.15 * std::sin(5 * u + 0.3) * std::cos(4 * v) + 0.1 * std::sin(3 * u * v));
    }
  for (std::uint32_t y = 0; y + 1 < n; ++y)
    for (std::uint32_t x = 0; x + 1 < n; ++x) {
      const std::uint32_t a = y * n + x;
      mesh.triangles.push_back({a, a + 1, a + n});
      mesh.triangles.push_back({a + 1, a + n + 1, a + n});
    }
  return mesh;
}

std::vector<Eigen::Vector3d> samples_of(const TriangleMesh& mesh, double per_m2) {
  std::vector<Eigen::Vector3d> points;
  for (const SurfacePoint& sample : sample_surface(mesh, per_m2, 3))
    points.push_back(sample.position);
  return points;
}

std::vector<Eigen::Vector3d> moved(std::vector<Eigen::Vector3d> points, const Pose& pose) {
  for (Eigen::Vector3d& point : points) point = pose * point;
  return points;
}

Eigen::Vector3d gaussian(double sigma) {
  std::normal_distribution<double> normal(0.0, sigma);
  const double x = normal(random_engine());
  const double y = normal(random_engine());
  return {x, y, normal(random_engine())};
}

// Largest entry of the difference: meters, and radians for small angles.
double difference(const Pose& a, const Pose& b) {
  return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff();
}

const Pose small_motion = make_pose_from_rpy({0.04, -0.03, 0.05}, {3, -2, 4});

TEST(SurfaceAlignment, RecoversAKnownMotionOfExactPoints) {
  const TriangleMesh mesh = hills();
  const SurfaceAlignmentResult result =
      align_to_surface(moved(samples_of(mesh, 2000), small_motion), ReferenceSurface(mesh));
  EXPECT_TRUE(result.converged);
  EXPECT_EQ(result.free_motions, 0);
  EXPECT_LT(difference(result.surface_from_points, small_motion.inverse()), 1e-9);
  EXPECT_LT(result.rmse_m, 1e-9);
  EXPECT_LT(result.iterations, 40);
}

TEST(SurfaceAlignment, RecoversItAgainstACloudWithNormals) {
  const TriangleMesh mesh = hills();
  PointCloud cloud;
  for (const SurfacePoint& sample : sample_surface(mesh, 20000, 1)) {
    cloud.positions.push_back(sample.position);
    cloud.normals.push_back(
        area_normal(mesh, mesh.triangles[sample.triangle]).normalized().cast<float>());
  }
  const SurfaceAlignmentResult result =
      align_to_surface(moved(samples_of(mesh, 2000), small_motion), ReferenceSurface(cloud));
  EXPECT_TRUE(result.converged);
  EXPECT_LT(difference(result.surface_from_points, small_motion.inverse()), 3e-4)
      << "facets of 3 cm against discs across them";
}

TEST(SurfaceAlignment, NoiseAveragesOut) {
  const TriangleMesh mesh = hills();
  std::vector<Eigen::Vector3d> points = samples_of(mesh, 5000);
  for (Eigen::Vector3d& point : points) point += gaussian(0.003);
  const SurfaceAlignmentResult result =
      align_to_surface(moved(points, small_motion), ReferenceSurface(mesh));
  EXPECT_TRUE(result.converged);
  // 3 mm / sqrt(20000), and about ten times more along the ground.
  EXPECT_LT(difference(result.surface_from_points, small_motion.inverse()), 5e-4);
  EXPECT_NEAR(result.rmse_m, 0.003, 3e-4);
}

TEST(SurfaceAlignment, OutliersDoNotPull) {
  const TriangleMesh mesh = hills();
  std::vector<Eigen::Vector3d> points = moved(samples_of(mesh, 2000), small_motion);
  const std::size_t sound = points.size();
  // 30 % of the points are above the ground.
  for (std::size_t n = 0; n < sound; n += 7)
    for (int k = 0; k < 3; ++k)
      points.push_back(points[n] + Eigen::Vector3d(0, 0, uniform(0.02, 0.18)));
  const SurfaceAlignmentResult result = align_to_surface(points, ReferenceSurface(mesh));
  EXPECT_TRUE(result.converged);
  EXPECT_LT(difference(result.surface_from_points, small_motion.inverse()), 1e-6);
  EXPECT_NEAR(static_cast<double>(result.inliers), static_cast<double>(sound),
              0.01 * static_cast<double>(sound));
}

TEST(SurfaceAlignment, PointsBeyondTheBorderDoNotPull) {
  const TriangleMesh mesh = hills();
  TriangleMesh half = mesh;
  std::erase_if(half.triangles, [&](const Triangle& t) { return mesh.vertices[t[0]].x() > 0.0; });
  const SurfaceAlignmentResult result =
      align_to_surface(moved(samples_of(mesh, 2000), small_motion), ReferenceSurface(half));
  EXPECT_TRUE(result.converged);
  EXPECT_LT(difference(result.surface_from_points, small_motion.inverse()), 1e-6);
  EXPECT_NEAR(static_cast<double>(result.overlap), 0.5 * static_cast<double>(result.points),
              0.05 * static_cast<double>(result.points));
}

TEST(SurfaceAlignment, PlaneDoesNotSlide) {
  // Points in the center of the plane, tilted and lifted; their positions along it must be kept.
  for (const double noise : {0.0, 0.002}) {
    std::vector<Eigen::Vector3d> points = samples_of(square_mesh(0.0, 0.5), 5000);
    for (Eigen::Vector3d& point : points) point += gaussian(noise);
    const Pose start = make_pose_from_rpy({0.2, 0.1, 0.04}, {4, -3, 0});
    const SurfaceAlignmentResult result =
        align_to_surface(moved(points, start), ReferenceSurface(square_mesh(0.0)));
    EXPECT_TRUE(result.converged);
    EXPECT_EQ(result.free_motions, 3);
    const Pose motion = result.surface_from_points * start;
    EXPECT_NEAR(motion.translation().z(), 0.0, 1e-9 + 0.1 * noise);
    EXPECT_NEAR(motion.linear()(2, 2), 1.0, 1e-9 + 1e-3 * noise);
    // The rotation back moves points along the plane only by the effect of the rotation.
    EXPECT_LT((motion.translation() - start.translation()).head<2>().norm(), 0.006);
    EXPECT_NEAR(std::atan2(motion.linear()(1, 0), motion.linear()(0, 0)), 0.0, 0.005);
  }
}

TEST(SurfaceAlignment, PlaneAlreadyInPlaceStaysExactly) {
  const SurfaceAlignmentResult result =
      align_to_surface(samples_of(square_mesh(0.0, 0.5), 2000), ReferenceSurface(square_mesh(0.0)));
  EXPECT_TRUE(result.surface_from_points.matrix() == Pose::Identity().matrix());
}

TEST(SurfaceAlignment, NoisyCloudOfAPlaneDoesNotSlide) {
  PointCloud plane;
  for (int x = -60; x <= 60; ++x)
    for (int y = -60; y <= 60; ++y) {
      plane.positions.push_back(Eigen::Vector3d(0.01 * x, 0.01 * y, 0.0) + gaussian(0.0005));
      plane.normals.push_back(
          (Eigen::Vector3d::UnitZ() + gaussian(0.005)).normalized().cast<float>());
    }
  std::vector<Eigen::Vector3d> points = samples_of(square_mesh(0.0, 0.4), 10000);
  for (Eigen::Vector3d& point : points) point += gaussian(0.002) + Eigen::Vector3d(0.05, 0, 0.01);
  const SurfaceAlignmentResult result = align_to_surface(points, ReferenceSurface(plane));
  EXPECT_EQ(result.free_motions, 3);
  EXPECT_LT(result.surface_from_points.translation().head<2>().norm(), 1e-3);
  EXPECT_NEAR(result.surface_from_points.translation().z(), -0.01, 2e-4);
}

TEST(SurfaceAlignment, BallDoesNotTurn) {
  const Eigen::Vector3d center(0.03, 0.02, -0.01);
  std::vector<Eigen::Vector3d> points;
  for (int n = 0; n < 3000; ++n) points.push_back(center + gaussian(1.0).normalized());
  const SurfaceAlignmentResult result = align_to_surface(
      points, ReferenceSurface(ball_mesh(200, 400, {0, 0, 0})), {.max_distance_m = 0.5});
  EXPECT_EQ(result.free_motions, 3);
  EXPECT_LT((result.surface_from_points * center).norm(), 1e-3);
  EXPECT_LT(Eigen::AngleAxisd(result.surface_from_points.linear()).angle(), 1e-3);
}

TEST(SurfaceAlignment, NoOverlapIsSaid) {
  const TriangleMesh mesh = hills();
  const ReferenceSurface surface(mesh);
  const std::vector<Eigen::Vector3d> points = samples_of(mesh, 500);
  const Pose above = make_pose_from_rpy({0, 0, 3}, {0, 0, 0});
  const Pose beside = make_pose_from_rpy({1.9, 0, 0}, {0, 0, 0});
  for (const Pose& pose : {above, beside})
    EXPECT_TRUE(is_error(error_of([&] { align_to_surface(moved(points, pose), surface); }),
                         {.field = "share of points within 0.2 m of the surface"}));
  // The overlap is a quarter.
  const Pose partly = make_pose_from_rpy({1.5, 0, 0}, {0, 0, 0});
  EXPECT_TRUE(is_error(
      error_of([&] { align_to_surface(moved(points, partly), surface, {.min_overlap = 0.5}); }),
      {.field = "share of points within 0.2 m of the surface",
       .value = "19.6 %",
       .bound = ">= 50.0 % and at least 6 points"}));
}

TEST(SurfaceAlignment, SaysWhetherItHasConverged) {
  const TriangleMesh mesh = hills();
  const SurfaceAlignmentResult result = align_to_surface(
      moved(samples_of(mesh, 500), small_motion), ReferenceSurface(mesh), {.max_iterations = 2});
  EXPECT_FALSE(result.converged);
  EXPECT_EQ(result.iterations, 2);
}

TEST(SurfaceAlignment, ThreadsMakeNoDifferenceAndPointsAreDownsampled) {
  const TriangleMesh mesh = hills();
  const ReferenceSurface surface(mesh);
  const std::vector<Eigen::Vector3d> points = moved(samples_of(mesh, 3000), small_motion);
  std::vector<Pose> found;
  for (const unsigned threads : {1U, 3U}) {
    const ThreadLimit limit(threads);
    const SurfaceAlignmentResult result = align_to_surface(points, surface, {.max_points = 1000});
    EXPECT_EQ(result.points, 1000U);
    found.push_back(result.surface_from_points);
  }
  EXPECT_TRUE(found[0].matrix() == found[1].matrix());
  EXPECT_LT(difference(found[0], small_motion.inverse()), 1e-6);
}

TEST(SurfaceAlignment, FarFromTheOrigin) {
  const Eigen::Vector3d far(4e5, -3e5, 700);
  TriangleMesh mesh = hills();
  const std::vector<Eigen::Vector3d> points =
      moved(samples_of(mesh, 1000), make_pose(far, Eigen::Quaterniond::Identity()) * small_motion);
  for (Eigen::Vector3d& vertex : mesh.vertices) vertex += far;
  const SurfaceAlignmentResult result = align_to_surface(points, ReferenceSurface(mesh));
  EXPECT_TRUE(result.converged);
  for (std::size_t n = 0; n < points.size(); n += 100)
    EXPECT_LT(
        (small_motion * (result.surface_from_points * points[n] - far) - (points[n] - far)).norm(),
        1e-6);
}

TEST(SurfaceAlignment, WhatCannotBeAligned) {
  const ReferenceSurface surface(hills());
  const std::vector<Eigen::Vector3d> points = samples_of(hills(), 100);
  EXPECT_TRUE(is_error(error_of([&] {
                         align_to_surface({{0, 0, 0}, {0, 1, 0}}, surface);
                       }),
                       {.field = "points", .value = "2", .bound = ">= 6"}));
  PointCloud cloud;
  cloud.positions = points;
  EXPECT_TRUE(is_error(error_of([&] { align_to_surface(points, ReferenceSurface(cloud)); }),
                       {.field = "normals"}));
  EXPECT_TRUE(
      is_error(error_of([&] { align_to_surface(points, surface, {.max_distance_m = NAN}); }),
               {.field = "icp_max_distance_m", .value = "nan", .bound = "> 0"}));
  EXPECT_TRUE(
      is_error(error_of([&] { align_to_surface(points, surface, {.max_iterations = 0}); }),
               {.field = "icp_max_iterations", .value = "0", .bound = ">= 1 and <= 1e+06"}));
  std::vector<Eigen::Vector3d> broken = points;
  broken[3].x() = NAN;
  EXPECT_TRUE(is_error(error_of([&] { align_to_surface(broken, surface); }), {.field = "points"}));
}

}  // namespace surface_alignment_test
}  // namespace libmap
