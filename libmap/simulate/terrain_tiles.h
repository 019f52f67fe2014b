// Unbounded procedural rocky terrain (a height field as a function of position and seed), and
// points of the terrain in square tiles indexed from the origin.
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
  double rocks_per_m2 = 1.2;      // mean number of rocks
  double min_rock_m = 0.15;       // minimum and maximum height of the rocks
  double max_rock_m = 0.7;

  // Throws Error if max_rock_m is less than min_rock_m.
  void check() const;
};
void bind(ParameterTable& table, RockyTerrainOptions& options);

// The terrain over a rectangle. Relief and roughness are fractal noise. Rocks are faceted blocks
// and rounded cobbles without overhangs at random positions; they may overlap. Rock heights follow
// a power law with a cumulative index of -2.65, as do boulders on Ryugu (Michikami et al. 2019).
class RockyTerrain {
 public:
  // Draws all rocks that intersect the rectangle.
  RockyTerrain(const RockyTerrainOptions& options, const Eigen::AlignedBox2d& rectangle_m);

  // Height (m) at a position in the rectangle. It does not depend on the rectangle.
  double height(double x_m, double y_m) const;

  std::size_t rocks() const { return rocks_.size(); }

 private:
  // Height above the rock's foot: c - a x - b y relative to the rock's center.
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
    // Cobbles only.
    double height_m = 0.0;
    Eigen::Matrix2d unit_from_plan = Eigen::Matrix2d::Identity();  // to a circle of radius 1
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
  // Rocks per square bucket of the rectangle, row by row.
  std::size_t columns_ = 0;
  std::vector<std::vector<std::uint32_t>> buckets_;
};

struct TerrainTilesOptions {
  double size_x_m = 100.0;  // extent of the terrain, from 0
  double size_y_m = 100.0;
  double tile_m = 10.0;     // side of a tile
  double spacing_m = 0.01;  // mean distance between points
  RockyTerrainOptions terrain;

  // Throws Error if a field is out of range, or for more than 10^6 tiles or 10^8 cells per tile.
  void check() const;
};
// Binds all fields except the size.
void bind(ParameterTable& table, TerrainTilesOptions& options);

// Returns the tiles that cover the terrain, ascending. Throws as TerrainTilesOptions::check.
std::vector<XyTile> terrain_tiles(const TerrainTilesOptions& options);

// Returns the points of one tile with normals, m, z up. Each square cell of the x-y plane with side
// `spacing_m` contains one point per spacing_m^2 of surface, randomly rounded up or down, at least
// one. A tile depends only on the tile index, the seed, the spacing and the terrain; a tile cropped
// by the terrain's size is a subset of the complete one. Sizes are rounded to multiples of the
// spacing. Throws Error as TerrainTilesOptions::check does.
PointCloud sample_tile(const TerrainTilesOptions& options, const XyTile& tile);

}  // namespace libmap
