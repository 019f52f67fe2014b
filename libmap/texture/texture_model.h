// A mesh with the colors of a scan's photographs.
//
// Which photographs see each triangle, and how well (texture_views); one of them for each triangle
// with few seams between them (texture_labeling), whose picture gives the triangle its place on
// the texture's pages (texture_atlas); what photographs differ by as a whole (texture_exposure);
// the colors, from the few best photographs of each place (texture_painting).
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
#include "libmap/mesh/mesh_piece_index.h"
#include "libmap/scan/scan_source.h"
#include "libmap/texture/texture_atlas.h"
#include "libmap/texture/texture_exposure.h"
#include "libmap/texture/texture_labeling.h"
#include "libmap/texture/texture_views.h"

namespace libmap {

struct TextureOptions {
  TextureAtlasOptions atlas{};
  TextureViewOptions views{};
  LabelingOptions labeling{};
  ExposureOptions exposure{};
  // Photographs that are blended at a place; 1: one a triangle.
  int blend_views = 3;
  // >= 0: how much the better of them count for more.
  double blend_exponent = 1.0;
  // Triangles with longer sides are cut where photographs may show them, so that each of these sees
  // them whole or not; 0: none. Longer ones stay where that would make more than 2.5 million
  // triangles, and more than twice those of the mesh.
  double max_side_m = 0.05;
  Color unseen_color{128, 128, 128};
  bool strict = false;  // a frame that cannot be used is an Error
};
void bind(ParameterTable& table, TextureOptions& options);

// Of one model, or of several pieces together.
struct TextureCounts {
  std::size_t cut_triangles = 0;  // more triangles than the mesh had
  std::size_t seen_triangles = 0;
  std::size_t unseen_triangles = 0;
  double seen_m2 = 0.0;
  double unseen_m2 = 0.0;
  std::size_t charts = 0;
  std::size_t split_charts = 0;
  std::size_t shrunk_charts = 0;
  std::size_t pages = 0;
  double atlas_scale = 1.0;     // below 1 where charts were made smaller for max_pages; the least
  double texels = 0.0;          // on triangles
  double seams_before_m = 0.0;  // with the best photograph for every triangle
  double seams_m = 0.0;

  // Root of the mean area of a texel on the surface.
  double texel_size_m() const;
};
void describe(ResultTable& table, const TextureCounts& counts);

struct TextureReport : TextureCounts {
  std::size_t photos = 0;
  std::vector<std::pair<int, Error>> skipped;  // frames, and what they lack
  TextureExposure exposure;
  StageTimings timings_s;
};
void describe(ResultTable& table, const TextureReport& report);

struct TextureResult : TextureReport {
  TexturedMesh model;
};

// `mesh` lies in the world of the poses. The same bytes for any number of threads. Throws Error:
// options out of their ranges, a mesh that cannot be used, no photograph, no triangle that any
// photograph sees.
TextureResult texture_mesh(const TriangleMesh& mesh, const ScanSource& scan,
                           const Trajectory& world_from_base, const TextureOptions& options = {},
                           Progress& progress = no_progress());

// The pieces of a mesh one by one, so that memory depends on the size of a piece. Errors as of
// texture_mesh, but that no photograph may see a triangle of a piece.
class PieceTexturing {
 public:
  // What is up to `margin_m` around a piece may hide it; what stands further away does not.
  // `pieces`, `scan` and `progress` must outlive this.
  PieceTexturing(MeshPieceIndex& pieces, double margin_m, const ScanSource& scan,
                 const Trajectory& world_from_base, const TextureOptions& options,
                 Progress& progress = no_progress());
  ~PieceTexturing();

  // One for all pieces: looks at each of them.
  TextureExposure find_exposure();
  struct Piece {
    TexturedMesh model;
    TextureCounts counts;
  };
  // With this exposure, of find_exposure.
  Piece make(std::size_t piece, const TextureExposure& exposure);
  // Of the photographs, with the times until now.
  TextureReport report() const;

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

// Throws Error if no triangle was seen by any of the photographs.
void require_seen(const TextureReport& report);

}  // namespace libmap
