// Unbounded rocky ground as a height field, a function of position and seed, and its points piece
// by piece: squares of one size that count from the origin on.
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
  double relief_m = 0.25;         // largest height of the ground's waves
  double relief_length_m = 10.0;  // length of the longest of them
  double roughness_m = 0.015;     // largest height of the surface's unevenness
  double rocks_per_m2 = 1.2;
  double min_rock_m = 0.15;  // heights of the rocks
  double max_rock_m = 0.7;

  // Throws Error naming the field, its value and its bound.
  void check() const;
};
void bind(ParameterTable& table, RockyTerrainOptions& options);

// The terrain over a rectangle: it holds the rocks that reach into it. Waves and unevenness are
// fractal noise; rocks are blocks of facets and rounded cobbles without overhangs that stand where
// chance puts them, through one another too. Their heights follow a power law with a cumulative
// index of -2.65, that of Ryugu's boulders (Michikami et al. 2019).
class RockyTerrain {
 public:
  // Draws all rocks that reach into the rectangle.
  RockyTerrain(const RockyTerrainOptions& options, const Eigen::AlignedBox2d& rectangle_m);

  // At a place in the rectangle; the same in any rectangle that holds the place.
  double height(double x_m, double y_m) const;

  std::size_t rocks() const { return rocks_.size(); }

 private:
  // Height over the rock's foot: c - a x - b y about its center.
  struct Facet {
    double a = 0.0;
    double b = 0.0;
    double c = 0.0;
  };
  struct Rock {
    Eigen::Vector2d center = Eigen::Vector2d::Zero();
    double foot_m = 0.0;   // height of the ground beneath its center
    double reach_m = 0.0;  // farther off there is none of it
    std::vector<Facet> facets{};
    // A cobble: facets are empty.
    double height_m = 0.0;
    Eigen::Matrix2d unit_from_plan = Eigen::Matrix2d::Identity();  // to a circle of radius 1
  };
  double ground(double x_m, double y_m) const;
  Rock draw_block(double height_m, std::uint64_t seed) const;
  Rock draw_cobble(double height_m, std::uint64_t seed) const;
  void add_rocks_of_cell(std::int64_t i, std::int64_t j);
  void sort_into_buckets();
  static double height_over_foot(const Rock& rock, const Eigen::Vector2d& place);

  RockyTerrainOptions options_;
  Eigen::AlignedBox2d rectangle_m_;
  std::vector<Rock> rocks_;
  // The rocks of each square of the rectangle, row by row.
  std::size_t columns_ = 0;
  std::vector<std::vector<std::uint32_t>> buckets_;
};

struct TerrainPiecesOptions {
  double size_x_m = 100.0;  // from 0 on
  double size_y_m = 100.0;
  double piece_m = 10.0;
  double spacing_m = 0.01;
  RockyTerrainOptions terrain;

  // Throws Error naming the field, its value and its bound: more than 10^6 pieces, or a piece of
  // more than 10^8 cells.
  void check() const;
};
// All but the size.
void bind(ParameterTable& table, TerrainPiecesOptions& options);

// The pieces that cover the terrain, ascending.
std::vector<XyTile> terrain_pieces(const TerrainPiecesOptions& options);

// The points of one piece, with normals, in meters, z up: the plan is cut into squares of
// `spacing_m`, and each holds a point for each spacing_m^2 of its surface, by chance rounded up or
// down, at least one. A piece depends on its place, the seed, the spacing and the terrain alone;
// one that the size cuts off holds the same points as the whole one as far as it goes. Sizes are
// rounded to whole spacings.
PointCloud sample_piece(const TerrainPiecesOptions& options, const XyTile& piece);

}  // namespace libmap
