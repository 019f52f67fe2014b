#include "libgtd/tile_detection.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "libgtd/score/closing_terms.h"
#include "libgtd/score/scoring.h"
#include "libgtd/score/surface_scoring.h"
#include "libgtd/score/tilted_matching.h"
#include "libgtd/shape/convexity.h"
#include "libgtd/shape/curvature.h"
#include "libmap/core/error.h"
#include "libmap/core/stage_timer.h"
#include "libmap/core/text.h"

namespace libgtd {

namespace {

using libmap::PointCloud;

CurvatureMethod curvature_method(const Scenario& scenario) {
  return follows_thesis(scenario.method) ? CurvatureMethod::thesis : CurvatureMethod::corrected;
}

// How far off the points lie that decide on the curvature at a point: PCL's looks at the normals
// of its neighbors, which have neighbors of their own.
double curvature_reach_m(const Scenario& scenario) {
  const double reach = scenario.curvature_radius_m * (1 + 1e-6);
  return curvature_method(scenario) == CurvatureMethod::thesis ? 2 * reach : reach;
}

// The columns of each of the tiles grown by `margin_m` and a voxel more.
class TilesWithMargin {
 public:
  TilesWithMargin(const VoxelLattice& lattice, const std::vector<TileBounds>& tiles,
                  double margin_m)
      : lattice_(lattice),
        tiles_(tiles),
        margin_(margin_m / lattice.voxel_size_m + 1.0),
        box_(tiles.empty() ? TileBounds{} : tiles.front()) {
    double cells = 0.0;
    for (const TileBounds& tile : tiles) {
      cells += static_cast<double>(tile.i_end - tile.i_begin) * (tile.j_end - tile.j_begin);
      box_ = {std::min(box_.i_begin, tile.i_begin), std::max(box_.i_end, tile.i_end),
              std::min(box_.j_begin, tile.j_begin), std::max(box_.j_end, tile.j_end)};
    }
    fill_box_ =
        cells == static_cast<double>(box_.i_end - box_.i_begin) * (box_.j_end - box_.j_begin);
  }

  bool hold(const Eigen::Vector3d& point) const {
    const Eigen::Vector3d cell = lattice_.cell_of(point);
    if (!holds(box_, cell)) return false;
    if (fill_box_) return !tiles_.empty();
    // Neighboring points lie in the same tile mostly.
    if (last_ < tiles_.size() && holds(tiles_[last_], cell)) return true;
    for (last_ = 0; last_ < tiles_.size(); ++last_)
      if (holds(tiles_[last_], cell)) return true;
    return false;
  }

 private:
  bool holds(const TileBounds& tile, const Eigen::Vector3d& cell) const {
    return cell.x() >= tile.i_begin - margin_ && cell.x() <= tile.i_end + margin_ &&
           cell.y() >= tile.j_begin - margin_ && cell.y() <= tile.j_end + margin_;
  }

  const VoxelLattice& lattice_;
  const std::vector<TileBounds>& tiles_;
  double margin_;
  TileBounds box_;         // around all tiles
  bool fill_box_ = false;  // whether they leave no gap in it
  mutable std::size_t last_ = 0;
};

std::vector<std::size_t> points_within(const PointCloud& cloud, const VoxelLattice& lattice,
                                       const std::vector<TileBounds>& tiles, double margin_m) {
  const TilesWithMargin places(lattice, tiles, margin_m);
  std::vector<std::size_t> within;
  for (std::size_t n = 0; n < cloud.size(); ++n)
    if (places.hold(cloud.positions[n])) within.push_back(n);
  return within;
}

// A dense part of a scan has no more weight in the curvature than a sparse one.
bool uses_voxel_means(Method method) { return plane_method(method) == PlaneMethod::robust; }

// A voxel that the reach of a tile cuts has another mean: it is farther away than the reach.
constexpr double mean_margin_voxels = 2.0;

// The convex ones of the points `queries`.
std::vector<Eigen::Vector3d> convex_among(const PointCloud& cloud,
                                          const std::optional<std::vector<std::size_t>>& queries,
                                          const Scenario& scenario, TileDetectionResult& result) {
  const CurvatureResult curvature = estimate_curvature(
      cloud, {.method = curvature_method(scenario), .radius_m = scenario.curvature_radius_m},
      queries);
  std::vector<Eigen::Vector3d> queried;
  if (queries)
    for (const std::size_t n : *queries) queried.push_back(cloud.positions[n]);
  const std::vector<Eigen::Vector3d>& positions = queries ? queried : cloud.positions;
  const std::vector<std::uint8_t> convex =
      find_convex(curvature, positions, {.zero_plane_m = scenario.zero_plane_m});
  std::vector<Eigen::Vector3d> convex_points;
  for (std::size_t n = 0; n < positions.size(); ++n)
    if (convex[n] != 0) convex_points.push_back(positions[n]);
  result.curvature_points = positions.size();
  result.convex_points = convex_points.size();
  return convex_points;
}

std::vector<Eigen::Vector3d> find_convex_points(const PointCloud& terrain,
                                                const VoxelLattice& lattice,
                                                const std::vector<TileBounds>& tiles,
                                                CurvatureAt curvature_at, const Scenario& scenario,
                                                TileDetectionResult& result) {
  const bool of_means = uses_voxel_means(scenario.method);
  const double voxel_size_m = scenario.voxel_size_m;
  if (curvature_at == CurvatureAt::all_points)
    return convex_among(of_means ? voxel_means(terrain, voxel_size_m) : terrain, std::nullopt,
                        scenario, result);
  const double margin_m = scenario.intersection_distance_m;
  const double reach_m =
      margin_m + curvature_reach_m(scenario) + (of_means ? mean_margin_voxels * voxel_size_m : 0.0);
  PointCloud nearby =
      libmap::select_points(terrain, points_within(terrain, lattice, tiles, reach_m));
  if (of_means) nearby = voxel_means(nearby, voxel_size_m);
  return convex_among(nearby, points_within(nearby, lattice, tiles, margin_m), scenario, result);
}

// `surface` is empty if no normals were fitted.
std::vector<MapVoxel> map_voxels(const std::vector<ScoredVoxel>& scored,
                                 const std::vector<SurfaceNormal>& surface,
                                 const std::vector<std::uint8_t>& convex,
                                 const VoxelLattice& lattice, const Scenario& scenario) {
  // A probability to hold needs no second opinion of the shape.
  const bool needs_convexity =
      scenario.curvature_radius_m > 0.0 && scenario.method != Method::calibrated;
  std::vector<MapVoxel> voxels;
  voxels.reserve(scored.size());
  for (std::size_t n = 0; n < scored.size(); ++n) {
    MapVoxel voxel{.voxel = scored[n].voxel,
                   .counts = scored[n].counts,
                   .score = scored[n].score,
                   .convex = convex[n] != 0,
                   .graspable = false,
                   .border = scored[n].border,
                   .terms = scored[n].terms,
                   .falling_share = scored[n].falling_share};
    if (!surface.empty()) voxel.slope_deg = surface[n].slope_deg;
    if (scenario.orientation == Orientation::surface && surface[n].normal.allFinite())
      voxel.normal = surface[n].normal;
    const double height = lattice.center_of(voxel.voxel).z();
    voxel.graspable =
        meets_threshold(voxel.counts, voxel.score, scenario.method, scenario.solid_voxel_threshold,
                        scenario.graspability_threshold) &&
        height >= scenario.zero_plane_m && (voxel.convex || !needs_convexity);
    voxels.push_back(voxel);
  }
  return voxels;
}

// Of each pivot of the tiles, if the scenario needs them.
std::vector<SurfaceNormal> surface_normals(const TileSurroundings& surroundings,
                                           const GripperMask& mask,
                                           const std::vector<TileBounds>& tiles,
                                           const Scenario& scenario, TileDetectionResult& result) {
  if (!scenario.fits_normals()) return {};
  return libmap::timed(result.timings_s, "surface normals", [&] {
    const VoxelGrid& grid = surroundings.grid;
    std::vector<SurfaceNormal> normals =
        normals_at(pivots_of(grid, mask, tiles), surroundings.surface, grid.lattice,
                   normal_radius_m(mask, scenario));
    if (scenario.orientation == Orientation::surface)
      result.unoriented_voxels = static_cast<std::size_t>(
          std::count_if(normals.begin(), normals.end(),
                        [](const SurfaceNormal& one) { return !one.normal.allFinite(); }));
    return normals;
  });
}

}  // namespace

bool follows_thesis(Method method) {
  return method == Method::thesis || method == Method::envelope;
}

PlaneMethod plane_method(Method method) {
  if (follows_thesis(method)) return PlaneMethod::thesis;
  return method == Method::climblab ? PlaneMethod::corrected : PlaneMethod::robust;
}

int tile_voxels(const Scenario& scenario) {
  const double voxels = std::round(scenario.tile_size_m / scenario.voxel_size_m);
  if (voxels >= 1.0 && voxels <= 0x1p20) return static_cast<int>(voxels);
  throw libmap::Error("out of range", {.field = "tile_size_m",
                                       .value = libmap::to_text(scenario.tile_size_m),
                                       .bound = "1 to 2^20 voxels"});
}

int halo_voxels(const GripperMask& mask, const Scenario& scenario) {
  const int window = std::max(mask.pivot_xy, mask.side - mask.pivot_xy - 1);
  const int edges = mask.method == Method::corrected ? 2 * scan_gap_voxels : 0;
  double convexity = 0.0;
  if (scenario.curvature_radius_m > 0.0)
    convexity =
        (scenario.intersection_distance_m + curvature_reach_m(scenario)) / scenario.voxel_size_m +
        1.0 + (uses_voxel_means(scenario.method) ? mean_margin_voxels : 0.0);
  const auto require_moderate = [](double voxels, const char* field, double value) {
    if (voxels > 0x1p28)
      throw libmap::Error("too large for voxels of this size",
                          {.field = field, .value = libmap::to_text(value)});
  };
  require_moderate(convexity, "curvature_radius_m", scenario.curvature_radius_m);
  int halo = std::max(window + edges, static_cast<int>(std::ceil(convexity)));
  if (mask.closing)
    halo = std::max(halo, closing_reach_voxels(*mask.closing, scenario.voxel_size_m));
  if (!scenario.fits_normals()) return halo;
  const double radius_m = normal_radius_m(mask, scenario);
  const double normals = radius_m / scenario.voxel_size_m + 1.0;
  require_moderate(normals, "normal_radius_m", radius_m);
  halo = std::max(halo, static_cast<int>(std::ceil(normals)));
  return scenario.orientation == Orientation::surface ? std::max(halo, tilted_reach_voxels(mask))
                                                      : halo;
}

double normal_radius_m(const GripperMask& mask, const Scenario& scenario) {
  return scenario.normal_radius_m > 0.0 ? scenario.normal_radius_m : mask.palm_diameter_m;
}

MapContent content_of(const Scenario& scenario) {
  return {.normals = scenario.orientation == Orientation::surface,
          .slopes = scenario.evaluates_obstacles(),
          .terms = scenario.method == Method::calibrated,
          .falling_shares =
              scenario.method == Method::corrected && scenario.orientation != Orientation::surface};
}

TileDetectionResult detect_tiles(const TileSurroundings& surroundings, const GripperMask& mask,
                                 const std::vector<TileBounds>& tiles, CurvatureAt curvature_at,
                                 const Scenario& scenario, libmap::Progress& progress) {
  TileDetectionResult result;
  const VoxelGrid& grid = surroundings.grid;
  const std::vector<SurfaceNormal> surface =
      surface_normals(surroundings, mask, tiles, scenario, result);
  const std::vector<ScoredVoxel> scored = libmap::timed(result.timings_s, "voxel matching", [&] {
    const ScoringOptions options{.solid_voxel_threshold = scenario.solid_voxel_threshold};
    return scenario.orientation == Orientation::surface
               ? score_on_surface(pivots_of(grid, mask, tiles), surface, surroundings.surface, grid,
                                  mask, tiles, options, progress)
               : score_tiles(grid, mask, tiles, options, progress);
  });
  std::vector<std::uint8_t> convex(scored.size(), 0);
  if (scenario.curvature_radius_m > 0.0 && !scored.empty()) {
    convex = libmap::timed(result.timings_s, "convexity", [&] {
      const std::vector<Eigen::Vector3d> convex_points = find_convex_points(
          surroundings.terrain, grid.lattice, tiles, curvature_at, scenario, result);
      std::vector<Eigen::Vector3d> centers;
      centers.reserve(scored.size());
      for (const ScoredVoxel& one : scored) centers.push_back(grid.lattice.center_of(one.voxel));
      return mark_near_convex(centers, convex_points, scenario.intersection_distance_m);
    });
  }
  result.voxels = map_voxels(scored, surface, convex, grid.lattice, scenario);
  return result;
}

}  // namespace libgtd
