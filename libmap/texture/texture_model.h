// Textures a mesh with the photographs of a scan.
//
// Steps: rate the photographs that see each triangle (texture_views), assign one photograph per
// triangle with short seams (label_triangles), pack the resulting charts onto pages
// (texture_atlas), estimate the relative exposure (estimate_exposure), and blend the colors of the
// best photographs of each surface point (paint_texture). Seam: edge between two photographs.
#pragma once

#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/parameters.h"
#include "libmap/core/pose_graph.h"
#include "libmap/core/progress.h"
#include "libmap/core/result_table.h"
#include "libmap/core/stage_timer.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/mesh/mesh_tile_index.h"
#include "libmap/scan/scan_source.h"
#include "libmap/texture/texture_atlas.h"
#include "libmap/texture/texture_steps.h"
#include "libmap/texture/texture_views.h"

namespace libmap {

struct TextureOptions {
  TextureAtlasOptions atlas{};
  TextureViewOptions views{};
  LabelingOptions labeling{};
  ExposureOptions exposure{};
  int blend_views = 3;          // >= 1: maximum number of photographs blended at a surface point
  double blend_exponent = 1.0;  // >= 0: exponent of the view quality in the blending weights
  // >= 0: triangles with longer sides are subdivided if a photograph may show them, so that
  // photographs see most triangles completely or not at all; 0: never. Longer sides remain if the
  // result would exceed both 2.5 million triangles and twice the triangles of the mesh.
  double max_side_m = 0.05;
  Color unseen_color{128, 128, 128};  // color of triangles that no photograph shows
  bool strict = false;                // throw Error for an unusable frame instead of skipping it
};
void bind(ParameterTable& table, TextureOptions& options);

// Statistics of one model, or of several tiles together.
struct TextureCounts {
  std::size_t cut_triangles = 0;     // triangles added by subdivision
  std::size_t seen_triangles = 0;    // triangles with a photograph
  std::size_t unseen_triangles = 0;  // triangles without a photograph
  double seen_m2 = 0.0;              // area with a photograph
  double unseen_m2 = 0.0;            // area without a photograph
  std::size_t charts = 0;            // connected sets of triangles textured from one photograph
  std::size_t split_charts = 0;      // charts that were split because they exceeded a page
  std::size_t shrunk_charts = 0;     // single triangles larger than a page that were scaled down
  std::size_t pages = 0;             // number of texture images
  double atlas_scale = 1.0;     // minimum scale of the charts; below 1 if reduced for max_pages
  double texels = 0.0;          // texels covered by triangles
  double seams_before_m = 0.0;  // length of the seams if each triangle had its best photograph
  double seams_m = 0.0;         // length of the seams of the model

  // Square root of the mean area of a texel on the surface, m; 0 without texels.
  double texel_size_m() const;
};
void describe(ResultTable& table, const TextureCounts& counts);

struct TextureReport : TextureCounts {
  std::size_t photos = 0;                      // number of usable photographs
  std::vector<std::pair<int, Error>> skipped;  // node and reason of each unusable frame
  TextureExposure exposure;
  StageTimings timings_s;
};
void describe(ResultTable& table, const TextureReport& report);

struct TextureResult : TextureReport {
  TexturedMesh model;
};

// Textures `mesh`, which is in the world frame of the poses. The result is the same for any number
// of threads. Throws Error if an option is out of range, the mesh is invalid or empty, or no usable
// photograph shows any triangle.
TextureResult texture_mesh(const TriangleMesh& mesh, const ScanSource& scan,
                           const Trajectory& world_from_base, const TextureOptions& options = {},
                           Progress& progress = no_progress());

// Textures a mesh that is stored in tiles, one by one; memory depends on the size of a tile. Throws
// Error as texture_mesh does; a tile that no photograph shows is no error.
class TileTexturing {
 public:
  // For a tile, only the mesh within `margin_m` of the tile is an occluder. `tiles`, `scan` and
  // `progress` must outlive this object.
  TileTexturing(MeshTileIndex& tiles, double margin_m, const ScanSource& scan,
                const Trajectory& world_from_base, const TextureOptions& options,
                Progress& progress = no_progress());
  ~TileTexturing();

  // Estimates the common exposure from all tiles.
  TextureExposure find_exposure();
  struct Tile {
    TexturedMesh model;
    TextureCounts counts;
  };
  // Textures the tile with this index in `tiles`, with the result of find_exposure.
  Tile make(std::size_t tile, const TextureExposure& exposure);
  // Returns the report on the photographs, with the running times so far and empty counts.
  TextureReport report() const;

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

// Throws Error if no photograph sees any triangle.
void require_seen(const TextureReport& report);

}  // namespace libmap
