#include "libmap/surface/surface_tiles.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "libmap/core/error.h"
#include "libmap/core/single_precision.h"
#include "libmap/core/text.h"
#include "libmap/geometry/disjoint_sets.h"
#include "libmap/mesh/mesh_adjacency.h"
#include "libmap/mesh/mesh_parts.h"

namespace libmap {

namespace {

// Distance in cells around intersections that their repair may change.
constexpr double repair_cells = 12.0;
// Maximum extent of a triangle from its center, in cells.
constexpr double triangle_cells = 2.0;
// Distance in cells of the vertices that influence a vertex in one iteration of Taubin's smoothing.
constexpr double smoothing_cells = 4.0;
// The diameter of a hole, and twice that for a component around it (hole_filling).
constexpr double hole_diameters = 3.0;
// Maximum rounding error of coordinates in files.
constexpr double max_rounding_m = 1e-5;
// Maximum distance from the origin in tiles.
constexpr double max_tiles = 1e15;

// Distance around a tile of the surface that influences islands, holes and repairs in it.
double cleaning_margin_m(const SurfaceTileOptions& options) {
  const MeshCleaningOptions& cleaning = options.cleaning;
  return hole_diameters * cleaning.max_hole_m +
         (repair_cells + smoothing_cells * cleaning.smoothing_iterations) *
             options.reconstruction.cell_size_m;
}

// Marks the triangles for whose center wanted(x, y) is true.
template <typename Wanted>
std::vector<bool> triangles_at(const TriangleMesh& mesh, const Wanted& wanted) {
  std::vector<bool> marks(mesh.triangles.size());
  for (std::size_t t = 0; t < marks.size(); ++t)
    marks[t] = wanted(Eigen::Vector2d(center_of(mesh, mesh.triangles[t]).head<2>()));
  return marks;
}

SurfaceTile::Edge edge_of(const TriangleMesh& mesh, HalfEdge h) {
  const auto numbers = [&](std::uint32_t v) {
    const Eigen::Vector3d& p = mesh.vertices[v];
    return std::array<double, 3>{p.x(), p.y(), p.z()};
  };
  auto a = numbers(source_of(mesh.triangles, h));
  auto b = numbers(target_of(mesh.triangles, h));
  if (b < a) std::swap(a, b);
  return {a[0], a[1], a[2], b[0], b[1], b[2]};
}

// Sets the mesh of the tile to the marked triangles, and its seams to their edges with others.
void cut_out(const TriangleMesh& mesh, const std::vector<bool>& marks, SurfaceTile& made) {
  made.mesh = select_triangles(mesh, marks);
  const MeshComponents components = connected_components(made.mesh);
  made.component_areas_m2 = components.areas_m2;
  const std::vector<HalfEdge> opposite = opposites_of(mesh);
  std::size_t selected = 0;
  for (std::size_t t = 0; t < marks.size(); ++t) {
    if (!marks[t]) continue;
    for (auto h = static_cast<HalfEdge>(3 * t); h < 3 * t + 3; ++h)
      if (is_joined(opposite[h]) && !marks[opposite[h] / 3])
        made.seams.emplace_back(edge_of(mesh, h), components.of_triangle[selected]);
    ++selected;
  }
  for (Eigen::Vector3d& vertex : made.mesh.vertices) {
    const Eigen::Vector3d rounded = rounded_to_single(vertex);
    for (int axis = 0; axis < 3; ++axis)
      if (std::abs(rounded[axis] - vertex[axis]) <= max_rounding_m) vertex[axis] = rounded[axis];
  }
}

}  // namespace

void SurfaceTileOptions::check() const {
  if (!(tile_m > 0.0 && std::isfinite(tile_m)))
    throw Error("out of range", {.field = "tile_size_m", .value = to_text(tile_m), .bound = "> 0"});
  // Each tile reads all points around it. With a larger margin, tiles save neither memory nor time.
  constexpr double max_margin_tiles = 16.0;
  if (margin_m() > max_margin_tiles * tile_m)
    throw Error("too small for the margin of points around a tile",
                {.field = "tile_size_m",
                 .value = to_text(tile_m),
                 .bound = ">= " + to_text(margin_m() / max_margin_tiles) +
                          ", which follows from cell_size_m, support_cells, trim_distance_cells "
                          "and max_hole_m"});
  if (cleaning.decimation_error_m > 0.0)
    throw Error("surfaces in tiles cannot be decimated",
                {.field = "decimation_error_m",
                 .value = to_text(cleaning.decimation_error_m),
                 .bound = "0"});
}

double SurfaceTileOptions::margin_m() const {
  return cleaning_margin_m(*this) + triangle_cells * reconstruction.cell_size_m +
         surface_margin_m(reconstruction);
}

XyBox xy_box_of(const XyTile& tile, double tile_m, double margin_m) {
  const Eigen::Vector2d low =
      Eigen::Vector2d(static_cast<double>(tile.i), static_cast<double>(tile.j)) * tile_m;
  return {low.array() - margin_m, low.array() + tile_m + margin_m};
}

TriangleMesh without_components(const TriangleMesh& mesh,
                                const std::vector<std::uint32_t>& components) {
  const MeshComponents all = connected_components(mesh);
  std::vector<bool> keep(mesh.triangles.size());
  for (std::size_t t = 0; t < keep.size(); ++t)
    keep[t] = !std::binary_search(components.begin(), components.end(), all.of_triangle[t]);
  return select_triangles(mesh, keep);
}

void add_surface_tiles(const PointCloud& cloud, const SurfaceTileOptions& options,
                       std::map<XyTile, std::size_t>& points_in_tiles) {
  const double reach = surface_margin_m(options.reconstruction) + options.cleaning.max_hole_m;
  for (const Eigen::Vector3d& position : cloud.positions) {
    if (!(position.head<2>().cwiseAbs().maxCoeff() < max_tiles * options.tile_m))
      throw Error("too small for the coordinates of the cloud",
                  {.field = "tile_size_m", .value = to_text(options.tile_m)});
    const Eigen::Vector2d in_plane = position.head<2>();
    const XyTile low = xy_tile_at(in_plane.array() - reach, options.tile_m);
    const XyTile high = xy_tile_at(in_plane.array() + reach, options.tile_m);
    for (std::int64_t i = low.i; i <= high.i; ++i)
      for (std::int64_t j = low.j; j <= high.j; ++j) ++points_in_tiles[{i, j}];
  }
}

SurfaceTile make_surface_tile(const PointCloud& points, const CloudStatistics& statistics,
                              const XyTile& tile, const SurfaceTileOptions& options,
                              Progress& progress) {
  options.check();
  SurfaceTile made;
  made.reconstruction = reconstruct_part(points, statistics, options.reconstruction, progress);
  const double cell_m = options.reconstruction.cell_size_m;
  MeshCleaningOptions cleaning = options.cleaning;
  cleaning.known = xy_box_of(tile, options.tile_m, cleaning_margin_m(options));
  cleaning.min_island_fraction = 0.0;
  const XyBox cut =
      xy_box_of(tile, options.tile_m, cleaning_margin_m(options) + triangle_cells * cell_m);
  const TriangleMesh around = select_triangles(
      made.reconstruction.mesh,
      triangles_at(made.reconstruction.mesh,
                   [&](const Eigen::Vector2d& center) { return cut.contains(center); }));
  made.reconstruction.mesh = {};
  if (around.triangles.empty()) return made;
  made.cleaning = clean_mesh(around, cleaning, progress);
  const TriangleMesh mesh = std::move(made.cleaning.mesh);
  made.cleaning.mesh = {};
  cut_out(mesh,
          triangles_at(mesh,
                       [&](const Eigen::Vector2d& center) {
                         return xy_tile_at(center, options.tile_m) == tile;
                       }),
          made);
  return made;
}

void SurfaceIslands::add(const XyTile& tile, const SurfaceTile& made) {
  const std::size_t first = parts_.size();
  for (std::size_t c = 0; c < made.component_areas_m2.size(); ++c)
    parts_.push_back({tile, static_cast<std::uint32_t>(c), made.component_areas_m2[c]});
  for (const auto& [edge, component] : made.seams) {
    const auto [other, is_new] = open_.try_emplace(edge, first + component);
    if (is_new) continue;
    const std::pair<std::size_t, std::size_t> pair(other->second, first + component);
    if (joined_.empty() || joined_.back() != pair) joined_.push_back(pair);
    open_.erase(other);
  }
}

SurfaceIslands::Dropped SurfaceIslands::dropped(const MeshCleaningOptions& options) {
  DisjointSets<std::size_t> sets(parts_.size());
  for (const auto& [a, b] : joined_) sets.join(a, b);
  std::vector<double> areas(parts_.size(), 0.0);
  for (std::size_t n = 0; n < parts_.size(); ++n) areas[sets.find(n)] += parts_[n].area_m2;
  double largest = 0.0;
  for (const double area : areas) largest = std::max(largest, area);
  const double smallest =
      std::max(options.min_island_area_m2, options.min_island_fraction * largest);
  Dropped found;
  std::set<std::size_t> islands;
  for (std::size_t n = 0; n < parts_.size(); ++n)
    if (areas[sets.find(n)] < smallest) {
      found[parts_[n].tile].push_back(parts_[n].component);
      islands.insert(sets.find(n));
    }
  islands_ = islands.size();
  return found;
}

}  // namespace libmap
