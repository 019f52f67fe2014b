#include "libmap/simulate/depth_camera.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "libmap/core/parallel.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/support/test_support.h"

namespace depth_camera_test {

using graspmap_test::ball_mesh;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::square_mesh;
using graspmap_test::uniform;
using libmap::Camera;
using libmap::DepthSensorOptions;
using libmap::Pose;
using libmap::SurfaceView;
using libmap::ViewRays;
using libmap::VisibleSurface;

constexpr double radians = std::numbers::pi / 180.0;

Camera small_camera(int scale = 1) {
  return {.width = 64 * scale,
          .height = 48 * scale,
          .fx = 50.0 * scale,
          .fy = 52.0 * scale,
          .cx = 31.0 * scale,
          .cy = 24.5 * scale};
}

// An optical frame at `position` that looks down, its x axis along the world's.
Pose looking_down(const Eigen::Vector3d& position) {
  return libmap::make_pose_from_rpy(position, {180.0, 0.0, 0.0});
}

Eigen::Vector3d ray_of(const ViewRays& rays, std::size_t index) {
  return rays.centers[index].homogeneous();
}

TEST(SurfaceView, DepthOfAPlaneIsExact) {
  Camera distorted = small_camera();
  distorted.distortion_model = libmap::DistortionModel::radial_tangential;
  distorted.distortion = {0.08, -0.1, 0.001, -0.002, 0.02};
  for (const Camera& camera : {small_camera(), distorted}) {
    const ViewRays rays = libmap::make_view_rays(camera);
    const VisibleSurface surface(square_mesh(0.25, 50.0));
    for (int i = 0; i < 10; ++i) {
      const Pose pose = looking_down({uniform(-1, 1), uniform(-1, 1), uniform(1, 3)}) *
                        libmap::make_pose_from_rpy(
                            {0, 0, 0}, {uniform(-40, 40), uniform(-40, 40), uniform(-180, 180)});
      const SurfaceView view = surface.view(rays, pose);
      for (std::size_t p = 0; p < rays.centers.size(); ++p) {
        const Eigen::Vector3d ray = pose.linear() * ray_of(rays, p);
        const double depth = (0.25 - pose.translation().z()) / ray.z();
        if (depth < 0 || depth > 15) continue;
        EXPECT_NEAR(static_cast<double>(view.depth.pixels[p]), depth, 1e-6 * std::max(1.0, depth));
        EXPECT_NEAR(static_cast<double>(view.incidence_cos.pixels[p]), -ray.z() / ray.norm(), 1e-6);
      }
      // The corner between four pixels lies between their rays.
      const Eigen::Vector2d corner = rays.corners[static_cast<std::size_t>(65 * 20 + 30)];
      const Eigen::Vector2d mean = 0.25 * (rays.centers[64 * 19 + 29] + rays.centers[64 * 19 + 30] +
                                           rays.centers[64 * 20 + 29] + rays.centers[64 * 20 + 30]);
      EXPECT_LT((corner - mean).norm(), 1e-4);
    }
  }
}

TEST(SurfaceView, DepthOfABallIsThatOfItsSphere) {
  const double radius = 0.3;
  const Eigen::Vector3d center(0.05, -0.02, 0.4);
  const VisibleSurface surface(ball_mesh(250, 500, center, radius));
  const ViewRays rays = libmap::make_view_rays(small_camera());
  const Pose pose = looking_down({0, 0, 1.5});
  const SurfaceView view = surface.view(rays, pose);
  int hits = 0;
  for (std::size_t p = 0; p < rays.centers.size(); ++p) {
    const Eigen::Vector3d ray = pose.linear() * ray_of(rays, p);
    const Eigen::Vector3d arm = pose.translation() - center;
    const double a = ray.squaredNorm();
    const double b = ray.dot(arm);
    const double root = b * b - a * (arm.squaredNorm() - radius * radius);
    if (root < 0) {
      EXPECT_EQ(view.depth.pixels[p], 0.0F);
      continue;
    }
    const double depth = (-b - std::sqrt(root)) / a;
    const double cosine = -ray.dot(arm + depth * ray) / (std::sqrt(a) * radius);
    if (cosine < 0.3) continue;  // where the facets' edges stand out
    ++hits;
    // Facets of 0.72 degrees lie up to r (1 - cos 0.36 deg) / cosine inside the sphere, twice that
    // with both directions.
    EXPECT_NEAR(static_cast<double>(view.depth.pixels[p]), depth, 2 * 6e-6 / cosine);
  }
  EXPECT_GT(hits, 300);
}

TEST(SurfaceView, NothingBehindTheCameraOrBesideTheMesh) {
  const VisibleSurface surface(square_mesh(0.0));
  const ViewRays rays = libmap::make_view_rays(small_camera());
  for (const Pose& pose : {looking_down({0, 0, -1}), looking_down({100, 0, 1})}) {
    const SurfaceView view = surface.view(rays, pose);
    EXPECT_TRUE(std::all_of(view.depth.pixels.begin(), view.depth.pixels.end(),
                            [](float depth) { return depth == 0.0F; }));
    const auto measured = libmap::measure_depth(view, rays, {}, 1);
    EXPECT_EQ(measured.measured, 0U);
    EXPECT_EQ(measured.edges, 0U);
  }
}

TEST(SurfaceView, ColorsAreTheVerticesAndTheLightIsTheSameOnAPlane) {
  libmap::TriangleMesh mesh = square_mesh(0.0);
  mesh.vertex_colors = {{200, 40, 0}, {200, 80, 0}, {200, 80, 0}, {200, 40, 0}};
  const ViewRays rays = libmap::make_view_rays(small_camera());
  const SurfaceView view = VisibleSurface(mesh).view(rays, looking_down({0, 0, 1}));
  const Eigen::Vector3f middle = view.color.at(31, 24);
  for (int y = 4; y < 44; ++y)
    for (int x = 4; x < 60; ++x) {
      const Eigen::Vector3f& color = view.color.at(x, y);
      // Green grows along x from 40 to 80; red is the same everywhere.
      const double world_x = (x - 31.0) / 50.0;
      EXPECT_NEAR(static_cast<double>(color.x()), static_cast<double>(middle.x()), 1e-5);
      EXPECT_NEAR(static_cast<double>(color.y() / color.x()), (60 + 20 * world_x) / 200, 1e-4);
      EXPECT_NEAR(static_cast<double>(color.z()), 0.0, 1e-6);
    }
  // The mesh from below is lit as its underside.
  EXPECT_GT(middle.x(), 0.5F);
}

TEST(SurfaceView, RockWhereTheMeshHasNoTexture) {
  const auto spread = [](const libmap::TriangleMesh& mesh, libmap::TextureSource texture) {
    const ViewRays rays = libmap::make_view_rays(small_camera());
    const SurfaceView view = VisibleSurface(mesh, texture, 3).view(rays, looking_down({0, 0, 1}));
    double sum = 0, squares = 0, count = 0;
    for (int y = 4; y < 44; ++y)
      for (int x = 4; x < 60; ++x) {
        const auto value = static_cast<double>(view.color.at(x, y).y());
        sum += value, squares += value * value, ++count;
      }
    return std::sqrt(squares / count - sum / count * sum / count);
  };
  libmap::TriangleMesh mesh = square_mesh(0.0);
  EXPECT_GT(spread(mesh, libmap::TextureSource::automatic), 0.05);
  EXPECT_TRUE(is_error(error_of([&] { VisibleSurface(mesh, libmap::TextureSource::mesh); }),
                       {.field = "vertex colors"}));
  mesh.vertex_colors.assign(4, {150, 150, 150});
  EXPECT_GT(spread(mesh, libmap::TextureSource::automatic), 0.05);
  EXPECT_LT(spread(mesh, libmap::TextureSource::mesh), 1e-3);
}

// Residuals of a plane that faces the camera, along the rays, over what the options promise.
struct Residuals {
  double mean_m = 0, deviation = 0, neighbors = 0;
  std::size_t count = 0;
};
Residuals residuals_at(double distance, const DepthSensorOptions& options, std::uint64_t seed) {
  const ViewRays rays = libmap::make_view_rays(small_camera(4));
  const SurfaceView view =
      VisibleSurface(square_mesh(0.0, 50.0)).view(rays, looking_down({0, 0, distance}), false);
  const auto measured = libmap::measure_depth(view, rays, options, seed);
  Residuals result;
  double last = 0;
  for (std::size_t p = 0; p < rays.centers.size(); ++p) {
    const double scale = ray_of(rays, p).norm();
    const double error = (static_cast<double>(measured.depth.pixels[p]) - distance) * scale;
    const double unit = (error - options.depth_offset_m) /
                        (options.noise_m + options.noise_of_range * distance * scale);
    result.mean_m += error;
    result.deviation += unit * unit;
    result.neighbors += unit * last;
    last = unit;
    ++result.count;
  }
  const auto n = static_cast<double>(result.count);
  result.mean_m /= n;
  result.deviation = std::sqrt(result.deviation / n);
  result.neighbors /= n;
  return result;
}

TEST(MeasureDepth, NoiseHasTheStatedSizeAtEachRange) {
  for (const double distance : {0.9, 2.0, 3.5}) {
    for (const double offset : {0.0, 0.018}) {
      DepthSensorOptions options;
      options.depth_offset_m = offset;
      options.far_m = 100.0;
      const Residuals result = residuals_at(distance, options, 7);
      EXPECT_EQ(result.count, 256U * 192U);
      const double expected = options.noise_m + options.noise_of_range * distance;
      EXPECT_NEAR(result.mean_m, offset, 5 * expected / std::sqrt(double(result.count)));
      EXPECT_NEAR(result.deviation, 1.0, 0.02);
      EXPECT_NEAR(result.neighbors, 0.0, 0.02);
    }
  }
}

TEST(MeasureDepth, WholeMillimetersWithinTheLimits) {
  const ViewRays rays = libmap::make_view_rays(small_camera());
  const VisibleSurface surface(square_mesh(0.0, 50.0));
  const Pose pose = looking_down({0, 0, 1.2}) * libmap::make_pose_from_rpy({0, 0, 0}, {40, 0, 0});
  const SurfaceView view = surface.view(rays, pose, false);
  DepthSensorOptions options = libmap::ideal_depth_sensor(1.0, 2.0);
  options.depth_step_m = 0.001;
  const auto measured = libmap::measure_depth(view, rays, options, 1);
  std::size_t count = 0;
  for (std::size_t p = 0; p < rays.centers.size(); ++p) {
    const auto depth = static_cast<double>(measured.depth.pixels[p]);
    const auto truth = static_cast<double>(view.depth.pixels[p]);
    EXPECT_EQ(depth > 0, truth >= 0.9995 && truth <= 2.0005) << truth;
    if (depth == 0) continue;
    ++count;
    EXPECT_NEAR(depth, truth, 0.0005 + 1e-6);
    EXPECT_NEAR(depth * 1000, std::round(depth * 1000), 2e-4);
  }
  EXPECT_GT(count, 500U);
  EXPECT_LT(count, rays.centers.size());
  EXPECT_EQ(measured.measured, count);
}

// A square 1 m below the camera, from -0.2 to 0.2, over one 2 m below.
struct Step {
  ViewRays rays = libmap::make_view_rays(small_camera(2));
  SurfaceView view;
  Step() {
    const libmap::TriangleMesh mesh =
        graspmap_test::join_meshes(square_mesh(0.0, 50.0), square_mesh(1.0, 0.2));
    view = VisibleSurface(mesh).view(rays, looking_down({0.013, 0.007, 2.0}), false);
  }
  // Distance in pixels from the outline of the upper square in the image.
  double edge_distance(std::size_t p) const {
    const Eigen::Vector2d ray = rays.centers[p];
    const double x = std::abs(ray.x() + 0.013) - 0.2;
    const double y = std::abs(-ray.y() + 0.007) - 0.2;
    const double outside = std::max(x * 100.0, y * 104.0);
    return std::abs(outside);
  }
};

TEST(MeasureDepth, FlyingPixelsStandOnlyAtEdges) {
  const Step step;
  DepthSensorOptions options = libmap::ideal_depth_sensor(0.1, 10.0);
  options.flying_pixels = 1.0;
  const auto measured = libmap::measure_depth(step.view, step.rays, options, 5);
  std::size_t between = 0;
  double sum = 0;
  for (std::size_t p = 0; p < step.rays.centers.size(); ++p) {
    const auto depth = static_cast<double>(measured.depth.pixels[p]);
    EXPECT_GE(depth, 1.0 - 1e-6);
    EXPECT_LE(depth, 2.0 + 1e-6);
    if (std::abs(depth - 1) < 1e-6 || std::abs(depth - 2) < 1e-6) continue;
    ++between;
    sum += depth;
    EXPECT_LE(step.edge_distance(p), 0.51);
  }
  // The outline is 4 * 0.4 m * about 102 pixels a meter long; one pixel per step of it.
  EXPECT_NEAR(static_cast<double>(between), 163.0, 8.0);
  EXPECT_EQ(measured.flying, between);
  EXPECT_EQ(measured.edges, between);
  EXPECT_NEAR(sum / static_cast<double>(between), 1.5, 0.1);
}

TEST(MeasureDepth, EdgePixelsAreLostInTheStatedShare) {
  const Step step;
  DepthSensorOptions options = libmap::ideal_depth_sensor(0.1, 10.0);
  std::size_t lost = 0;
  std::size_t edges = 0;
  options.edge_dropouts = 0.4;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const auto measured = libmap::measure_depth(step.view, step.rays, options, seed);
    lost += measured.depth.pixels.size() - measured.measured;
    edges += measured.edges;
    EXPECT_EQ(measured.flying, 0U);
    for (std::size_t p = 0; p < step.rays.centers.size(); ++p)
      if (measured.depth.pixels[p] == 0.0F) {
        EXPECT_LE(step.edge_distance(p), 0.51);
      }
  }
  EXPECT_NEAR(static_cast<double>(lost) / static_cast<double>(edges), 0.4, 0.035);
}

TEST(MeasureDepth, APlaneHasNoEdgesHoweverFlatItIsSeen) {
  const ViewRays rays = libmap::make_view_rays(small_camera());
  const VisibleSurface surface(square_mesh(0.0, 1e4));
  const Pose pose = looking_down({0, 0, 0.3}) * libmap::make_pose_from_rpy({0, 0, 0}, {70, 0, 0});
  const SurfaceView view = surface.view(rays, pose, false);
  // To the horizon, where the rays end that meet nothing; before it depth doubles from row to row.
  const auto measured = libmap::measure_depth(view, rays, libmap::ideal_depth_sensor(0.01, 1e6), 1);
  std::size_t seen = 0;
  for (const float depth : view.depth.pixels) seen += depth > 0;
  EXPECT_GT(seen, 2000U);
  EXPECT_LE(measured.edges, 2 * 64U);
}

TEST(MeasureDepth, GrazingSurfacesAreLostMoreAndMore) {
  const ViewRays rays = libmap::make_view_rays(small_camera(4));
  const VisibleSurface surface(square_mesh(0.0, 1e3));
  const Pose pose = looking_down({0, 0, 0.5}) * libmap::make_pose_from_rpy({0, 0, 0}, {65, 0, 0});
  const SurfaceView view = surface.view(rays, pose, false);
  DepthSensorOptions options = libmap::ideal_depth_sensor(0.01, 1e6);
  options.max_incidence_deg = 80.0;
  const auto measured = libmap::measure_depth(view, rays, options, 3);
  std::vector<double> seen(90), kept(90);
  for (std::size_t p = 0; p < rays.centers.size(); ++p) {
    if (view.depth.pixels[p] <= 0) continue;
    const double angle = std::acos(static_cast<double>(view.incidence_cos.pixels[p])) / radians;
    const auto bin = std::min<std::size_t>(89, static_cast<std::size_t>(angle));
    seen[bin] += 1;
    kept[bin] += measured.depth.pixels[p] > 0;
  }
  for (std::size_t bin = 50; bin < 88; ++bin) {
    ASSERT_GT(seen[bin], 100) << bin;
    // Pixels spread over a bin of one degree.
    const double expected = std::clamp((80.0 - (double(bin) + 0.5)) / 10.0, 0.0, 1.0);
    const bool certain = bin < 70 || bin >= 80;
    EXPECT_NEAR(kept[bin] / seen[bin], expected, certain ? 0.0 : 2.0 / std::sqrt(seen[bin]) + 0.02)
        << bin;
  }
}

TEST(TakePhoto, DarkerCornersAndNoiseOfTheStatedSize) {
  SurfaceView view;
  view.color = libmap::Image<Eigen::Vector3f>(101, 81, Eigen::Vector3f(0.4F, 0.6F, 0.8F));
  const auto still = libmap::take_photo(view, {.vignetting = 0.25, .color_noise = 0.0}, 1);
  EXPECT_EQ(still.at(50, 40), (libmap::Color{102, 153, 204}));
  EXPECT_EQ(still.at(0, 0), (libmap::Color{77, 115, 153}));
  EXPECT_EQ(still.at(100, 80), still.at(0, 0));
  const auto noisy = libmap::take_photo(view, {.vignetting = 0.0, .color_noise = 3.0}, 1);
  double squares = 0;
  for (const libmap::Color& color : noisy.pixels) squares += std::pow(color[1] - 153.0, 2);
  // Rounding adds 1/12.
  EXPECT_NEAR(std::sqrt(squares / (101 * 81)), std::sqrt(9 + 1.0 / 12), 0.1);
  EXPECT_NE(noisy, libmap::take_photo(view, {.vignetting = 0.0, .color_noise = 3.0}, 2));
}

TEST(DepthCamera, SameImagesForAnyThreadCountAndOthersForAnotherSeed) {
  const libmap::TriangleMesh mesh =
      graspmap_test::join_meshes(square_mesh(0.0, 2.0), ball_mesh(20, 40, {0, 0, 0.3}, 0.4));
  const ViewRays rays = libmap::make_view_rays(small_camera(2));
  std::vector<libmap::DepthImage> depths;
  std::vector<libmap::ColorImage> colors;
  for (const unsigned threads : {1U, 2U, 4U}) {
    const libmap::ThreadLimit limit(threads);
    const SurfaceView view = VisibleSurface(mesh).view(rays, looking_down({0, 0, 2}));
    depths.push_back(libmap::measure_depth(view, rays, {}, 9).depth);
    colors.push_back(libmap::take_photo(view, {}, 9));
    EXPECT_EQ(depths.back(), depths.front());
    EXPECT_EQ(colors.back(), colors.front());
    EXPECT_NE(libmap::measure_depth(view, rays, {}, 10).depth, depths.front());
  }
}

TEST(DepthCamera, RefusesWhatCannotBe) {
  EXPECT_TRUE(is_error(error_of([&] { VisibleSurface{libmap::TriangleMesh{}}; }),
                       {.field = "triangles of the mesh"}));
  DepthSensorOptions options;
  options.far_m = options.near_m;
  EXPECT_EQ(error_of([&] { options.check(); }).context().field, "far_m");
  options = {};
  options.flying_pixels = 0.7;
  options.edge_dropouts = 0.7;
  EXPECT_EQ(error_of([&] { options.check(); }).context().value, "1.4");
}

TEST(DepthCamera, InsideAClosedBallOnlyWhatIsNotTooNear) {
  const VisibleSurface surface(ball_mesh(20, 40, {0, 0, 0}, 0.3));
  const ViewRays rays = libmap::make_view_rays(small_camera());
  const SurfaceView view = surface.view(rays, looking_down({0, 0, 0}), false);
  EXPECT_TRUE(std::all_of(view.depth.pixels.begin(), view.depth.pixels.end(),
                          [](float depth) { return depth > 0.1F; }));
  EXPECT_EQ(libmap::measure_depth(view, rays, {}, 1).measured, 0U);
}

}  // namespace depth_camera_test
