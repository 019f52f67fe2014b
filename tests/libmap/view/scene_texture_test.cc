#include "libmap/view/layer_geometry.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "libmap/core/error.h"
#include "libmap/view/scene_view.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace scene_texture_test {

using graspmap_test::error_of;

// Two squares side by side, x from -1 to 1: on the left the four quarters of a page, on the right
// another page of one color, below both a strip without a page.
TexturedMesh two_pages() {
  TexturedMesh model;
  const auto add_square = [&](double x0, double y0, double x1, double y1, std::int32_t page) {
    const auto first = static_cast<std::uint32_t>(model.mesh.vertices.size());
    model.mesh.vertices.insert(model.mesh.vertices.end(),
                               {{x0, y0, 0}, {x1, y0, 0}, {x1, y1, 0}, {x0, y1, 0}});
    model.mesh.triangles.push_back({first, first + 1, first + 2});
    model.mesh.triangles.push_back({first, first + 2, first + 3});
    // The page's top lies at y1.
    model.texture_coordinates.push_back(
        {Eigen::Vector2f(0, 1), Eigen::Vector2f(1, 1), Eigen::Vector2f(1, 0)});
    model.texture_coordinates.push_back(
        {Eigen::Vector2f(0, 1), Eigen::Vector2f(1, 0), Eigen::Vector2f(0, 0)});
    model.page_of_triangle.insert(model.page_of_triangle.end(), 2, page);
  };
  add_square(-1, -0.5, 0, 0.5, 0);
  add_square(0, -0.5, 1, 0.5, 1);
  add_square(-1, -1, 1, -0.5, no_page);
  ColorImage quarters(64, 64);
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 64; ++x)
      quarters.at(x, y) = {static_cast<std::uint8_t>(x < 32 ? 200 : 40),
                           static_cast<std::uint8_t>(y < 32 ? 180 : 20), 90};
  model.pages = {quarters, ColorImage(30, 20, {10, 120, 230})};
  return model;
}

SceneViewOptions bare(int width, int height) {
  SceneViewOptions options;
  options.width = width;
  options.height = height;
  options.axes = options.scale_bar = options.legend = false;
  return options;
}

Color color_of(const ColorImage& image, const SceneCamera& camera, const Eigen::Vector3d& point) {
  const auto pixel = camera.pixel_of(point);
  return image.at(static_cast<int>(pixel.x()), static_cast<int>(pixel.y()));
}

TEST(SceneTexture, ShowsThePagesWhereTheyBelong) {
  SceneLayer layer;
  layer.shape = two_pages();
  const Scene scene{.layers = {layer}, .markers = {}};
  const SceneViewOptions options = bare(300, 300);
  const ColorImage image = render_scene(scene, options);
  const SceneCamera camera = camera_of(scene, options);
  const auto near = [](const Color& a, const Color& b) {
    for (std::size_t c = 0; c < 3; ++c)
      if (std::abs(a[c] - b[c]) > 2) return false;
    return true;
  };
  EXPECT_TRUE(near(color_of(image, camera, {-0.75, 0.25, 0}), {200, 180, 90})) << "top left";
  EXPECT_TRUE(near(color_of(image, camera, {-0.25, 0.25, 0}), {40, 180, 90})) << "top right";
  EXPECT_TRUE(near(color_of(image, camera, {-0.75, -0.25, 0}), {200, 20, 90})) << "lower left";
  EXPECT_TRUE(near(color_of(image, camera, {-0.25, -0.25, 0}), {40, 20, 90})) << "lower right";
  EXPECT_TRUE(near(color_of(image, camera, {0.5, 0.1, 0}), {10, 120, 230}));
  EXPECT_TRUE(near(color_of(image, camera, {0.5, -0.75, 0}), untextured_color));
}

TEST(SceneTexture, OtherColorsAndShades) {
  SceneLayer layer;
  layer.shape = two_pages();
  layer.coloring.mode = ColorMode::single;
  layer.shading = Shading::none;
  layer.coloring.color = "#ff0000";
  Scene scene{.layers = {layer}, .markers = {}};
  const SceneViewOptions options = bare(120, 120);
  EXPECT_EQ(color_of(render_scene(scene, options), camera_of(scene, options), {-0.7, 0.2, 0}),
            (Color{255, 0, 0}));
  // Shaded, it is darker than its page.
  scene.layers[0].coloring.mode = ColorMode::texture;
  scene.layers[0].shading = Shading::full;
  const Color shaded =
      color_of(render_scene(scene, options), camera_of(scene, options), {0.5, 0.1, 0});
  EXPECT_LT(shaded[2], 215);
  EXPECT_GT(shaded[2], 100);
}

TEST(SceneTexture, LayersOfPages) {
  SceneLayer layer;
  TexturedMesh model = two_pages();
  model.mesh.vertices[0].x() = std::numeric_limits<double>::quiet_NaN();
  layer.shape = model;
  const auto layers = prepare_layers(layer, Pose::Identity());
  // Both triangles of the first page have that corner.
  ASSERT_EQ(layers.size(), 2U);
  EXPECT_EQ(layers[0].texture->width, 30);
  EXPECT_EQ(layers[0].coordinates.size(), 6U);
  EXPECT_EQ(layers[1].texture, nullptr);
}

TEST(SceneTexture, WhatHasNone) {
  SceneLayer layer;
  layer.coloring.mode = ColorMode::texture;
  PointCloud cloud;
  cloud.positions = {{0, 0, 0}, {1, 0, 0}};
  layer.shape = cloud;
  EXPECT_EQ(error_of([&] { prepare_layers(layer, Pose::Identity()); }).context().value, "texture");
  TexturedMesh model = two_pages();
  model.pages.clear();
  model.page_of_triangle.assign(model.page_of_triangle.size(), no_page);
  layer.shape = model;
  EXPECT_EQ(error_of([&] { prepare_layers(layer, Pose::Identity()); }).context().value, "texture");
  layer.coloring.mode = ColorMode::automatic;
  EXPECT_EQ(prepare_layers(layer, Pose::Identity()).size(), 1U) << "drawn as a mesh";
  model = two_pages();
  model.page_of_triangle[0] = 5;
  layer.shape = model;
  EXPECT_TRUE(graspmap_test::is_error(
      error_of([&] { prepare_layers(layer, Pose::Identity()); }),
      {.field = "texture page of triangle 0", .value = "5", .bound = ">= -1 and < 2"}));
}

}  // namespace scene_texture_test
}  // namespace libmap
