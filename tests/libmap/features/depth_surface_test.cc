#include "libmap/features/depth_surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "libmap/core/error.h"
#include "tests/libmap/refine/textured_scan.h"
#include "tests/support/test_support.h"

namespace depth_surface_test {

using graspmap_test::around;
using graspmap_test::error_of;
using graspmap_test::plane_z;
using graspmap_test::TexturedScan;
using libmap::DepthSurface;
using libmap::FrameFeatures;
using libmap::Pose;
using libmap::SurfacePatch;
using libmap::Vector6d;

FrameFeatures frame_of(const TexturedScan& scan) {
  return libmap::find_features(scan, {1}, graspmap_test::small_options().features).frames.front();
}

// The ground without noise, seen obliquely.
DepthSurface ground() {
  TexturedScan scan;
  scan.see(plane_z(0.0), around(0), Vector6d::Zero(), false, {});
  return frame_of(scan).surfaces.front();
}

// Largest angle (rad) between an element's normal and the normal of the neighboring points.
double max_normal_error(const DepthSurface& surface) {
  double largest = 0.0;
  for (int row = 1; row + 1 < surface.rows(); ++row)
    for (int column = 1; column + 1 < surface.columns(); ++column) {
      SurfacePatch at;
      SurfacePatch left;
      SurfacePatch right;
      SurfacePatch above;
      SurfacePatch below;
      if (!surface.at(column, row, at) || !surface.at(column - 1, row, left) ||
          !surface.at(column + 1, row, right) || !surface.at(column, row - 1, above) ||
          !surface.at(column, row + 1, below))
        continue;
      const Eigen::Vector3d normal =
          (below.point - above.point).cross(right.point - left.point).normalized();
      largest = std::max(largest, normal.cross(at.normal).norm());
      EXPECT_LT(at.normal.dot(at.point), 0.0) << "towards the camera";
    }
  return largest;
}

TEST(DepthSurface, ElementsAreThoseOfThePlane) {
  const DepthSurface surface = ground();
  EXPECT_LT(max_normal_error(surface), 1e-3);
  int seen = 0;
  for (int row = 0; row < surface.rows(); ++row)
    for (int column = 0; column < surface.columns(); ++column) {
      SurfacePatch at;
      if (!surface.at(column, row, at)) continue;
      ++seen;
      SurfacePatch found;
      // Farther along the same ray.
      ASSERT_TRUE(surface.nearest_to(1.2 * at.point, found));
      EXPECT_EQ(found.point, at.point);
      EXPECT_GT(at.noise_m, 0.0);
    }
  EXPECT_GT(seen, surface.rows() * surface.columns() / 2);
  SurfacePatch none;
  EXPECT_FALSE(surface.nearest_to({0.0, 0.0, -1.0}, none)) << "behind the camera";
  EXPECT_FALSE(surface.nearest_to({9.0, 0.0, 1.0}, none)) << "beside the image";
  EXPECT_FALSE(surface.interpolated_at({9.0, 0.0, 1.0}, none));
}

// A plane seen through another camera is a different plane; normals are recomputed.
TEST(DepthSurface, NormalsFollowTheCamera) {
  DepthSurface surface = ground();
  const DepthSurface before = surface;
  libmap::Camera camera = surface.camera();
  camera.fx *= 1.1;
  camera.cy += 6.0;
  surface.set_camera(camera);
  EXPECT_LT(max_normal_error(surface), 1e-3);
  SurfacePatch was;
  SurfacePatch is;
  ASSERT_TRUE(before.at(10, 10, was));
  ASSERT_TRUE(surface.at(10, 10, is));
  EXPECT_EQ(is.point.z(), was.point.z());
  EXPECT_GT(was.normal.cross(is.normal).norm(), 5e-3);
}

TEST(DepthSurface, CorrectedDepthBendsIt) {
  DepthSurface surface = ground();
  const DepthSurface before = surface;
  const libmap::DepthCorrection correction{0.5, 5.0, {0.0, 0.0, 0.0, 0.0}, {0.05, -0.02, 0.03}};
  surface.correct(correction);
  EXPECT_LT(max_normal_error(surface), 2e-3);
  SurfacePatch was;
  SurfacePatch is;
  ASSERT_TRUE(before.at(1, 1, was));
  ASSERT_TRUE(surface.at(1, 1, is));
  const double step = surface.step_px();
  const double radius2 =
      libmap::squared_image_radius(surface.camera().width, surface.camera().height, step, step);
  EXPECT_NEAR(is.point.z() - was.point.z(), correction.at(was.point.z(), radius2), 1e-6);
  EXPECT_GT(was.normal.cross(is.normal).norm(), 5e-3);
}

TEST(DepthSurface, AnotherNoiseScalesThatOfEachElementByItsRange) {
  DepthSurface surface = ground();
  const DepthSurface before = surface;
  const libmap::DepthNoise stereo{0.001, 0.0, 0.01};
  surface.set_noise({}, stereo);
  for (const int row : {1, surface.rows() / 2, surface.rows() - 2}) {
    SurfacePatch was;
    SurfacePatch is;
    ASSERT_TRUE(before.at(1, row, was));
    ASSERT_TRUE(surface.at(1, row, is));
    EXPECT_EQ(was.point, is.point);
    EXPECT_NEAR(is.noise_m / was.noise_m,
                stereo.axial_at(is.point.z()) / libmap::DepthNoise{}.axial_at(is.point.z()), 0.01);
  }
}

TEST(DepthSurface, CellsMustFitTheCamera) {
  const DepthSurface surface = ground();
  const DepthSurface same(surface.camera(), surface.step_px(), surface.cells());
  SurfacePatch a;
  SurfacePatch b;
  ASSERT_TRUE(surface.at(5, 7, a));
  ASSERT_TRUE(same.at(5, 7, b));
  EXPECT_EQ(a.point, b.point);
  EXPECT_EQ(a.normal, b.normal);
  EXPECT_EQ(
      error_of([&] { DepthSurface(surface.camera(), surface.step_px() + 1, surface.cells()); })
          .context()
          .field,
      "cells");
}

// Iterations of an adjustment intersect different planes. Convergence requires a surface without
// jumps.
TEST(DepthSurface, HasNoJumpsBetweenItsElements) {
  TexturedScan scan;
  scan.see(plane_z(0.0), around(0), Vector6d::Zero());
  const FrameFeatures frame = frame_of(scan);
  const DepthSurface& surface = frame.surfaces.front();
  const Pose eye = *scan.graph_.nodes[0].truth_from_base * frame.cameras.front().base_from_camera;
  double last_met = 0.0;
  double last_nearest = 0.0;
  double jump_of_met = 0.0;
  double jump_of_nearest = 0.0;
  for (int n = 0; n < 2000; ++n) {
    const auto ray =
        libmap::pixel_to_ray(surface.camera(), Eigen::Vector2d(20.0 + 0.1 * n, 40.0 + 0.05 * n));
    const Eigen::Vector3d direction = ray->homogeneous();
    const double truth = plane_z(0.0)(eye.translation(), eye.linear() * direction);
    SurfacePatch met;
    SurfacePatch nearest;
    ASSERT_TRUE(surface.interpolated_at(direction, met));
    ASSERT_TRUE(surface.nearest_to(direction, nearest));
    EXPECT_LT((met.point.hnormalized() - *ray).norm(), 1e-9);
    const double met_error = met.point.z() - truth;
    const double nearest_error =
        nearest.normal.dot(nearest.point) / nearest.normal.dot(direction) - truth;
    EXPECT_LT(std::abs(met_error), 0.02);
    if (n > 0) {
      jump_of_met = std::max(jump_of_met, std::abs(met_error - last_met));
      jump_of_nearest = std::max(jump_of_nearest, std::abs(nearest_error - last_nearest));
    }
    last_met = met_error;
    last_nearest = nearest_error;
  }
  EXPECT_LT(jump_of_met, 0.3 * jump_of_nearest);
}

}  // namespace depth_surface_test
