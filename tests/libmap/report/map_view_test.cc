#include "libmap/report/map_view.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "libmap/core/score_color.h"
#include "libmap/report/html.h"
#include "tests/support/test_support.h"

namespace map_view_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using libmap::MapView;
using libmap::PointCloud;

struct TestVoxel {
  int i, j, k;
  double score;
};

PointCloud map_of(const std::vector<TestVoxel>& voxels, double size_m,
                  const Eigen::Vector3d& origin) {
  PointCloud map;
  for (const TestVoxel& voxel : voxels)
    map.positions.emplace_back(
        origin + size_m * Eigen::Vector3d(voxel.i + 0.5, voxel.j + 0.5, voxel.k + 0.5));
  for (const char* name : {"i", "j", "k", "score", "convex", "graspable"})
    map.add_field(name, libmap::ScalarType::float32);
  for (std::size_t n = 0; n < voxels.size(); ++n) {
    map.find_field("i")->values[n] = voxels[n].i;
    map.find_field("j")->values[n] = voxels[n].j;
    map.find_field("k")->values[n] = voxels[n].k;
    map.find_field("score")->values[n] = voxels[n].score;
    map.find_field("convex")->values[n] = n % 2 == 0 ? 1.0 : 0.0;
  }
  return map;
}

const std::vector<TestVoxel> voxels = {{-4, 2, 0, 0.95}, {3, 2, 1, 0.65}, {3, 9, -7, 0.1}};

TEST(MapView, CellsLieOnTheLattice) {
  const Eigen::Vector3d origin(0.25, -0.5, 0.125);
  const PointCloud map = map_of(voxels, 0.01, origin);
  EXPECT_NEAR(libmap::lattice_of(map).voxel_size_m, 0.01, 1e-12);
  EXPECT_TRUE(libmap::lattice_of(map).origin_in_terrain.isApprox(origin, 1e-9));
  const MapView view = libmap::make_map_view(map, {});
  ASSERT_EQ(view.cells.size(), 3U);
  // The center of each cell is its point.
  for (std::size_t n = 0; n < 3; ++n) {
    Eigen::Vector3d place;
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      place[axis] = view.cells[n].index[static_cast<std::size_t>(axis)] + 0.5;
    EXPECT_TRUE(
        (view.corner_in_terrain + view.cell_size_m * place).isApprox(map.positions[n], 1e-9));
  }
}

TEST(MapView, CubesOfVoxels) {
  const MapView view =
      libmap::make_map_view(map_of(voxels, 0.01, {0, 0, 0}), {.voxels_per_cell = 3});
  EXPECT_NEAR(view.cell_size_m, 0.03, 1e-12);
  // i: floor(-4 / 3) = -2 is the lowest; 3 / 3 = 1.
  EXPECT_EQ(view.cells[0].index[0], 0);
  EXPECT_EQ(view.cells[1].index[0], 3);
  EXPECT_NEAR(view.corner_in_terrain.x(), -0.06, 1e-9);
  EXPECT_EQ(view.cells[2].index[1], 3);
}

TEST(MapView, ColorsAreTheClassesOfTheLegend) {
  std::vector<TestVoxel> all;
  for (int n = 0; n <= 20; ++n) all.push_back({n, 0, 0, n * 0.05});
  all.push_back({21, 0, 0, std::numeric_limits<double>::quiet_NaN()});
  const PointCloud map = map_of(all, 0.01, {0, 0, 0});
  const MapView view = libmap::make_map_view(map, {});
  for (std::size_t n = 0; n < all.size(); ++n) {
    const unsigned place = view.cells[n].colors_and_flags & 15U;
    const libmap::Color color = place < libmap::score_classes.size()
                                    ? libmap::score_classes[place].color
                                    : libmap::no_value_color;
    EXPECT_EQ(color, libmap::score_color(all[n].score)) << all[n].score;
    EXPECT_EQ((view.cells[n].colors_and_flags & libmap::convex_flag) != 0, n % 2 == 0);
  }
  const MapView above = libmap::make_map_view(map, {.zero_plane_m = 1.0});
  EXPECT_EQ(above.cells[3].colors_and_flags & 15U, libmap::below_plane_class);
}

TEST(MapView, ForcesOfItsLoad) {
  PointCloud map = map_of(voxels, 0.01, {0, 0, 0});
  map.add_field("hold_probability", libmap::ScalarType::float32).values = {0.0, 0.4, 1.0};
  map.add_field("holding_force_n", libmap::ScalarType::float32).values = {0.0, 9.0, 1e4};
  map.add_field("holding_force_low_n", libmap::ScalarType::float32).values = {0.0, 0.01, 40.0};
  EXPECT_TRUE(libmap::make_map_view(map, {.load_n = 12.5}).forces.empty());
  map.add_field("holding_force_high_n", libmap::ScalarType::float32).values = {0.0, 20.0, 1e4};
  EXPECT_TRUE(libmap::make_map_view(map, {}).forces.empty());
  const MapView view = libmap::make_map_view(map, {.load_n = 12.5});
  ASSERT_EQ(view.forces.size(), 3U);
  EXPECT_EQ(view.load_n, 12.5);
  EXPECT_EQ(view.forces[0].median, 0);
  EXPECT_NEAR(std::exp(0.04 * (view.forces[1].median - 1) - 3.0), 9.0, 0.2);
  EXPECT_NEAR(std::exp(0.04 * (view.forces[1].high - 1) - 3.0), 20.0, 0.4);
  EXPECT_EQ(view.forces[1].low, 1);
  EXPECT_EQ(view.forces[2].median, 255);
  EXPECT_EQ(view.forces[1].probability, 102);
  // The class of hold_probability, not of score.
  EXPECT_EQ(view.cells[2].colors_and_flags & 15U, 0U);
  libmap::ReportMap shown;
  shown.view = view;
  const std::string html = libmap::map_html(shown, "", true);
  EXPECT_NE(html.find("Probability to hold <output>12.5 N</output>"), std::string::npos);
  EXPECT_NE(html.find("\"load_n\":12.5"), std::string::npos);
}

TEST(MapView, WhatIsNoMapIsSaid) {
  PointCloud map = map_of(voxels, 0.01, {0, 0, 0});
  map.positions[1].x() += 0.006;
  EXPECT_TRUE(is_error(error_of([&] { libmap::make_map_view(map, {}); }),
                       {.field = "distance from the lattice", .value = "0.005999999999999998 m"}));
  const PointCloud wide = map_of({{0, 0, 0, 1.0}, {70'000, 0, 0, 1.0}}, 0.01, {0, 0, 0});
  EXPECT_EQ(error_of([&] { libmap::make_map_view(wide, {}); }).context().bound, "<= 65535");
  PointCloud cloud;
  cloud.positions.emplace_back(0, 0, 0);
  EXPECT_EQ(error_of([&] { libmap::make_map_view(cloud, {}); }).context().field, "i");
  EXPECT_TRUE(libmap::make_map_view(PointCloud{}, {}).cells.empty());
}

TEST(MapView, LabelsCannotEndTheScript) {
  libmap::ReportMap map;
  map.view = libmap::make_map_view(map_of(voxels, 0.01, {0, 0, 0}), {});
  map.view.markers.push_back({"</script><script>alert(1)</script>", {0.1, 0.2, 0.3}, true});
  const std::string html = libmap::map_html(map, "", true);
  const std::size_t begin = html.find("class=\"map-data\">") + 17;
  const std::size_t end = html.find("</script>", begin);
  const auto json = nlohmann::json::parse(html.substr(begin, end - begin));
  EXPECT_EQ(json["markers"][0]["label"], "</script><script>alert(1)</script>");
  EXPECT_NEAR(json["markers"][0]["at"][0].get<double>(), 0.14, 1e-9);
  EXPECT_EQ(json["cells"].get<std::string>().size(), 28U);  // 21 bytes
  EXPECT_EQ(html.find("<script>"), std::string::npos);
}

}  // namespace map_view_test
