// COLMAP models: texts, cameras, and points from the depth of a scan.
#include "libmap/poses/colmap_io.h"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "libmap/core/parallel.h"
#include "libmap/scan/colmap_builder.h"
#include "tests/libmap/scan/colmap_reader.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace colmap_io_test {

namespace fs = std::filesystem;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::read_colmap_model;
using graspmap_test::scratch_folder;
using graspmap_test::uniform;
using graspmap_test::write_text;
using ::testing::ElementsAre;

Pose random_pose() {
  return make_pose_from_rpy({uniform(-2, 2), uniform(-2, 2), uniform(-2, 2)},
                            {uniform(-180, 180), uniform(-80, 80), uniform(-180, 180)});
}

// The first image has no features, the last one no line of features.
const char* const images_text =
    "# Image list with two lines of data per image:\n"
    "3 1 0 0 0 1 2 3 7 left/a picture, of rocks.jpg\n"
    "\n"
    "# between images\n"
    "1 0.7071067811865476 0 0 0.7071067811865476 0 0 0 1 b.png\n"
    "10.5 20.25 5 30 40 -1\n"
    "9 -1 0 0 0 0 0 -2.5 1 c.png\n";

TEST(ColmapText, ReadsWhatIsWrittenByHand) {
  const auto images = parse_colmap_images(images_text, "images.txt");
  ASSERT_EQ(images.size(), 3U);
  EXPECT_EQ(images.at(3).name, "left/a picture, of rocks.jpg");
  EXPECT_EQ(images.at(3).camera, 7);
  EXPECT_TRUE(images.at(3).observations.empty());
  EXPECT_EQ(images.at(3).camera_from_world.translation(), Eigen::Vector3d(1, 2, 3));
  // A quarter turn about z: x of the world is y of the camera.
  EXPECT_TRUE((images.at(1).camera_from_world * Eigen::Vector3d::UnitX())
                  .isApprox(Eigen::Vector3d::UnitY(), 1e-15));
  ASSERT_EQ(images.at(1).observations.size(), 2U);
  EXPECT_EQ(images.at(1).observations[0].pixel, Eigen::Vector2d(10.5, 20.25));
  EXPECT_EQ(images.at(1).observations[0].point, 5);
  EXPECT_EQ(images.at(1).observations[1].point, -1);
  EXPECT_TRUE(images.at(9).camera_from_world.linear().isIdentity());
  EXPECT_EQ(images.at(9).camera_from_world.inverse().translation().z(), 2.5);
}

ColmapModel random_model() {
  ColmapModel model;
  model.cameras[4] = {"PINHOLE", 640, 480, {500.0 / 3.0, 501.0 / 7.0, 320.1, 240.7}};
  model.cameras[2] = {"FOV", 64, 48, {1.0 / 3.0, 2, 3, 4, 0.1}};
  for (int id = 1; id <= 5; ++id) {
    ColmapImage image{.camera = id % 2 == 0 ? 4 : 2, .name = std::to_string(id) + ".jpg"};
    image.camera_from_world = random_pose();
    for (int n = 0; n < id - 1; ++n)
      image.observations.push_back({{uniform(0, 640), uniform(0, 480)}, n == 1 ? -1 : n + 10});
    model.images.emplace(id, image);
  }
  for (int id = 10; id < 14; ++id)
    model.points[id] = {{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)},
                        {1, 2, 255},
                        uniform(0, 1),
                        {{2, 0}, {5, 3}}};
  return model;
}

TEST(ColmapText, KeepsEveryDigitThroughFiles) {
  const ColmapModel written = random_model();
  write_colmap_model(scratch_folder(), written);
  const ColmapModel read = read_colmap_model(scratch_folder());
  EXPECT_EQ(to_colmap_cameras(read), to_colmap_cameras(written));
  EXPECT_EQ(to_colmap_points(read), to_colmap_points(written));
  ASSERT_EQ(read.images.size(), written.images.size());
  for (const auto& [id, image] : written.images) {
    const ColmapImage& other = read.images.at(id);
    EXPECT_EQ(other.name, image.name);
    EXPECT_EQ(other.camera, image.camera);
    EXPECT_EQ(other.camera_from_world.translation(), image.camera_from_world.translation());
    EXPECT_LT((other.camera_from_world.matrix() - image.camera_from_world.matrix()).norm(), 1e-14);
    ASSERT_EQ(other.observations.size(), image.observations.size());
    for (std::size_t n = 0; n < image.observations.size(); ++n) {
      EXPECT_EQ(other.observations[n].pixel, image.observations[n].pixel);
      EXPECT_EQ(other.observations[n].point, image.observations[n].point);
    }
  }
}

TEST(ColmapText, NamesTheLineThatIsBroken) {
  struct Case {
    const char* text;
    graspmap_test::ExpectedError expected;
  };
  const Case cases[] = {
      {"1 1 0 0 0 0 0 0 1\n", {.file = "model.txt", .field = "line 1", .value = "9 columns long"}},
      {"1 0.5 0 0 0 0 0 0 1 a.jpg\n", {.file = "model.txt", .field = "line 1", .value = "0.5"}},
      {"1 1 0 0 0 0 1e300 0 1 a.jpg\n",
       {.file = "model.txt", .field = "line 1", .value = "1e+300", .bound = "<= 1e8 m"}},
      {"1 1 0 0 0 0 inf 0 1 a.jpg\n", {.file = "model.txt", .field = "line 1", .value = "inf"}},
      {"1 1 0 0 0 0 0 0 1 a.jpg\n1 2\n",
       {.file = "model.txt", .field = "line 2", .value = "2 columns long"}},
      {"1 1 0 0 0 0 0 0 1 a.jpg\n1 2 x\n", {.file = "model.txt", .field = "line 2", .value = "x"}},
      // The empty line of the features is missing.
      {"1 1 0 0 0 0 0 0 1 a.jpg\n2 1 0 0 0 0 0 0 1 b.jpg\n",
       {.file = "model.txt", .field = "line 2", .value = "10 columns long"}},
      {"1 1 0 0 0 0 0 0 1 a.jpg\n\n1 1 0 0 0 0 0 0 1 b.jpg\n",
       {.file = "model.txt", .field = "line 3", .value = "image 1"}},
      {"99999999999 1 0 0 0 0 0 0 1 a.jpg\n",
       {.file = "model.txt", .field = "line 1", .value = "99999999999"}},
  };
  for (const Case& one : cases) {
    SCOPED_TRACE(one.text);
    const Error error = error_of([&] { parse_colmap_images(one.text, "model.txt"); });
    EXPECT_TRUE(is_error(error, one.expected));
  }
}

TEST(ColmapModel, IsFoundWhereColmapsToolsPutIt) {
  for (const char* place : {"", "sparse", "sparse/0"}) {
    const fs::path top = scratch_folder() / ("scene" + std::to_string(std::string(place).size()));
    fs::create_directories(top / place);
    write_text(top / place / "images.txt", images_text);
    EXPECT_EQ(find_colmap_model(top), (top / place / "images.txt").parent_path()) << place;
  }
}

TEST(ColmapModel, SaysWhyThereIsNone) {
  const fs::path folder = scratch_folder();
  EXPECT_TRUE(is_error(error_of([&] { find_colmap_model(folder); }),
                       {.file = "ColmapModel.SaysWhyThereIsNone"}));
  write_text(folder / "images.bin", "x");
  EXPECT_TRUE(is_error(error_of([&] { find_colmap_model(folder); }),
                       {.file = "ColmapModel.SaysWhyThereIsNone"}));
}

// COLMAP's projections by its documentation of camera models.
Eigen::Vector2d project_as_colmap(const ColmapCamera& camera, const Eigen::Vector3d& point) {
  const std::vector<double>& p = camera.parameters;
  const double u = point.x() / point.z();
  const double v = point.y() / point.z();
  const double r2 = u * u + v * v;
  const auto fisheye = [&](double k1, double k2, double k3, double k4) {
    const double r = std::sqrt(r2);
    const double t = std::atan(r);
    const double t2 = t * t;
    return t * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)))) / r;
  };
  const auto opencv = [&](double factor) {
    const double x = u * factor + 2 * p[6] * u * v + p[7] * (r2 + 2 * u * u);
    const double y = v * factor + 2 * p[7] * u * v + p[6] * (r2 + 2 * v * v);
    return Eigen::Vector2d(p[0] * x + p[2], p[1] * y + p[3]);
  };
  if (camera.model == "PINHOLE") return {p[0] * u + p[2], p[1] * v + p[3]};
  if (camera.model == "OPENCV") return opencv(1 + p[4] * r2 + p[5] * r2 * r2);
  if (camera.model == "FULL_OPENCV")
    return opencv((1 + r2 * (p[4] + r2 * (p[5] + r2 * p[8]))) /
                  (1 + r2 * (p[9] + r2 * (p[10] + r2 * p[11]))));
  EXPECT_EQ(camera.model, "OPENCV_FISHEYE");
  const double s = fisheye(p[4], p[5], p[6], p[7]);
  return {p[0] * s * u + p[2], p[1] * s * v + p[3]};
}

Camera camera_with(DistortionModel model, const std::vector<double>& distortion) {
  Camera camera{.width = 640, .height = 480, .fx = 500, .fy = 510, .cx = 320.5, .cy = 240.5};
  camera.distortion_model = model;
  camera.distortion = distortion;
  return camera;
}

TEST(ColmapCamera, ProjectsAsColmapDoesHalfAPixelAside) {
  using enum DistortionModel;
  for (const Camera& ours :
       {camera_with(none, {}), camera_with(radial_tangential, {-0.1, 0.02, 0.003, -0.004}),
        camera_with(radial_tangential, {-0.1, 0.02, 0.003, -0.004, 0.01, 0.05, -0.02, 0.003}),
        camera_with(equidistant, {-0.1, 0.02, 0.01, -0.004})}) {
    const ColmapCamera camera = to_colmap(ours);
    SCOPED_TRACE(camera.model);
    EXPECT_EQ(camera.width, 640);
    EXPECT_EQ(camera.height, 480);
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector3d point(uniform(-0.5, 0.5), uniform(-0.5, 0.5), uniform(0.9, 1.1));
      const auto pixel = project_point(ours, point);
      ASSERT_TRUE(pixel);
      EXPECT_LT((*pixel + Eigen::Vector2d(0.5, 0.5) - project_as_colmap(camera, point)).norm(),
                1e-10);
    }
  }
}

TEST(ColmapCamera, TakesTheSimplestModelThatHoldsTheLens) {
  Camera camera = camera_with(DistortionModel::none, {});
  EXPECT_EQ(to_colmap(camera).model, "PINHOLE");
  camera.distortion_model = DistortionModel::radial_tangential;
  camera.distortion = {0, 0, 0, 0, 0};
  EXPECT_EQ(to_colmap(camera).model, "PINHOLE");
  camera.distortion = {0.1, 0, 0, 0, 0};
  EXPECT_EQ(to_colmap(camera).model, "OPENCV");
  camera.distortion = {0.1, 0, 0, 0, 0.2};
  EXPECT_EQ(to_colmap(camera).model, "FULL_OPENCV");
  EXPECT_EQ(to_colmap(camera).parameters.size(), 12U);
  camera.distortion = {0.1, 0, 0, 0, 0.2, 0, 0, 0, 0, 0, 0, 0};
  EXPECT_EQ(to_colmap(camera).model, "FULL_OPENCV");
  camera.distortion.back() = 0.01;
  EXPECT_TRUE(is_error(error_of([&] { to_colmap(camera); }),
                       {.field = "distortion by thin prisms", .value = "0.01"}));
  camera.distortion_model = DistortionModel::equidistant;
  camera.distortion = {0, 0, 0, 0};
  EXPECT_EQ(to_colmap(camera).model, "OPENCV_FISHEYE");
}

// A camera 2 m above the ground z = 0 that looks down; a box of 0.5 m height fills x > 0.3.
Pose above(double x) {
  return make_pose({x, 0, 2},
                   Eigen::Quaterniond(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX())));
}

bool is_on_surface(const Eigen::Vector3d& point) {
  const double height = point.x() > 0.3 ? 0.5 : 0.0;
  const bool on_side = std::abs(point.x() - 0.3) < 1e-6 && point.z() > 0.0 && point.z() < 0.5;
  return on_side || std::abs(point.z() - height) < 1e-6;
}

// Depth along a ray from 2 m above to the box's top, its side or the ground.
double depth_of_box(double camera_x, double ray_x) {
  const double to_side = (0.3 - camera_x) / ray_x;
  const bool starts_above_box = camera_x > 0.3;
  const bool is_above_box_at_top =
      starts_above_box ? !(to_side > 0.0 && to_side < 1.5) : to_side > 0.0 && to_side < 1.5;
  if (is_above_box_at_top) return 1.5;
  return !starts_above_box && to_side > 0.0 ? std::min(2.0, to_side) : 2.0;
}

CameraView view_from(const Pose& world_from_camera, int depth_factor = 1) {
  CameraView view;
  Camera& camera = view.color_camera;
  camera.width = 120;
  camera.height = 90;
  camera.fx = camera.fy = 80;
  camera.cx = 60.25;
  camera.cy = 44.5;
  view.color = ColorImage(120, 90);
  for (int y = 0; y < 90; ++y)
    for (int x = 0; x < 120; ++x)
      view.color.at(x, y) = {static_cast<std::uint8_t>(x), static_cast<std::uint8_t>(y), 7};
  view.depth_camera = camera;
  view.depth_camera.width /= depth_factor;
  view.depth_camera.height /= depth_factor;
  view.depth_camera.fx /= depth_factor;
  view.depth_camera.fy /= depth_factor;
  view.depth_camera.cx /= depth_factor;
  view.depth_camera.cy /= depth_factor;
  view.depth = DepthImage(view.depth_camera.width, view.depth_camera.height);
  for (int y = 0; y < view.depth.height; ++y) {
    for (int x = 0; x < view.depth.width; ++x) {
      const Eigen::Vector3d ray = pixel_to_ray(view.depth_camera, {x, y})->homogeneous();
      view.depth.at(x, y) = static_cast<float>(depth_of_box(
          world_from_camera.translation().x(), (world_from_camera.linear() * ray).x()));
    }
  }
  return view;
}

ColmapModel model_of_box(int depth_factor = 1) {
  ColmapBuilder builder({.point_spacing_px = 8});
  for (const double x : {0.0, 0.2, 0.5})
    builder.add_image(std::to_string(x) + ".jpg", view_from(above(x), depth_factor), above(x));
  return builder.model();
}

void expect_consistent(const ColmapModel& model) {
  ASSERT_EQ(model.cameras.size(), 1U);
  std::size_t observed = 0;
  for (const auto& [id, image] : model.images) {
    for (std::size_t n = 0; n < image.observations.size(); ++n) {
      const ColmapObservation& feature = image.observations[n];
      const ColmapPoint& point = model.points.at(feature.point);
      const Eigen::Vector2d pixel = project_as_colmap(model.cameras.at(image.camera),
                                                      image.camera_from_world * point.position);
      EXPECT_LT((pixel - feature.pixel).norm(), 1e-9);
      std::size_t in_track = 0;
      for (const ColmapTrackElement& element : point.track)
        in_track += element.image == id && element.observation == n ? 1 : 0;
      EXPECT_EQ(in_track, 1U);
    }
    observed += image.observations.size();
  }
  std::size_t tracked = 0;
  for (const auto& [id, point] : model.points) tracked += point.track.size();
  EXPECT_EQ(tracked, observed);
}

TEST(ColmapBuilder, PointsLieOnTheSurfaceAndProjectToTheirPixels) {
  const ColmapModel model = model_of_box();
  ASSERT_EQ(model.images.size(), 3U);
  EXPECT_GT(model.points.size(), 100U);
  expect_consistent(model);
  std::size_t seen_thrice = 0;
  for (const auto& [id, point] : model.points) {
    EXPECT_TRUE(is_on_surface(point.position)) << point.position.transpose();
    seen_thrice += point.track.size() == 3 ? 1 : 0;
    // The color is that of the pixel in the center of its cell.
    const Eigen::Vector2d pixel =
        model.images.at(point.track[0].image).observations[point.track[0].observation].pixel;
    EXPECT_EQ(point.color[0], static_cast<int>(pixel.x()));
    EXPECT_EQ(point.color[1], static_cast<int>(pixel.y()));
    EXPECT_EQ(static_cast<int>(pixel.x()) % 8, 4);
  }
  EXPECT_GT(seen_thrice, 50U);
}

TEST(ColmapBuilder, HiddenPointsAreNotObserved) {
  ColmapBuilder builder({.point_spacing_px = 4});
  const Pose ahead = above(0.0);
  builder.add_image("a.jpg", view_from(ahead), ahead);
  CameraView wall = view_from(ahead);
  for (float& depth : wall.depth.pixels) depth = 1.0F;
  builder.add_image("wall.jpg", wall, ahead);
  for (const auto& [id, point] : builder.model().points) EXPECT_EQ(point.track.size(), 1U);
  expect_consistent(builder.model());
}

TEST(ColmapBuilder, SquaresThatHoldAPointGetNoOther) {
  const Pose pose = above(0.0);
  ColmapBuilder builder({.point_spacing_px = 8});
  builder.add_image("a.jpg", view_from(pose), pose);
  const std::size_t points = builder.model().points.size();
  builder.add_image("b.jpg", view_from(pose), pose);
  EXPECT_EQ(builder.model().points.size(), points);
  EXPECT_EQ(builder.model().images.at(2).observations.size(), points);
}

TEST(ColmapBuilder, DepthOfAnotherSizeServesToo) {
  const ColmapModel model = model_of_box(2);
  EXPECT_GT(model.points.size(), 100U);
  expect_consistent(model);
  // The nearest pixel is half a pixel off, which matters on the box's side only.
  for (const auto& [id, point] : model.points)
    EXPECT_TRUE(is_on_surface(point.position) || std::abs(point.position.x() - 0.3) < 0.03)
        << point.position.transpose();
}

TEST(ColmapBuilder, WithoutDepthThereAreCamerasAlone) {
  ColmapBuilder builder;
  CameraView view = view_from(above(0.0));
  view.depth = {};
  builder.add_image("a.jpg", view, above(0.0));
  view.color_camera.fx += 1;
  builder.add_image("b.jpg", view, above(0.1));
  EXPECT_EQ(builder.model().images.size(), 2U);
  EXPECT_EQ(builder.model().cameras.size(), 2U);
  EXPECT_TRUE(builder.model().points.empty());
  view.color_camera.distortion_model = DistortionModel::radial_tangential;
  view.color_camera.distortion = std::vector<double>(12, 0.01);
  EXPECT_TRUE(is_error(error_of([&] { builder.add_image("c.jpg", view, above(0.1)); }),
                       {.field = "distortion by thin prisms", .value = "0.01", .bound = "none"}));
  EXPECT_EQ(builder.model().images.size(), 2U);
}

TEST(ColmapBuilder, RefusesNoSpacing) {
  EXPECT_TRUE(is_error(error_of([] { ColmapBuilder({.point_spacing_px = 0}); }),
                       {.field = "point_spacing_px", .value = "0", .bound = ">= 1 and <= 10000"}));
}

TEST(ColmapBuilder, SameForAnyNumberOfThreads) {
  const auto text = [](unsigned threads) {
    const ThreadLimit limit(threads);
    return to_colmap_images(model_of_box());
  };
  EXPECT_EQ(text(1), text(4));
}

}  // namespace colmap_io_test
}  // namespace libmap
