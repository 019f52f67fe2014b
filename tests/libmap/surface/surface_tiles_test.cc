// A surface made in tiles equals the whole surface.
#include "libmap/surface/surface_tiles.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <vector>

#include "libmap/core/single_precision.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/surface/mesh_report.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace surface_tiles_test {

using graspmap_test::error_of;
using graspmap_test::uniform;

constexpr double cell_m = 0.02;

double height(double x, double y) { return 0.04 * std::sin(9 * x) * std::cos(11 * y); }

void add_point(PointCloud& cloud, const Eigen::Vector3d& place, const Eigen::Vector3d& normal) {
  cloud.positions.push_back(place);
  cloud.normals.push_back(normal.normalized().cast<float>());
  const auto level = static_cast<std::uint8_t>(40 + 200 * std::abs(std::sin(5 * place.x())));
  cloud.colors.push_back({level, 90, static_cast<std::uint8_t>(255 - level)});
  cloud.fields[0].values.push_back(uniform(0.001, 0.004));
}

// Rough ground with large and small holes, small islands beside it, above it and in its holes, and
// a narrow strip across tiles.
PointCloud ground(double length_m, double width_m) {
  PointCloud cloud;
  cloud.fields = {{"expected_error", ScalarType::float32, {}}};
  std::vector<Eigen::Vector3d> holes;
  for (double x = 0.15; x < length_m; x += 0.29)
    holes.emplace_back(x, uniform(0.1, width_m - 0.1), uniform(0.03, 0.09));
  const int columns = static_cast<int>(length_m / 0.015);
  const int rows = static_cast<int>(width_m / 0.015);
  for (int i = 0; i < columns; ++i)
    for (int j = 0; j < rows; ++j) {
      const double x = (i + uniform(0, 1)) * 0.015;
      const double y = (j + uniform(0, 1)) * 0.015;
      const bool is_hole =
          std::any_of(holes.begin(), holes.end(), [&](const Eigen::Vector3d& hole) {
            const double off = (hole.head<2>() - Eigen::Vector2d(x, y)).norm();
            return off < hole.z() && off > 0.3 * hole.z();
          });
      if (is_hole) continue;
      const double z = height(x, y);
      add_point(cloud, {x, y, z + uniform(-0.002, 0.002)},
                {-0.36 * std::cos(9 * x) * std::cos(11 * y),
                 0.44 * std::sin(9 * x) * std::sin(11 * y), 1});
    }
  // Islands of 8 x 8 cm every 40 cm, and a strip of 4 cm width over the whole length.
  for (double x = 0.0; x < length_m; x += 0.012)
    for (double y = 0.0; y < 0.08; y += 0.012) {
      if (std::fmod(x, 0.4) < 0.08) add_point(cloud, {x, y, 0.3}, {0, 0, 1});
      if (y < 0.04) add_point(cloud, {x, y + 0.1, 0.5}, {0, 0, 1});
    }
  return cloud;
}

SurfaceTileOptions options_of(double tile_m) {
  SurfaceTileOptions options;
  options.tile_m = tile_m;
  options.reconstruction.cell_size_m = cell_m;
  options.cleaning.max_hole_m = 0.1;
  options.cleaning.min_island_area_m2 = 0.02;
  return options;
}

// Sorted triangles with all values of their corners, each starting at its lowest corner.
using Rows = std::vector<std::vector<double>>;
void add_rows(const TriangleMesh& mesh, Rows& rows) {
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    std::array<std::vector<double>, 3> corners;
    for (std::size_t c = 0; c < 3; ++c) {
      const std::uint32_t v = mesh.triangles[t][c];
      for (const double x : mesh.vertices[v]) corners[c].push_back(rounded_to_single(x));
      for (const float x : mesh.vertex_normals[v]) corners[c].push_back(x);
      for (const std::uint8_t x : mesh.vertex_colors[v]) corners[c].push_back(x);
      for (const ScalarField& field : mesh.vertex_fields) corners[c].push_back(field.values[v]);
    }
    std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
    std::vector<double> row;
    for (const auto& corner : corners) row.insert(row.end(), corner.begin(), corner.end());
    for (const ScalarField& field : mesh.face_fields) row.push_back(field.values[t]);
    rows.push_back(row);
  }
}

PointCloud points_in(const PointCloud& cloud, const XyBox& box) {
  std::vector<std::size_t> inside;
  for (std::size_t n = 0; n < cloud.size(); ++n)
    if (box.contains(cloud.positions[n].head<2>())) inside.push_back(n);
  return select_points(cloud, inside);
}

TEST(SurfaceTiles, SameTrianglesAsAtOnceBitForBit) {
  const PointCloud cloud = ground(4.5, 0.5);
  const SurfaceTileOptions options = options_of(0.5);
  ASSERT_LT(options.margin_m(), 1.2) << "else a tile sees nearly all";
  const MeshCleaningResult whole =
      clean_mesh(reconstruct_surface(cloud, options.reconstruction).mesh, options.cleaning);
  EXPECT_GE(whole.filling.holes, 5U);
  EXPECT_GT(whole.islands, 8U);
  Rows expected;
  add_rows(whole.mesh, expected);

  CloudStatistics statistics;
  statistics.add(points_in(cloud, {Eigen::Vector2d(2, -1), Eigen::Vector2d(9, 9)}), true);
  statistics.add(points_in(cloud, {Eigen::Vector2d(-9, -1), Eigen::Vector2d(2, 9)}), true);
  std::map<XyTile, std::size_t> tiles;
  add_surface_tiles(cloud, options, tiles);
  SurfaceIslands islands;
  std::map<XyTile, TriangleMesh> made;
  for (const auto& [tile, points] : tiles) {
    const SurfaceTile one =
        make_surface_tile(points_in(cloud, xy_box_of(tile, options.tile_m, options.margin_m())),
                          statistics, tile, options);
    islands.add(tile, one);
    made[tile] = one.mesh;
  }
  std::size_t seen = 0;
  Rows found;
  const SurfaceIslands::Dropped dropped = islands.dropped(options.cleaning);
  for (const auto& [tile, mesh] : made) {
    const auto here = dropped.find(tile);
    const TriangleMesh kept = here == dropped.end() ? mesh : without_components(mesh, here->second);
    seen += kept.triangles.empty() ? 0 : 1;
    add_rows(kept, found);
  }
  EXPECT_GE(seen, 9U);
  std::sort(expected.begin(), expected.end());
  std::sort(found.begin(), found.end());
  EXPECT_EQ(found.size(), expected.size());
  EXPECT_TRUE(found == expected);
}

TEST(SurfaceTiles, IslandsAreJudgedAcrossTiles) {
  // A strip of 0.018 m2 per tile exceeds the bound in total; a strip that ends does not.
  PointCloud cloud;
  cloud.fields = {{"expected_error", ScalarType::float32, {}}};
  const auto strip = [&](double y, double length_m) {
    for (double x = 0.25; x < 0.25 + length_m; x += 0.012)
      for (double across = 0.0; across < 0.06; across += 0.012)
        add_point(cloud, {x, y + across, 0}, {0, 0, 1});
  };
  strip(0.1, 2.4);
  strip(0.3, 0.3);
  SurfaceTileOptions options = options_of(0.4);
  options.cleaning.min_island_area_m2 = 0.03;
  CloudStatistics statistics;
  statistics.add(cloud, true);
  std::map<XyTile, std::size_t> tiles;
  add_surface_tiles(cloud, options, tiles);
  SurfaceIslands islands;
  double area = 0.0;
  for (const auto& [tile, points] : tiles) {
    const SurfaceTile one =
        make_surface_tile(points_in(cloud, xy_box_of(tile, options.tile_m, options.margin_m())),
                          statistics, tile, options);
    islands.add(tile, one);
    area += surface_area(one.mesh);
  }
  EXPECT_TRUE(islands.dropped(options.cleaning).empty());
  EXPECT_EQ(islands.islands(), 0U);
  EXPECT_GT(area, 0.1);
  options.cleaning.min_island_area_m2 = 1.0;
  std::size_t parts = 0;
  for (const auto& [tile, components] : islands.dropped(options.cleaning))
    parts += components.size();
  EXPECT_GE(parts, 6U);
  EXPECT_EQ(islands.islands(), 1U);
}

TEST(SurfaceTiles, OptionsThatNeedTheWholeSurfaceAreNamed) {
  const auto field_of = [](const auto& change) {
    SurfaceTileOptions options = options_of(0.5);
    change(options);
    return error_of([&] { options.check(); }).context().field;
  };
  EXPECT_EQ(field_of([](auto& o) { o.reconstruction.method = SurfaceMethod::poisson; }), "method");
  EXPECT_EQ(field_of([](auto& o) { o.reconstruction.cell_size_m = 0.0; }), "cell_size_m");
  EXPECT_EQ(field_of([](auto& o) { o.cleaning.decimation_error_m = 0.1; }), "decimation_error_m");
  EXPECT_EQ(field_of([](auto& o) { o.tile_m = 0.0; }), "tile_size_m");
  EXPECT_EQ(field_of([](auto& o) { o.reconstruction.trim_distance_cells = 1e-4; }), "tile_size_m");
}

}  // namespace surface_tiles_test
}  // namespace libmap
