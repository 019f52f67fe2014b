// Reconstructs and cleans the surface of a large cloud in tiles of the x-y plane, so that memory
// does not depend on the cloud's area. Adjacent tiles have the same vertices on the seam.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "libmap/core/progress.h"
#include "libmap/surface/mesh_cleaning.h"
#include "libmap/surface/surface_reconstruction.h"
#include "libmap/tiles/xy_tile.h"

namespace libmap {

struct SurfaceTileOptions {
  double tile_m = 5.0;  // > 0: side of a tile
  SurfaceReconstructionOptions reconstruction{};
  MeshCleaningOptions cleaning{};

  // Throws Error for an option that requires the whole surface (Poisson reconstruction, automatic
  // cell size, decimation), or if margin_m() is more than 16 times tile_m.
  void check() const;
  // Maximum distance from a tile at which points affect the surface of the tile, m.
  double margin_m() const;
};

// Returns the box of a tile, enlarged by a margin on each side.
XyBox xy_box_of(const XyTile& tile, double tile_m, double margin_m);

// Adds, for each tile that may contain a part of the surface, the number of points within reach of
// it: surface_margin_m (surface_reconstruction.h) plus max_hole_m. Throws Error if tile_m is too
// small for the coordinates.
void add_surface_tiles(const PointCloud& cloud, const SurfaceTileOptions& options,
                       std::map<XyTile, std::size_t>& points_in_tiles);

struct SurfaceTile {
  // Triangles with centers in the tile. Positions are rounded to single precision, as in files, if
  // this changes them by at most 1e-5 m.
  TriangleMesh mesh;
  std::vector<double> component_areas_m2;  // by index in connected_components(mesh)
  // Edges to triangles of other tiles: positions of both ends, and index of the mesh's component.
  using Edge = std::array<double, 6>;
  std::vector<std::pair<Edge, std::uint32_t>> seams;
  SurfaceReconstructionResult reconstruction;  // of the tile with its margin, without mesh
  MeshCleaningResult cleaning;                 // of the tile with its margin, without mesh
};

// Reconstructs the surface of one tile from the `points` within margin_m() of it; `statistics` are
// the statistics of the whole cloud. The surface equals the result of reconstruct_surface() and
// clean_mesh() for the whole cloud, with two exceptions. Small components (islands) that extend
// beyond the margin are kept, for SurfaceIslands. A hole beside a narrow island may stay open.
// Throws Error as options.check(), reconstruct_part and clean_mesh do.
SurfaceTile make_surface_tile(const PointCloud& points, const CloudStatistics& statistics,
                              const XyTile& tile, const SurfaceTileOptions& options,
                              Progress& progress = no_progress());

// Returns the mesh without the components of these indices (connected_components), ascending.
TriangleMesh without_components(const TriangleMesh& mesh,
                                const std::vector<std::uint32_t>& components);

// Finds islands (components below the minimum area) by joining components of tiles along seams.
class SurfaceIslands {
 public:
  // Adds the components of one tile.
  void add(const XyTile& tile, const SurfaceTile& made);
  // Indices of the components that belong to islands, by tile, ascending.
  using Dropped = std::map<XyTile, std::vector<std::uint32_t>>;
  Dropped dropped(const MeshCleaningOptions& options);
  std::size_t islands() const { return islands_; }  // number of islands, valid after dropped()

 private:
  struct Part {
    XyTile tile;
    std::uint32_t component = 0;
    double area_m2 = 0.0;
  };
  std::vector<Part> parts_;
  std::vector<std::pair<std::size_t, std::size_t>> joined_;  // pairs of parts
  std::map<SurfaceTile::Edge, std::size_t> open_;            // part by seam with one known side
  std::size_t islands_ = 0;
};

}  // namespace libmap
