// Unbounded procedural rocky terrain (the height is a function of position and seed), and its
// points in square tiles of the x-y plane.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"
#include "libmap/tiles/xy_tile.h"

namespace libmap {

struct RockyTerrainOptions {
  std::uint64_t seed = 1;
  double relief_m = 0.25;         // maximum height of the ground's relief
  double relief_length_m = 10.0;  // longest wavelength of the relief
  double roughness_m = 0.015;     // maximum height of the small-scale roughness
  double rocks_per_m2 = 1.2;      // mean number of rocks per square meter
  double min_rock_m = 0.15;       // minimum height of a rock
  double max_rock_m = 0.7;        // maximum height of a rock

  // Throws Error if max_rock_m is less than min_rock_m.
  void check() const;
};
void bind(ParameterTable& table, RockyTerrainOptions& options);

// The terrain over a rectangle. Relief and roughness are fractal noise. Rocks are faceted blocks
// and rounded cobbles without overhangs at random positions; they may overlap. The number of rocks
// higher than h is proportional to h^-2.65, like that of boulders on Ryugu (Michikami et al. 2019).
class RockyTerrain {
 public:
  // Draws all rocks that intersect the rectangle.
  RockyTerrain(const RockyTerrainOptions& options, const Eigen::AlignedBox2d& rectangle_m);

  // Returns the height (m) at a position in the rectangle. It does not depend on the rectangle.
  double height(double x_m, double y_m) const;

  std::size_t rocks() const { return rocks_.size(); }  // number of drawn rocks

 private:
  // Plane of a block: height c - a x - b y above the rock's foot, x and y relative to the center.
  struct Facet {
    double a = 0.0;
    double b = 0.0;
    double c = 0.0;
  };
  struct Rock {
    Eigen::Vector2d center = Eigen::Vector2d::Zero();
    double foot_m = 0.0;          // height of the ground at the center
    double reach_m = 0.0;         // maximum distance of the rock surface from the center
    std::vector<Facet> facets{};  // empty for a cobble
    // Only for cobbles; unit_from_plan maps the footprint to a circle of radius 1.
    double height_m = 0.0;
    Eigen::Matrix2d unit_from_plan = Eigen::Matrix2d::Identity();
  };
  double ground(double x_m, double y_m) const;
  Rock draw_block(double height_m, std::uint64_t seed) const;
  Rock draw_cobble(double height_m, std::uint64_t seed) const;
  void add_rocks_of_cell(std::int64_t i, std::int64_t j);
  void sort_into_buckets();
  static double height_over_foot(const Rock& rock, const Eigen::Vector2d& position);

  RockyTerrainOptions options_;
  Eigen::AlignedBox2d rectangle_m_;
  std::vector<Rock> rocks_;
  // Rocks in each square bucket of the rectangle, row by row.
  std::size_t columns_ = 0;
  std::vector<std::vector<std::uint32_t>> buckets_;
};

struct TerrainTilesOptions {
  double size_x_m = 100.0;  // the terrain extends from x = 0 to size_x_m
  double size_y_m = 100.0;  // the terrain extends from y = 0 to size_y_m
  double tile_m = 10.0;     // side of a tile
  double spacing_m = 0.01;  // mean distance between points
  RockyTerrainOptions terrain;

  // Throws Error if a field is out of range, or for more than 10^6 tiles or 10^8 cells (of side
  // spacing_m) per tile.
  void check() const;
};
// Binds all fields except size_x_m and size_y_m.
void bind(ParameterTable& table, TerrainTilesOptions& options);

// Returns the tiles that cover the terrain, by i, then j. Throws as TerrainTilesOptions::check.
std::vector<XyTile> terrain_tiles(const TerrainTilesOptions& options);

// Returns the points of one tile with normals, m, z up. Each square cell of the x-y plane with side
// `spacing_m` contains one point per spacing_m^2 of surface area, randomly rounded up or down, but
// at least one. A tile depends only on the tile index, the seed, the spacing and the terrain: if
// the terrain's size cuts a tile, its points are a subset of the whole tile's points. Sizes are
// rounded to multiples of the spacing. Throws Error as TerrainTilesOptions::check does.
PointCloud sample_tile(const TerrainTilesOptions& options, const XyTile& tile);

}  // namespace libmap
