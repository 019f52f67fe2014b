#include "libmap/view/color_map.h"
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/support/test_support.h"

namespace libmap {
namespace color_map_test {

using graspmap_test::error_of;
using graspmap_test::is_error;

constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();

PointCloud row_of_points(std::size_t count) {
  PointCloud cloud;
  for (std::size_t i = 0; i < count; ++i)
    cloud.positions.emplace_back(double(i), 0.0, 0.01 * double(i));
  return cloud;
}

ColoredPoints color(const PointCloud& cloud, const Coloring& coloring) {
  return color_points({cloud.positions, cloud.colors, cloud.fields}, coloring);
}

TEST(ScoreColor, ClassesBeginAtTheirBounds) {
  const Legend legend = score_legend();
  ASSERT_EQ(legend.entries.size(), 7U);
  const double bounds[] = {0.9, 0.8, 0.7, 0.6, 0.5, 0.4};
  for (std::size_t k = 0; k < 6; ++k) {
    EXPECT_EQ(score_color(bounds[k]), legend.entries[k].color) << bounds[k];
    EXPECT_EQ(score_color(static_cast<double>(static_cast<float>(bounds[k]))),
              legend.entries[k].color)
        << "single precision " << bounds[k];
    EXPECT_EQ(score_color(bounds[k] - 1e-4), legend.entries[k + 1].color) << bounds[k];
  }
  EXPECT_EQ(score_color(1.0), legend.entries[0].color);
  EXPECT_EQ(score_color(-0.7), legend.entries[6].color);
  EXPECT_EQ(score_color(nan_value), no_value_color);
}

TEST(ScoreColor, NoTwoClassesLookTheSame) {
  const Legend legend = score_legend();
  for (std::size_t a = 0; a < legend.entries.size(); ++a)
    for (std::size_t b = 0; b < a; ++b) {
      int distance = 0;
      for (std::size_t c = 0; c < 3; ++c)
        distance += std::abs(int(legend.entries[a].color[c]) - int(legend.entries[b].color[c]));
      EXPECT_GT(distance, 60) << legend.entries[a].text << " and " << legend.entries[b].text;
    }
}

TEST(Diverging, IsGrayInTheMiddleAndSymmetricInItsRange) {
  EXPECT_EQ(diverging(0.0), (Color{59, 76, 192}));
  EXPECT_EQ(diverging(0.5), (Color{221, 221, 221}));
  EXPECT_EQ(diverging(1.0), (Color{180, 4, 38}));
  EXPECT_EQ(diverging(-3.0), diverging(0.0));
  EXPECT_EQ(diverging(nan_value), no_value_color);
  // Blue becomes less and red more, all the way up to the middle of each side.
  for (double t = 0.02; t < 0.48; t += 0.02) {
    EXPECT_GT(diverging(t)[2], diverging(t)[0]);
    EXPECT_LT(diverging(1 - t)[2], diverging(1 - t)[0]);
  }
  // Errors of -1..3 and two that stray: the ends are at 98 of 100 of their sizes, 0 in the middle.
  PointCloud cloud = row_of_points(1000);
  ScalarField& error = cloud.add_field("error", ScalarType::float64);
  for (std::size_t n = 0; n < 1000; ++n) error.values[n] = -1.0 + 4.0 * double(n) / 999;
  error.values[0] = -500;
  error.values[999] = 700;
  Coloring coloring{.mode = ColorMode::field, .field = "error", .scale = ColorScale::diverging};
  ColoredPoints colored = color(cloud, coloring);
  EXPECT_NEAR(colored.legend.max, 2.92, 0.02);
  EXPECT_EQ(colored.legend.min, -colored.legend.max);
  EXPECT_EQ(colored.legend.scale, ColorScale::diverging);
  EXPECT_EQ(colored.colors[0], diverging(0.0));
  EXPECT_NEAR(colored.colors[250][0], 221, 2);
  coloring.range_min = -10;
  coloring.range_max = 10;
  EXPECT_EQ(color(cloud, coloring).legend.min, -10);
  for (double& value : error.values) value = 0.0;
  coloring.range_min = coloring.range_max = 0.0;
  EXPECT_EQ(color(cloud, coloring).colors[3], diverging(0.5));
}

TEST(Viridis, ShowsTheFewValuesThatDiffer) {
  PointCloud cloud = row_of_points(1000);
  ScalarField& filled = cloud.add_field("filled", ScalarType::uint8);
  filled.values[7] = 1.0;
  for (const ColorScale scale : {ColorScale::viridis, ColorScale::diverging}) {
    const ColoredPoints colored =
        color(cloud, {.mode = ColorMode::field, .field = "filled", .scale = scale});
    EXPECT_TRUE(colored.legend.continuous);
    EXPECT_EQ(colored.legend.max, 1.0);
    EXPECT_NE(colored.colors[7], colored.colors[8]);
  }
}

TEST(Viridis, EndsAreThePublishedOnesAndLightnessGrows) {
  EXPECT_EQ(viridis(0.0), (Color{68, 1, 84}));
  EXPECT_EQ(viridis(1.0), (Color{253, 231, 37}));
  // Entry 128 of matplotlib's 256.
  EXPECT_EQ(viridis(128.0 / 255.0), (Color{33, 145, 140}));
  EXPECT_EQ(viridis(-3.0), viridis(0.0));
  EXPECT_EQ(viridis(7.0), viridis(1.0));
  EXPECT_EQ(viridis(nan_value), no_value_color);
  double former = -1.0;
  for (int k = 0; k <= 50; ++k) {
    const Color c = viridis(k / 50.0);
    const double luminance = 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
    EXPECT_GT(luminance, former) << k;
    former = luminance;
  }
}

TEST(ColorPoints, BelowThePlaneIsWhiteAndOnItIsNot) {
  PointCloud cloud = row_of_points(4);  // z = 0, 0.01, 0.02, 0.03
  cloud.add_field("score", ScalarType::float32).values = {0.95, 0.95, 0.95, nan_value};
  Coloring coloring;
  coloring.zero_plane_m = 0.01;
  const ColoredPoints result = color(cloud, coloring);
  EXPECT_EQ(result.mode, ColorMode::score);
  EXPECT_EQ(result.colors[0], below_plane_color);
  EXPECT_EQ(result.colors[1], score_color(0.95));
  EXPECT_EQ(result.colors[3], no_value_color);
  ASSERT_EQ(result.legend.entries.size(), 9U);
  EXPECT_EQ(result.legend.entries[7].text, "no value");
  EXPECT_EQ(result.legend.entries[8].text, "below zero plane");
}

TEST(ColorPoints, ProbabilitiesTellTheirLoadAndForcesTheirUnit) {
  PointCloud cloud = row_of_points(3);
  cloud.add_field("score", ScalarType::float32).values = {0.1, 0.1, 0.1};
  cloud.add_field("hold_probability", ScalarType::float32).values = {0.95, 0.5, 0.1};
  cloud.add_field("holding_force_n", ScalarType::float32).values = {30.0, 10.0, 0.0};
  const ColoredPoints held = color(cloud, {.load_n = 12.5});
  EXPECT_EQ(held.mode, ColorMode::score);
  EXPECT_EQ(held.legend.title, "probability to hold 12.5 N");
  EXPECT_EQ(held.colors[0], score_color(0.95));
  EXPECT_EQ(color(cloud, {.mode = ColorMode::score}).colors[0], score_color(0.1));
  const ColoredPoints forces = color(cloud, {.field = "holding_force_n"});
  EXPECT_EQ(forces.mode, ColorMode::field);
  EXPECT_TRUE(forces.legend.continuous);
  EXPECT_EQ(forces.legend.title, "holding force [N]");
  EXPECT_EQ(forces.legend.max, 30.0);
}

TEST(ColorPoints, FlagsGraspableBeforeConvex) {
  PointCloud cloud = row_of_points(4);
  cloud.add_field("convex", ScalarType::uint8).values = {1, 1, 0, 0};
  cloud.add_field("graspable", ScalarType::uint8).values = {0, 1, 1, 0};
  Coloring coloring;
  coloring.mode = ColorMode::flags;
  EXPECT_EQ(color(cloud, coloring).colors,
            (std::vector<Color>{convex_color, graspable_color, graspable_color, rest_color}));
}

TEST(ColorPoints, FlagsTellObstaclesFromTheRest) {
  PointCloud cloud = row_of_points(4);
  cloud.add_field("graspable", ScalarType::uint8).values = {1, 0, 0, 0};
  cloud.add_field("obstacle", ScalarType::uint8).values = {1, 1, 2, 0};
  Coloring coloring;
  coloring.mode = ColorMode::flags;
  const auto result = color(cloud, coloring);
  EXPECT_EQ(result.colors,
            (std::vector<Color>{graspable_color, obstacle_color, unreachable_color, rest_color}));
  EXPECT_EQ(result.legend.entries.size(), 4U);
}

TEST(ColorPoints, RangeGivenOrFromThePercentiles) {
  PointCloud cloud = row_of_points(101);
  cloud.add_field("curvature", ScalarType::float64);
  for (std::size_t i = 0; i <= 100; ++i) cloud.fields[0].values[i] = double(i);
  cloud.fields[0].values[100] = 1e9;  // an outlier must not use up the colors
  Coloring coloring;
  coloring.mode = ColorMode::field;
  coloring.field = "curvature";
  const ColoredPoints free_range = color(cloud, coloring);
  EXPECT_TRUE(free_range.legend.continuous);
  EXPECT_DOUBLE_EQ(free_range.legend.min, 2.0);
  EXPECT_DOUBLE_EQ(free_range.legend.max, 98.0);
  EXPECT_EQ(free_range.colors[0], viridis(0.0));
  EXPECT_EQ(free_range.colors[50], viridis(0.5));
  coloring.range_min = -10.0;
  coloring.range_max = 90.0;
  const ColoredPoints fixed = color(cloud, coloring);
  EXPECT_EQ(fixed.colors[40], viridis(0.5));
  EXPECT_EQ(fixed.colors[100], viridis(1.0));
}

TEST(ColorPoints, ConstantAndMissingValues) {
  PointCloud cloud = row_of_points(3);
  cloud.add_field("f", ScalarType::float64).values = {2.5, 2.5, nan_value};
  Coloring coloring;
  coloring.mode = ColorMode::field;
  coloring.field = "f";
  const ColoredPoints result = color(cloud, coloring);
  EXPECT_FALSE(result.legend.continuous);
  EXPECT_EQ(result.legend.entries.front().text, "2.5");
  EXPECT_EQ(result.colors, (std::vector<Color>{viridis(0.5), viridis(0.5), no_value_color}));
}

TEST(ColorPoints, AutomaticTakesWhatTheDataHave) {
  PointCloud cloud = row_of_points(3);
  EXPECT_EQ(color(cloud, {}).mode, ColorMode::height);
  cloud.colors.assign(3, Color{9, 9, 9});
  EXPECT_EQ(color(cloud, {}).mode, ColorMode::height) << "one gray says nothing";
  cloud.colors[1] = {1, 2, 3};
  EXPECT_EQ(color(cloud, {}).mode, ColorMode::own);
  EXPECT_EQ(color(cloud, {}).colors, cloud.colors);
  cloud.add_field("score", ScalarType::float32);
  EXPECT_EQ(color(cloud, {}).mode, ColorMode::score);
}

TEST(ColorPoints, ErrorsNameWhatWasMeant) {
  PointCloud cloud = row_of_points(3);
  cloud.add_field("curvature", ScalarType::float64);
  Coloring coloring;
  coloring.mode = ColorMode::field;
  coloring.field = "curvatur";
  EXPECT_TRUE(
      is_error(error_of([&] { color(cloud, coloring); }), {.field = "field",
                                                           .value = "curvatur",
                                                           .bound = "one of curvature x y z",
                                                           .about = "'curvature'"}));
  coloring.field = "curvature";
  coloring.range_min = 1.0;
  EXPECT_EQ(error_of([&] { color(cloud, coloring); }).context().field, "range_max");
  coloring.mode = ColorMode::own;
  EXPECT_TRUE(
      is_error(error_of([&] { color(cloud, coloring); }), {.field = "color mode", .value = "own"}));
  coloring.mode = ColorMode::flags;
  EXPECT_EQ(error_of([&] { color(cloud, coloring); }).context().value, "convex");
  coloring = {.mode = ColorMode::field, .field = "curvature"};
  cloud.fields[0].values.pop_back();
  EXPECT_TRUE(is_error(error_of([&] { color(cloud, coloring); }),
                       {.field = "curvature", .value = "2 values", .bound = "3"}));
  coloring.mode = ColorMode::single;
  coloring.color = "gren";
  EXPECT_TRUE(
      is_error(error_of([&] { color(cloud, coloring); }), {.field = "color", .value = "gren"}));
}

TEST(ParseColor, HexAndNames) {
  EXPECT_EQ(parse_color("#0aFf10", "c"), (Color{10, 255, 16}));
  EXPECT_EQ(parse_color("white", "c"), (Color{255, 255, 255}));
  for (const char* wrong : {"", "#12345", "#1234567", "#12345g", "#-12345", "# 12345"})
    EXPECT_EQ(error_of([&] { parse_color(wrong, "c"); }).context().field, "c") << wrong;
}

}  // namespace color_map_test
}  // namespace libmap
