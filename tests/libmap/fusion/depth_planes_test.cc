#include "libmap/fusion/depth_planes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/libmap/fusion/depth_scenes.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace depth_planes_test {

using graspmap_test::box;
using graspmap_test::error_of;
using graspmap_test::looking;
using graspmap_test::nearest_of;
using graspmap_test::plane_z;
using graspmap_test::random_engine;
using graspmap_test::render_depth;
using graspmap_test::small_camera;
using graspmap_test::Surface;

// The camera looks at the plane z = 0 from `height`, this many degrees from straight down.
Pose tilted_eye(double height, double incidence_deg) {
  const double angle = incidence_deg * std::numbers::pi / 180;
  return looking({0, 0, height}, {height * std::tan(angle), 0, 0}) * optical_to_body_rotation();
}

std::size_t sum_of(const DepthPixelCounts& counts) {
  return counts.unmeasured + counts.out_of_range + counts.without_ray + counts.flying +
         counts.grazing + counts.used;
}

TEST(DepthPlanes, SlantedPlaneKeepsItsPlaceAndNormal) {
  for (const double incidence : {0.0, 30.0, 60.0}) {
    for (const bool bent : {false, true}) {
      Camera camera = small_camera();
      if (bent) {
        camera.distortion_model = DistortionModel::radial_tangential;
        camera.distortion = {-0.2, 0.05, 0.002, 0.001};
      }
      const Pose eye = tilted_eye(1.0, incidence);
      const DepthImage depth = render_depth(plane_z(0), camera, eye, {}, random_engine());
      const DepthPlanes planes = fit_depth_planes(depth, pixel_rays(camera));
      const Eigen::Vector3f up = eye.linear().transpose().col(2).cast<float>();
      EXPECT_GT(planes.counts.used, 6000U);
      EXPECT_EQ(sum_of(planes.counts), planes.counts.pixels);
      for (std::size_t n = 0; n < depth.pixels.size(); ++n) {
        if (planes.support[n] == 0) continue;
        // Second-order effects of the lens stay.
        const float bound = (bent ? 1e-3F : 1e-5F) * depth.pixels[n];
        ASSERT_NEAR(planes.depth_m[n], depth.pixels[n], bound) << incidence;
        if (planes.support[n] > 30) {
          ASSERT_GT(planes.normals[n].dot(up), bent ? 0.999F : 0.99999F) << incidence;
        }
      }
    }
  }
}

TEST(DepthPlanes, NoiseShrinksAsTheSupportGrows) {
  const Camera camera = small_camera();
  const Pose eye = tilted_eye(1.5, 20);
  const graspmap_test::DepthNoiseModel noise{0.002, 0.005};
  const DepthImage truth = render_depth(plane_z(0), camera, eye, {}, random_engine());
  const DepthImage depth = render_depth(plane_z(0), camera, eye, noise, random_engine());
  const DepthPlanes planes = fit_depth_planes(depth, pixel_rays(camera));
  double raw = 0;
  double fitted = 0;
  std::size_t count = 0;
  for (std::size_t n = 0; n < depth.pixels.size(); ++n) {
    if (planes.support[n] < 37) continue;
    raw += std::pow(depth.pixels[n] - truth.pixels[n], 2);
    fitted += std::pow(planes.depth_m[n] - truth.pixels[n], 2);
    ++count;
  }
  ASSERT_GT(count, 5000U);
  EXPECT_NEAR(std::sqrt(raw / fitted), std::sqrt(37.0), 0.15 * std::sqrt(37.0));
}

TEST(DepthPlanes, EdgeIsNotSmeared) {
  // A step of 20 cm across the image does not change the depths on both sides.
  const Surface step = nearest_of({plane_z(2.0), box({0.01, -5, 1.8}, {5, 5, 1.9})});
  const Camera camera = small_camera();
  const DepthImage depth = render_depth(step, camera, Pose::Identity(), {}, random_engine());
  const DepthPlanes planes = fit_depth_planes(depth, pixel_rays(camera));
  EXPECT_EQ(planes.counts.used, planes.counts.pixels) << "pixels at the edge join their own side";
  for (std::size_t n = 0; n < depth.pixels.size(); ++n)
    ASSERT_NEAR(planes.depth_m[n], depth.pixels[n], 1e-5);
}

TEST(DepthPlanes, FlyingPixelsAreFound) {
  const Camera camera = small_camera();
  DepthImage depth = render_depth(plane_z(2), camera, Pose::Identity(), {}, random_engine());
  std::size_t flying = 0;
  for (int y = 5; y < 90; y += 7)
    for (int x = 5; x < 120; x += 7, ++flying)
      depth.at(x, y) = 1.2F + 0.005F * static_cast<float>(x);
  const DepthPlanes planes = fit_depth_planes(depth, pixel_rays(camera));
  EXPECT_EQ(planes.counts.flying, flying);
  for (const float z : planes.depth_m)
    if (z > 0) {
      ASSERT_NEAR(z, 2.0F, 1e-5F);
    }
}

TEST(DepthPlanes, EachPixelIsCountedOnce) {
  Camera camera = small_camera();
  camera.distortion_model = DistortionModel::radial_tangential;
  camera.distortion = {-0.9, 0.0, 0.0, 0.0};
  const PixelRays rays = pixel_rays(camera);
  DepthImage depth(camera.width, camera.height, 1.0F);
  depth.at(60, 40) = 0.0F;
  depth.at(61, 40) = std::numeric_limits<float>::quiet_NaN();
  depth.at(62, 40) = -2.0F;
  depth.at(63, 40) = 9.0F;
  depth.at(64, 40) = 0.01F;
  const DepthPlanes planes = fit_depth_planes(depth, rays);
  EXPECT_EQ(planes.counts.unmeasured, 3U);
  EXPECT_EQ(planes.counts.out_of_range, 2U);
  EXPECT_EQ(planes.counts.without_ray, rays.blind.size());
  EXPECT_GT(planes.counts.without_ray, 0U);
  EXPECT_EQ(sum_of(planes.counts), planes.counts.pixels);
}

TEST(DepthPlanes, GrazingSurfacesAreDropped) {
  const Camera camera = small_camera();
  const DepthImage depth =
      render_depth(plane_z(0), camera, tilted_eye(0.5, 65), {}, random_engine());
  DepthPlaneOptions options;
  options.max_incidence_deg = 70;
  const DepthPlanes planes = fit_depth_planes(depth, pixel_rays(camera), options);
  EXPECT_GT(planes.counts.grazing + planes.counts.flying, 500U);
  EXPECT_GT(planes.counts.used, 500U);
  const float least = std::cos(70.0F * std::numbers::pi_v<float> / 180);
  for (std::size_t n = 0; n < depth.pixels.size(); ++n)
    if (planes.support[n] > 0) {
      ASSERT_GE(planes.cos_incidence[n], least);
    }
}

TEST(DepthPlanes, TinyImages) {
  for (const auto& [width, height] : {std::pair{1, 1}, {2, 3}, {5, 1}, {3, 3}}) {
    Camera camera = small_camera();
    camera.width = width;
    camera.height = height;
    const DepthPlanes planes =
        fit_depth_planes(DepthImage(width, height, 1.0F), pixel_rays(camera));
    EXPECT_EQ(sum_of(planes.counts), planes.counts.pixels) << width << " x " << height;
  }
}

}  // namespace depth_planes_test
}  // namespace libmap
