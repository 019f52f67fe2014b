#include "libmap/view/scene_view.h"
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <limits>
#include <memory>
#include <set>

#include "libmap/view/image_io.h"
#include "libmap/view/offscreen.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace scene_view_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::uniform;

constexpr Color background{95, 107, 122};
constexpr Color red{255, 0, 0};
constexpr Color green{0, 255, 0};
constexpr Color blue{0, 0, 255};

SceneLayer colored_points(const std::vector<Eigen::Vector3d>& positions,
                          const std::vector<Color>& colors, double size_m) {
  PointCloud cloud;
  cloud.positions = positions;
  cloud.colors = colors;
  SceneLayer layer;
  layer.shape = cloud;
  layer.coloring.mode = ColorMode::own;
  layer.point_size_m = size_m;
  return layer;
}

// Options for a scene that fills the image.
SceneViewOptions bare(int width, int height, Viewpoint view = Viewpoint::top) {
  SceneViewOptions options;
  options.width = width;
  options.height = height;
  options.view = view;
  options.axes = options.scale_bar = options.legend = false;
  return options;
}

Color color_at(const ColorImage& image, const Eigen::Vector2d& pixel) {
  return image.at(static_cast<int>(pixel.x()), static_cast<int>(pixel.y()));
}

std::size_t count(const ColorImage& image, const Color& color) {
  std::size_t found = 0;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) found += image.at(x, y) == color ? 1 : 0;
  return found;
}

class SceneViewTest : public ::testing::Test {
 protected:
  void SetUp() override { display_ = std::make_unique<VirtualDisplay>(); }

 private:
  std::unique_ptr<VirtualDisplay> display_;
};

TEST_F(SceneViewTest, ASquareIsWhereItShouldBeAndAsLarge) {
  Scene scene;
  // Corners at +-1 m with squares of 0.2 m: 2.2 m over 0.9 of 440 pixels: 180 pixels a meter.
  scene.layers.push_back(
      colored_points({{-1, -1, 0}, {1, 1, 0}, {0, 0, 0}}, {blue, green, red}, 0.2));
  scene.layers[0].point_shape = PointShape::square;
  const SceneViewOptions options = bare(440, 440);
  const ColorImage image = render_scene(scene, options);
  EXPECT_NEAR(camera_of(scene, options).scale_px, 180.0, 1e-9);
  for (int offset = -18 + 1; offset < 18 - 1; ++offset) {
    EXPECT_EQ(image.at(220 + offset, 220), red) << offset;
    EXPECT_EQ(image.at(220, 220 + offset), red) << offset;
  }
  EXPECT_EQ(image.at(220 + 19, 220), background);
  EXPECT_EQ(image.at(220 - 20, 220), background);
  EXPECT_EQ(image.at(220, 220 - 20), background);
  EXPECT_EQ(image.at(220, 220 + 19), background);
  EXPECT_EQ(image.at(220 + 180, 220 - 180), green);
  EXPECT_EQ(image.at(220 - 180, 220 + 180), blue);
  EXPECT_EQ(count(image, red), 36U * 36U);
}

TEST_F(SceneViewTest, EveryViewShowsThePointsWhereItsCameraSays) {
  Scene scene;
  scene.terrain_from_scene = make_pose_from_rpy({5, -3, 1}, {10, 20, 30});
  std::vector<Eigen::Vector3d> positions;
  std::vector<Color> colors;
  for (int i = 0; i < 12; ++i) {
    positions.emplace_back(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    colors.push_back({static_cast<std::uint8_t>(20 * i), 10, 200});
  }
  scene.layers.push_back(colored_points(positions, colors, 0.03));
  for (const auto& [name, view] : viewpoint_names()) {
    SceneViewOptions options;  // with all that stands around the scene
    options.width = 700;
    options.height = 500;
    options.title = name;
    options.view = view;
    options.camera.position = {-1, -7, 3};
    const ColorImage image = render_scene(scene, options);
    const SceneCamera camera = camera_of(scene, options);
    int seen = 0;
    for (std::size_t i = 0; i < positions.size(); ++i)
      seen +=
          color_at(image, camera.pixel_of(scene.terrain_from_scene * positions[i])) == colors[i];
    EXPECT_GE(seen, 11) << name;  // one may hide another
  }
}

TEST_F(SceneViewTest, TopViewShowsTheHighest) {
  Scene scene;
  scene.layers.push_back(colored_points({{0, 0, 0}, {0, 0, 1}, {0, 0, 0.5}, {1, 0, 0}},
                                        {blue, red, green, blue}, 0.2));
  const SceneViewOptions options = bare(200, 200);
  const ColorImage image = render_scene(scene, options);
  EXPECT_EQ(color_at(image, camera_of(scene, options).pixel_of({0, 0, 0})), red);
}

TEST_F(SceneViewTest, ScoresHaveTheColorsOfTheLegendExactly) {
  Scene scene;
  PointCloud cloud;
  const std::vector<double> scores{0.95, 0.85, 0.75, 0.65, 0.55, 0.45, 0.1};
  for (std::size_t i = 0; i < scores.size(); ++i)
    cloud.positions.emplace_back(0.01 * double(i), 0.0, 0.05);
  cloud.positions.emplace_back(0.07, 0.0, -0.05);
  cloud.add_field("score", ScalarType::float32).values = scores;
  cloud.fields[0].values.resize(cloud.size(), 0.95);
  SceneLayer layer;
  layer.shape = cloud;
  layer.coloring.zero_plane_m = 0.0;
  scene.layers.push_back(layer);
  SceneViewOptions options = bare(400, 300);
  options.legend = true;
  const ColorImage image = render_scene(scene, options);
  const SceneCamera camera = camera_of(scene, options);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Color expected = i < scores.size() ? score_color(scores[i]) : below_plane_color;
    EXPECT_EQ(color_at(image, camera.pixel_of(cloud.positions[i])), expected) << i;
  }
  // The legend's box of each class, to the right of the plot.
  for (const LegendEntry& entry : score_legend().entries) {
    std::size_t in_legend = 0;
    for (int y = 0; y < image.height; ++y)
      for (int x = static_cast<int>(camera.plot.right()); x < image.width; ++x)
        in_legend += image.at(x, y) == entry.color ? 1 : 0;
    EXPECT_GE(in_legend, 50U) << entry.text;
  }
}

TEST_F(SceneViewTest, ALatticeIsDrawnWithoutGaps) {
  Scene scene;
  PointCloud cloud;
  for (int i = 0; i < 60; ++i)
    for (int j = 0; j < 60; ++j)
      cloud.positions.emplace_back(0.01F * float(i), 0.01F * float(j), 0.0);
  cloud.colors.assign(cloud.size(), red);
  SceneLayer layer;
  layer.shape = cloud;
  layer.coloring.mode = ColorMode::own;
  scene.layers.push_back(layer);
  const SceneViewOptions options = bare(437, 391);
  const ColorImage image = render_scene(scene, options);
  const SceneCamera camera = camera_of(scene, options);
  const Eigen::Vector2d low = camera.pixel_of({0, 0.59, 0});
  const Eigen::Vector2d high = camera.pixel_of({0.59, 0, 0});
  for (int y = static_cast<int>(low.y()); y < static_cast<int>(high.y()); ++y)
    for (int x = static_cast<int>(low.x()); x < static_cast<int>(high.x()); ++x)
      ASSERT_EQ(image.at(x, y), red) << x << ", " << y;
}

// A map of a sparse cloud has empty cells: they take a neighbor's color, and cover no neighbor.
TEST_F(SceneViewTest, EmptyCellsOfAMapAreClosed) {
  Scene scene;
  PointCloud cloud;
  for (int i = 0; i < 60; ++i)
    for (int j = 0; j < 60; ++j)
      if ((3 * i + 5 * j) % 7 > 1) {
        const bool high = (i / 8 + j / 8) % 2 == 0;  // by a cliff
        cloud.positions.emplace_back(0.01 * i, 0.01 * j, high ? 0.2 : 0.0);
        cloud.colors.push_back(high ? red : green);
      }
  SceneLayer layer;
  layer.shape = cloud;
  layer.coloring.mode = ColorMode::own;
  scene.layers.push_back(layer);
  const SceneViewOptions options = bare(600, 600);
  const ColorImage image = render_scene(scene, options);
  const SceneCamera camera = camera_of(scene, options);
  for (std::size_t i = 0; i < cloud.size(); ++i)
    for (const double offset : {-0.0035, 0.0035})
      EXPECT_EQ(color_at(image, camera.pixel_of(cloud.positions[i] +
                                                Eigen::Vector3d(offset, offset, 0.0))),
                cloud.colors[i]);
  const Eigen::Vector2d low = camera.pixel_of({0.02, 0.57, 0});
  const Eigen::Vector2d high = camera.pixel_of({0.57, 0.02, 0});
  for (int y = static_cast<int>(low.y()); y < static_cast<int>(high.y()); ++y)
    for (int x = static_cast<int>(low.x()); x < static_cast<int>(high.x()); ++x)
      ASSERT_NE(image.at(x, y), background) << x << ", " << y;
}

TEST_F(SceneViewTest, AMeshIsFilledAndShadedUnlessToldNotTo) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0.5}, {0, 1, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 3, 2}};  // the second from its back
  SceneLayer layer;
  layer.shape = mesh;
  layer.coloring.mode = ColorMode::single;
  layer.coloring.color = "#c08040";
  layer.shading = Shading::none;
  Scene scene;
  scene.layers.push_back(layer);
  const SceneViewOptions options = bare(300, 300);
  const ColorImage flat = render_scene(scene, options);
  const SceneCamera camera = camera_of(scene, options);
  for (const double x : {0.05, 0.3, 0.6, 0.95})
    for (const double y : {0.06, 0.31, 0.7, 0.94})
      EXPECT_EQ(color_at(flat, camera.pixel_of({x, y, 0})), (Color{0xc0, 0x80, 0x40}));
  scene.layers[0].shading = Shading::automatic;
  EXPECT_EQ(count(render_scene(scene, options), {0xc0, 0x80, 0x40}), 0U);
}

TEST_F(SceneViewTest, MarkersLieOverTheTerrainAndTakeTheirVerdictsColor) {
  Scene scene;
  scene.layers.push_back(
      colored_points({{-1, -1, 9}, {1, 1, 9}, {0, 0, 9}}, {blue, blue, blue}, 1.2));
  scene.markers = {{{0, 0, 0}, "P1", Verdict::pass},
                   {{-0.5, 0.5, 0}, "P2", Verdict::fail},
                   {{0.5, -0.5, 0}, "", Verdict::none}};
  SceneViewOptions options = bare(600, 600);
  const ColorImage image = render_scene(scene, options);
  const SceneCamera camera = camera_of(scene, options);
  EXPECT_EQ(color_at(image, camera.pixel_of({0, 0, 0})), (Color{0, 140, 50}));
  EXPECT_EQ(color_at(image, camera.pixel_of({-0.5, 0.5, 0})), (Color{205, 20, 20}));
  EXPECT_EQ(color_at(image, camera.pixel_of({0.5, -0.5, 0})), (Color{40, 44, 52}));
  // Two labels' boxes are white paper.
  EXPECT_GT(count(image, {255, 255, 255}), 300U);
}

TEST_F(SceneViewTest, LabelsThatHaveNoRoomAreLeftOut) {
  Scene scene;
  scene.layers.push_back(
      colored_points({{-1, -1, 9}, {1, 1, 9}, {0, 0, 9}}, {blue, blue, blue}, 1.2));
  for (int i = 0; i < 6000; ++i)
    scene.markers.push_back({{uniform(-1, 1), uniform(-1, 1), 0}, "P", Verdict::pass});
  const ColorImage labeled = render_scene(scene, bare(200, 200));
  for (Marker& marker : scene.markers) marker.label.clear();
  EXPECT_TRUE(labeled.pixels == render_scene(scene, bare(200, 200)).pixels);
  scene.markers.resize(20);
  const ColorImage few = render_scene(scene, bare(200, 200));
  for (Marker& marker : scene.markers) marker.label = "P";
  EXPECT_FALSE(few.pixels == render_scene(scene, bare(200, 200)).pixels);
}

TEST_F(SceneViewTest, EqualInputGivesEqualBytes) {
  Scene scene;
  PointCloud cloud;
  for (int i = 0; i < 5000; ++i)
    cloud.positions.emplace_back(uniform(0, 1), uniform(0, 1), uniform(0, 0.3));
  scene.layers.push_back({.shape = cloud});
  scene.markers = {{{0.5, 0.5, 0.3}, "center", Verdict::none}};
  SceneViewOptions options;
  options.width = 400;
  options.height = 300;
  options.title = "duplicate";
  options.view = Viewpoint::oblique;
  const std::string first = to_png(render_scene(scene, options));
  EXPECT_EQ(to_png(render_scene(scene, options)), first);
  EXPECT_EQ(first.substr(1, 3), "PNG");
}

TEST_F(SceneViewTest, AnySizeGivesAImageWithTheScene) {
  Scene scene;
  PointCloud cloud;
  cloud.positions = {{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}};
  cloud.add_field("score", ScalarType::float32).values = {1.0, 1.0, 1.0, 1.0};
  SceneLayer layer;
  layer.shape = cloud;
  layer.point_size_m = 0.4;
  scene.layers.push_back(layer);
  for (const auto& [width, height] : std::vector<std::pair<int, int>>{
           {1, 1}, {64, 64}, {64, 2000}, {2000, 64}, {333, 222}, {4000, 3000}}) {
    SceneViewOptions options;
    options.width = width;
    options.height = height;
    options.title = "A title that is much too long for a picture of this width, whatever it is";
    const ColorImage image = render_scene(scene, options);
    EXPECT_EQ(image.pixels.size(), static_cast<unsigned>(width) * static_cast<unsigned>(height));
    if (width > 1) {
      EXPECT_EQ(color_at(image, camera_of(scene, options).pixel_of({1, 1, 0})), score_color(1.0))
          << width << " x " << height;
    }
  }
}

TEST_F(SceneViewTest, DegenerateScenesAreDrawnOrRefused) {
  Scene lone;
  lone.layers.push_back(colored_points({{3e6, 5e6, 100}}, {red}, 0.0));
  for (const Viewpoint view :
       {Viewpoint::top, Viewpoint::oblique, Viewpoint::front, Viewpoint::side})
    EXPECT_EQ(render_scene(lone, bare(100, 100, view)).at(50, 50), red);
  Scene empty;
  EXPECT_TRUE(is_error(error_of([&] { render_scene(empty, {}); }), {.field = "points to draw"}));
  empty.layers.emplace_back();
  EXPECT_TRUE(is_error(error_of([&] { render_scene(empty, {}); }), {.field = "points to draw"}));
  Scene no_numbers;
  no_numbers.layers.push_back(
      colored_points({{0, std::numeric_limits<double>::quiet_NaN(), 0}}, {red}, 0.0));
  EXPECT_TRUE(
      is_error(error_of([&] { render_scene(no_numbers, {}); }), {.field = "points to draw"}));
  Scene torn = lone;
  std::get<PointCloud>(torn.layers[0].shape).colors.push_back(red);
  EXPECT_TRUE(is_error(error_of([&] { render_scene(torn, {}); }),
                       {.field = "colors", .value = "2 values long"}));
}

TEST_F(SceneViewTest, RefusesSizesAndColorsThatCannotBe) {
  Scene scene;
  scene.layers.push_back(colored_points({{0, 0, 0}}, {red}, 0.0));
  for (const int size : {0, -5, 16385}) {
    SceneViewOptions options;
    options.width = size;
    EXPECT_EQ(error_of([&] { render_scene(scene, options); }).context().field, "width") << size;
    options = {};
    options.height = size;
    EXPECT_EQ(error_of([&] { render_scene(scene, options); }).context().field, "height") << size;
  }
  SceneViewOptions options;
  options.background = "blak";
  EXPECT_TRUE(is_error(error_of([&] { render_scene(scene, options); }),
                       {.field = "background", .value = "blak", .about = "'black'"}));
  options = {};
  options.extent = Bounds3d{{0, 1, 0}, {1, 0, 1}};
  EXPECT_TRUE(is_error(error_of([&] { render_scene(scene, options); }), {.field = "extent"}));
}

TEST(ImageFile, IsWrittenWholeAndRefusedTorn) {
  ColorImage image(2, 1);
  image.pixels = {{255, 0, 0}, {0, 0, 255}};
  EXPECT_EQ(image.at(1, 0), blue);
  EXPECT_TRUE(is_error(error_of([] {
                         libmap::ColorImage broken(2, 2);
                         broken.pixels.pop_back();
                         to_png(broken);
                       }),
                       {.field = "pixels", .value = "3", .bound = "4"}));
  EXPECT_TRUE(is_error(error_of([] { to_png({}); }), {.field = "pixels"}));
  // libpng would abort the program.
  const Error wide = error_of([] { to_png(ColorImage(1'000'001, 1)); });
  EXPECT_EQ(wide.context().value, "1000001 x 1");
  EXPECT_EQ(wide.context().bound, "<= 1000000 pixels per side");
}

}  // namespace scene_view_test
}  // namespace libmap
