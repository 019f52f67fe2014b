// Terrain in pieces: the surface depends only on position and seed.
#include "libmap/simulate/terrain_tiles.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "tests/support/test_support.h"

namespace libmap {
namespace terrain_tiles_test {

using graspmap_test::error_of;
using graspmap_test::uniform;

Eigen::AlignedBox2d rectangle(double x0, double y0, double x1, double y1) {
  return {Eigen::Vector2d(x0, y0), Eigen::Vector2d(x1, y1)};
}

TerrainTilesOptions small_pieces() {
  TerrainTilesOptions options;
  options.size_x_m = 3.0;
  options.size_y_m = 2.0;
  options.tile_m = 1.0;
  options.spacing_m = 0.02;
  return options;
}

// The first points of a cloud of which `whole` holds the others too.
bool holds_all(const PointCloud& whole, const PointCloud& part) {
  std::set<std::array<double, 3>> known;
  for (const Eigen::Vector3d& p : whole.positions) known.insert({p.x(), p.y(), p.z()});
  for (const Eigen::Vector3d& p : part.positions)
    if (!known.contains({p.x(), p.y(), p.z()})) return false;
  return true;
}

TEST(RockyTerrain, HeightsDoNotDependOnTheRectangle) {
  RockyTerrainOptions options;
  options.rocks_per_m2 = 4.0;
  const RockyTerrain large(options, rectangle(-4, -4, 4, 4));
  double highest = -HUGE_VAL;
  for (int n = 0; n < 100; ++n) {
    const double x0 = uniform(-3, 2);
    const double y0 = uniform(-3, 2);
    const double x1 = x0 + uniform(0.05, 0.9);
    const double y1 = y0 + uniform(0.05, 0.9);
    const RockyTerrain small(options, rectangle(x0, y0, x1, y1));
    EXPECT_GT(large.rocks(), small.rocks());
    for (int m = 0; m < 200; ++m) {
      const double x = uniform(x0, x1);
      const double y = uniform(y0, y1);
      EXPECT_EQ(large.height(x, y), small.height(x, y)) << x << " " << y;
      highest = std::max(highest, small.height(x, y));
    }
  }
  EXPECT_GT(highest, 0.3) << "no rock was among the places";
}

TEST(RockyTerrain, BareGroundKeepsToItsHeights) {
  RockyTerrainOptions options;
  options.rocks_per_m2 = 0.0;
  options.roughness_m = 0.0;
  options.relief_m = 0.2;
  const RockyTerrain ground(options, rectangle(0, 0, 40, 40));
  EXPECT_EQ(ground.rocks(), 0U);
  double low = HUGE_VAL;
  double high = -HUGE_VAL;
  for (int n = 0; n < 20'000; ++n) {
    const double height = ground.height(uniform(0, 40), uniform(0, 40));
    low = std::min(low, height);
    high = std::max(high, height);
  }
  EXPECT_GE(low, -0.2);
  EXPECT_LE(high, 0.2);
  EXPECT_GT(high - low, 0.1);
}

TEST(RockyTerrain, RocksAreAsManyAndAsHighAsWanted) {
  RockyTerrainOptions options;
  options.relief_m = 0.0;
  options.roughness_m = 0.0;
  options.rocks_per_m2 = 1.5;
  options.min_rock_m = 0.2;
  options.max_rock_m = 0.5;
  // Beyond the rectangle stand rocks that reach into it: fewer than one in 20 here.
  const RockyTerrain terrain(options, rectangle(0, 0, 60, 60));
  EXPECT_NEAR(static_cast<double>(terrain.rocks()), 1.5 * 3600, 0.06 * 1.5 * 3600);
  double high = 0.0;
  for (int n = 0; n < 100'000; ++n) {
    const double height = terrain.height(uniform(0, 60), uniform(0, 60));
    EXPECT_GE(height, 0.0);
    high = std::max(high, height);
  }
  EXPECT_LE(high, 0.5 + 1e-9);
  EXPECT_GT(high, 0.4);
}

// A share of 2^-2.65 of the rocks is twice as high as the lowest.
TEST(RockyTerrain, HeightsOfRocksFollowThePowerLaw) {
  const auto rocks_above = [](double min_rock_m, double max_rock_m) {
    RockyTerrainOptions options;
    options.relief_m = 0.0;
    options.roughness_m = 0.0;
    options.min_rock_m = min_rock_m;
    options.max_rock_m = max_rock_m;
    options.rocks_per_m2 = 0.05;  // alone: each is a hill of its own
    const RockyTerrain terrain(options, rectangle(0, 0, 100, 100));
    // Tops over squares of two meters.
    std::map<std::pair<int, int>, double> tops;
    for (int x = 0; x < 1000; ++x)
      for (int y = 0; y < 1000; ++y) {
        double& top = tops[{x / 20, y / 20}];
        top = std::max(top, terrain.height(0.1 * x, 0.1 * y));
      }
    double above = 0;
    double all = 0;
    for (const auto& [place, top] : tops) {
      all += top > 0.1 ? 1 : 0;
      above += top > 0.4 ? 1 : 0;
    }
    return above / all;
  };
  EXPECT_NEAR(rocks_above(0.2, 5.0), std::pow(2.0, -2.65), 0.06);
}

TEST(TerrainTiles, MeetAtTheirSeams) {
  const TerrainTilesOptions options = small_pieces();
  const RockyTerrain terrain(options.terrain, rectangle(0, 0, 3, 2));
  for (const XyTile& piece : terrain_tiles(options)) {
    const PointCloud cloud = sample_tile(options, piece);
    for (const Eigen::Vector3d& p : cloud.positions) {
      EXPECT_EQ(p.z(), terrain.height(p.x(), p.y()));
      EXPECT_EQ(std::floor(p.x()), piece.i);
      EXPECT_EQ(std::floor(p.y()), piece.j);
    }
  }
}

TEST(TerrainTiles, DoNotDependOnTheSizeOfTheWhole) {
  TerrainTilesOptions large = small_pieces();
  large.size_x_m = 50.0;
  large.size_y_m = 70.0;
  const PointCloud small = sample_tile(small_pieces(), {1, 1});
  const PointCloud same = sample_tile(large, {1, 1});
  EXPECT_EQ(small.positions, same.positions);
  EXPECT_EQ(small.normals, same.normals);
  // A cropped piece is a subset of the complete one.
  TerrainTilesOptions cut = small_pieces();
  cut.size_x_m = 1.5;
  const PointCloud part = sample_tile(cut, {1, 1});
  EXPECT_TRUE(holds_all(small, part));
  EXPECT_GT(part.size(), small.size() * 2 / 5);
  for (const Eigen::Vector3d& p : part.positions) EXPECT_LT(p.x(), 1.5);
}

TEST(TerrainTiles, CoverThePlanAndTheSlopes) {
  TerrainTilesOptions options = small_pieces();
  options.terrain.rocks_per_m2 = 3.0;
  const PointCloud cloud = sample_tile(options, {0, 0});
  std::map<std::pair<int, int>, int> cells;
  for (const Eigen::Vector3d& p : cloud.positions)
    ++cells[{static_cast<int>(p.x() / options.spacing_m),
             static_cast<int>(p.y() / options.spacing_m)}];
  EXPECT_EQ(cells.size(), 2500U) << "a square of the plan has no point";
  // As many points as the surface, by its normals, has squares.
  double area = 0.0;
  for (const Eigen::Vector3f& normal : cloud.normals) {
    EXPECT_NEAR(normal.norm(), 1.0, 1e-5);
    EXPECT_GT(normal.z(), 0.0);
  }
  const RockyTerrain terrain(options.terrain, rectangle(0, 0, 1.01, 1.01));
  constexpr int fine = 300;
  for (int x = 0; x < fine; ++x)
    for (int y = 0; y < fine; ++y) {
      const double step = 1.0 / fine;
      const double z = terrain.height(x * step, y * step);
      const double dx = (terrain.height((x + 1) * step, y * step) - z) / step;
      const double dy = (terrain.height(x * step, (y + 1) * step) - z) / step;
      area += step * step * std::sqrt(1.0 + dx * dx + dy * dy);
    }
  EXPECT_GT(area, 1.15) << "the piece has no rock";
  EXPECT_NEAR(static_cast<double>(cloud.size()) * 0.02 * 0.02, area, 0.06 * area);
}

TEST(TerrainTiles, AreAsManyAsTheSizeNeeds) {
  TerrainTilesOptions options = small_pieces();
  EXPECT_EQ(terrain_tiles(options).size(), 6U);
  options.size_x_m = 3.02;
  EXPECT_EQ(terrain_tiles(options).size(), 8U);
  options.size_x_m = 0.3;
  EXPECT_EQ(terrain_tiles(options).size(), 2U);
}

TEST(TerrainTiles, ImpossibleOptionsAreNamed) {
  const auto field_of = [](const auto& change) {
    TerrainTilesOptions options = small_pieces();
    change(options);
    return error_of([&] { terrain_tiles(options); }).context().field;
  };
  EXPECT_EQ(field_of([](auto& o) { o.spacing_m = 0.0; }), "spacing_m");
  EXPECT_EQ(field_of([](auto& o) { o.tile_m = 0.001; }), "tile_size_m");
  EXPECT_EQ(field_of([](auto& o) {
              o.size_x_m = 90'000;
              o.size_y_m = 90'000;
            }),
            "tile_size_m");
  EXPECT_EQ(field_of([](auto& o) { o.size_y_m = HUGE_VAL; }), "size_y_m");
  EXPECT_EQ(field_of([](auto& o) { o.terrain.max_rock_m = 0.1; }), "max_rock_m");
  EXPECT_EQ(field_of([](auto& o) { o.terrain.rocks_per_m2 = -1; }), "rocks_per_m2");
}

}  // namespace terrain_tiles_test
}  // namespace libmap
