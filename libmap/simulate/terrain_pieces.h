// Points on rocky ground, piece by piece: squares of one size that count from the origin on.
#pragma once

#include <cstddef>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"
#include "libmap/simulate/rocky_terrain.h"
#include "libmap/tiles/xy_tile.h"

namespace libmap {

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
