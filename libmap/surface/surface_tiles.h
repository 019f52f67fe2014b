// A surface made square by square of the x-y plane, so that memory does not depend on its area. At
// the seams the squares' triangles fit each other exactly: both sides have the same vertices.
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
  double tile_m = 5.0;  // > 0: side of a square
  SurfaceReconstructionOptions reconstruction{};
  MeshCleaningOptions cleaning{};

  // Throws Error naming an option that needs the whole surface at once: Poisson reconstruction,
  // cells of no given size, decimation; or tile_size_m, if margin_m() is more than 16 times as
  // large.
  void check() const;
  // Points so far around a square have a say in its surface.
  double margin_m() const;
};

// The square, grown.
PlanBox plan_box_of(const XyTile& tile, double tile_m, double margin_m);

// The squares that may have a part of the surface of `cloud`.
void add_surface_tiles(const PointCloud& cloud, const SurfaceTileOptions& options,
                       std::map<XyTile, std::size_t>& points_in_tiles);

struct SurfaceTile {
  // The triangles whose centers are in the square. Positions are those of single precision where
  // that moves them by less than 1e-5 m, so that files keep them exactly.
  TriangleMesh mesh;
  std::vector<double> component_areas_m2;  // of `mesh`: connected_components
  // Edges to triangles of other squares: their ends, and the component in `mesh`.
  using Edge = std::array<double, 6>;
  std::vector<std::pair<Edge, std::uint32_t>> seams;
  SurfaceReconstructionResult reconstruction;  // these two without meshes, of all around the square
  MeshCleaningResult cleaning;
};

// `points` are those around the square by margin_m(), of a cloud that `survey` has seen whole. The
// surface is that of reconstruct_surface() and clean_mesh(), but that islands are left which may go
// on beyond: SurfaceIslands finds them. Components narrower than min_island_area_m2 / margin_m()
// that do so may keep a hole beside them from being filled.
SurfaceTile make_surface_tile(const PointCloud& points, const SurfaceSurvey& survey,
                              const XyTile& tile, const SurfaceTileOptions& options,
                              Progress& progress = no_progress());

// The mesh without some of its connected_components, ascending.
TriangleMesh without_components(const TriangleMesh& mesh,
                                const std::vector<std::uint32_t>& components);

// Joins the components of squares along their seams.
class SurfaceIslands {
 public:
  // The components of one square, by which those of its neighbors are joined.
  void add(const XyTile& tile, const SurfaceTile& made);
  // The components of each square that belong to islands, ascending.
  using Dropped = std::map<XyTile, std::vector<std::uint32_t>>;
  Dropped dropped(const MeshCleaningOptions& options);
  std::size_t islands() const { return islands_; }  // known after dropped()

 private:
  struct Part {
    XyTile tile;
    std::uint32_t component = 0;
    double area_m2 = 0.0;
  };
  std::vector<Part> parts_;
  std::vector<std::pair<std::size_t, std::size_t>> joined_;  // parts
  std::map<SurfaceTile::Edge, std::size_t> open_;            // seams met from one side, the part
  std::size_t islands_ = 0;
};

}  // namespace libmap
