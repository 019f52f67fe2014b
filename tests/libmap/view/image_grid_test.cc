#include "libmap/view/image_grid.h"
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "libmap/view/offscreen.h"
#include "libmap/view/scene_page.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace image_grid_test {

using graspmap_test::error_of;
using graspmap_test::is_error;

constexpr Color background{95, 107, 122};
constexpr Color red{255, 0, 0};
constexpr Color blue{0, 0, 255};

Scene square_at(const Eigen::Vector3d& position, const Color& color, double size_m) {
  SceneLayer layer;
  PointCloud cloud;
  cloud.positions = {position};
  cloud.colors = {color};
  layer.shape = cloud;
  layer.coloring.mode = ColorMode::own;
  layer.point_shape = PointShape::square;
  layer.point_size_m = size_m;
  Scene scene;
  scene.layers.push_back(layer);
  return scene;
}

SheetCell cell_of(const std::string& caption, const Scene& scene) {
  SheetCell cell;
  cell.caption = caption;
  cell.scene = [scene] { return scene; };
  return cell;
}

SheetCell cell_of(const std::string& caption, const ColorImage& image) {
  SheetCell cell;
  cell.caption = caption;
  cell.image = image;
  return cell;
}

Color at(const ColorImage& image, double x, double y) {
  return image.at(static_cast<int>(x), static_cast<int>(y));
}

class ImageGridTest : public ::testing::Test {
 protected:
  void SetUp() override { display_ = std::make_unique<VirtualDisplay>(); }

 private:
  std::unique_ptr<VirtualDisplay> display_;
};

TEST(PlanSheet, PartsNeverOverlap) {
  for (const int cells : {1, 2, 3, 5, 12}) {
    for (const int columns : {0, 1, 3, 4}) {
      for (const SharedView shared : {SharedView::sheet, SharedView::row}) {
        ImageGridOptions options;
        options.columns = columns;
        options.title = "All of them";
        options.column_titles = {"first column"};
        options.row_titles = {"first row"};
        options.shared_view = shared;
        const std::vector<SheetCell> list(static_cast<std::size_t>(cells),
                                          cell_of("caption", square_at({0, 0, 0}, red, 1.0)));
        const SheetLayout layout = plan_sheet(list, options, {score_legend()}, 0.8);
        std::vector<PixelRect> parts{*layout.title, *layout.legend};
        for (const auto& group : {layout.cells, layout.captions, layout.column_titles,
                                  layout.row_titles, layout.scale_bars})
          parts.insert(parts.end(), group.begin(), group.end());
        EXPECT_EQ(layout.cells.size(), list.size());
        for (std::size_t a = 0; a < parts.size(); ++a) {
          EXPECT_GE(parts[a].left, 0.0);
          EXPECT_LE(parts[a].right(), layout.width);
          EXPECT_LE(parts[a].bottom(), layout.height);
          for (std::size_t b = 0; b < a; ++b)
            EXPECT_FALSE(parts[a].overlaps(parts[b])) << cells << " " << columns << " " << a << b;
        }
      }
    }
  }
}

TEST_F(ImageGridTest, ImagesStandInTheirCellsUnchanged) {
  ColorImage first(100, 80);
  ColorImage second(100, 80);
  for (int y = 0; y < 80; ++y) {
    for (int x = 0; x < 100; ++x) {
      first.at(x, y) = {std::uint8_t(x), std::uint8_t(y), 7};
      second.at(x, y) = {std::uint8_t(2 * x), 9, std::uint8_t(y)};
    }
  }
  ImageGridOptions options;
  options.columns = 2;
  options.cell_width_px = 100;
  options.cell_height_px = 80;
  const std::vector<SheetCell> cells = {cell_of("a", first), cell_of("b", second),
                                        cell_of("c", first)};
  const ColorImage sheet = draw_sheet(cells, options);
  const SheetLayout layout = plan_sheet(cells, options, {}, 0.8);
  ASSERT_EQ(sheet.width, layout.width);
  ASSERT_EQ(sheet.height, layout.height);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const PixelRect& cell = layout.cells[i];
    const ColorImage& image = cells[i].image;
    for (int y = 0; y < 80; ++y)
      for (int x = 0; x < 100; ++x)
        ASSERT_EQ(at(sheet, cell.left + x, cell.top + y), image.at(x, y)) << i << " " << x;
  }
  EXPECT_EQ(at(sheet, layout.cells[0].right() + 1, layout.cells[0].top + 5),
            (Color{255, 255, 255}));
}

TEST_F(ImageGridTest, LargeImagesAreMadeSmallerSmallOnesKept) {
  ColorImage wide(400, 100, red);
  for (int y = 0; y < 100; ++y)
    for (int x = 200; x < 400; ++x) wide.at(x, y) = blue;
  const ColorImage small(10, 10, red);
  ImageGridOptions options;
  options.columns = 2;
  options.cell_width_px = options.cell_height_px = 100;
  const std::vector<SheetCell> cells = {cell_of("", wide), cell_of("", small)};
  const ColorImage sheet = draw_sheet(cells, options);
  const SheetLayout layout = plan_sheet(cells, options, {}, 1.0);
  // 100 x 25 pixels in the middle of its cell.
  const PixelRect& cell = layout.cells[0];
  EXPECT_EQ(at(sheet, cell.left + 20, cell.top + 50), red);
  EXPECT_EQ(at(sheet, cell.left + 80, cell.top + 50), blue);
  EXPECT_EQ(at(sheet, cell.left + 20, cell.top + 36), (Color{255, 255, 255}));
  EXPECT_EQ(at(sheet, cell.left + 20, cell.top + 63), (Color{255, 255, 255}));
  const PixelRect& other = layout.cells[1];
  std::size_t count = 0;
  for (int y = 0; y < 100; ++y)
    for (int x = 0; x < 100; ++x) count += at(sheet, other.left + x, other.top + y) == red ? 1 : 0;
  EXPECT_EQ(count, 100U);
}

// One square is 2 m wide, the other 1 m and 3 m beside it: in a shared view the second is half as
// wide and lies where it does in the first's.
TEST_F(ImageGridTest, ScenesShareScaleAndPlace) {
  const std::vector<SheetCell> cells = {cell_of("", square_at({0, 0, 0}, red, 2.0)),
                                        cell_of("", square_at({3.5, 0, 0}, blue, 1.0))};
  ImageGridOptions options;
  options.columns = 2;
  options.cell_width_px = 200;
  options.cell_height_px = 100;
  const SheetLayout layout = plan_sheet(cells, options, {}, 1.0);
  const ColorImage sheet = draw_sheet(cells, options);
  const auto bounds = [&](std::size_t cell, const Color& color) {
    std::pair<int, int> range{1000, -1};
    for (int x = 0; x < 200; ++x)
      if (at(sheet, layout.cells[cell].left + x, layout.cells[cell].top + 50) == color)
        range = {std::min(range.first, x), std::max(range.second, x)};
    return range;
  };
  // -1 m to 4 m over 0.9 of 200 pixels: 36 pixels a meter.
  const auto [red_low, red_high] = bounds(0, red);
  const auto [blue_low, blue_high] = bounds(1, blue);
  EXPECT_NEAR(red_low, 10, 1);
  EXPECT_NEAR(red_high, 82, 1);
  EXPECT_NEAR(blue_low, 10 + 4 * 36, 1);
  EXPECT_NEAR(blue_high, 10 + 5 * 36, 1);
  EXPECT_EQ(at(sheet, layout.cells[1].left + 20, layout.cells[1].top + 50), background);

  options.columns = 1;
  options.shared_view = SharedView::row;
  const ColorImage alone = draw_sheet(cells, options);
  const SheetLayout rows = plan_sheet(cells, options, {}, 1.0);
  EXPECT_EQ(rows.scale_bars.size(), 2U);
  EXPECT_EQ(at(alone, rows.cells[1].left + 100, rows.cells[1].top + 50), blue);
}

// Two scenes with different values share one color range.
TEST_F(ImageGridTest, ContinuousColorsShareTheirRange) {
  const auto scene = [](double low, double high) {
    PointCloud cloud;
    cloud.positions = {{0, 0, 0}, {1, 0, 0}};
    cloud.add_field("value", ScalarType::float64).values = {low, high};
    SceneLayer layer;
    layer.shape = cloud;
    layer.coloring.mode = ColorMode::field;
    layer.coloring.field = "value";
    layer.point_size_m = 1.0;
    layer.point_shape = PointShape::square;
    Scene made;
    made.layers.push_back(layer);
    return made;
  };
  const std::vector<SheetCell> cells = {cell_of("", scene(0, 1)), cell_of("", scene(1, 4))};
  ImageGridOptions options;
  options.columns = 2;
  options.cell_width_px = 200;
  options.cell_height_px = 100;
  const ColorImage sheet = draw_sheet(cells, options);
  const SheetLayout layout = plan_sheet(cells, options, {}, 1.0);
  const auto color = [&](std::size_t cell, double fraction) {
    return at(sheet, layout.cells[cell].left + fraction * 200, layout.cells[cell].top + 50);
  };
  EXPECT_EQ(color(0, 0.25), viridis(0.0));
  EXPECT_EQ(color(0, 0.75), viridis(0.25));
  EXPECT_EQ(color(1, 0.25), viridis(0.25));
  EXPECT_EQ(color(1, 0.75), viridis(1.0));
}

TEST_F(ImageGridTest, ADimensionLineIsDrawnAtItsEnds) {
  Scene scene = square_at({0, 0, 0}, red, 1.0);
  scene.dimension_lines.push_back({{-0.5, -1, 0}, {0.5, -1, 0}, "1 m"});
  SceneViewOptions view;
  view.width = view.height = 400;
  view.axes = view.scale_bar = view.legend = false;
  const SceneCamera camera = camera_of(scene, view);
  const ColorImage image = render_scene(scene, view);
  const Eigen::Vector2d left = camera.pixel_of({-0.5, -1, 0});
  // The line is a pixel or two wide, wherever its edges fall.
  const auto dark = [&](double x, double y) {
    return std::min({at(image, x, y - 1)[0], at(image, x, y)[0], at(image, x, y + 1)[0]}) < 65;
  };
  EXPECT_TRUE(dark(left.x() + 0.3 * camera.scale_px, left.y()));
  EXPECT_FALSE(dark(left.x() - 3, left.y()));
  EXPECT_FALSE(dark(left.x() + 1.0 * camera.scale_px + 3, left.y()));
}

TEST(ImageGrid, WhatCannotBeDrawnIsAnError) {
  const std::vector<SheetCell> one = {cell_of("", ColorImage(10, 10, red))};
  EXPECT_TRUE(is_error(error_of([] { draw_sheet({}, {}); }), {.field = "images of the sheet"}));
  ImageGridOptions options;
  options.cell_width_px = 3;
  EXPECT_TRUE(is_error(error_of([&] { draw_sheet(one, options); }),
                       {.field = "cell_width_px", .value = "3", .bound = ">= 16 and <= 16384"}));
  options.cell_width_px = 16384;
  EXPECT_TRUE(is_error(error_of([&] { draw_sheet(one, options); }),
                       {.field = "cell_width_px", .value = "16384"}));
  options.cell_width_px = 100;
  options.column_titles = {"a", "b"};
  EXPECT_TRUE(is_error(error_of([&] { draw_sheet(one, options); }),
                       {.field = "column_titles", .value = "2", .bound = "<= 1"}));
}

}  // namespace image_grid_test
}  // namespace libmap
