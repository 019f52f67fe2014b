#include "libgtd/tile_detection.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "libgtd/score/closing_force.h"
#include "libgtd/score/tilted_matching.h"
#include "libgtd/score/voxel_matching.h"
#include "libgtd/shape/convexity.h"
#include "libgtd/shape/curvature.h"
#include "libmap/core/error.h"
#include "libmap/core/stage_timer.h"
#include "libmap/core/text.h"

namespace libgtd {

namespace {

using libmap::PointCloud;

// Maximum distance of points that affect the curvature at a point. PCL uses the normals of its
// neighbors, which depend on neighbors of their own.
double curvature_reach_m(const CurvatureOptions& curvature) {
  const double reach = curvature.radius_m * (1 + 1e-6);
  return curvature.method == CurvatureMethod::thesis ? 2 * reach : reach;
}

// Margin for voxel means: a voxel cut by the reach of a tile has a different mean.
constexpr double mean_margin_voxels = 2.0;

double margin_voxels(const ConvexityStage& stage) {
  return stage.average_per_voxel ? mean_margin_voxels : 0.0;
}

// Columns of the tiles, each extended by `margin_m` and one voxel.
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
    // Neighboring points are mostly in the same tile.
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
  TileBounds box_;         // bounding box of the tiles
  bool fill_box_ = false;  // the tiles cover the box
  mutable std::size_t last_ = 0;
};

std::vector<std::size_t> points_within(const PointCloud& cloud, const VoxelLattice& lattice,
                                       const std::vector<TileBounds>& tiles, double margin_m) {
  const TilesWithMargin rectangles(lattice, tiles, margin_m);
  std::vector<std::size_t> within;
  for (std::size_t n = 0; n < cloud.size(); ++n)
    if (rectangles.hold(cloud.positions[n])) within.push_back(n);
  return within;
}

// Returns the convex points among the points `queries`, or among all points.
std::vector<Eigen::Vector3d> convex_among(const PointCloud& cloud,
                                          const std::optional<std::vector<std::size_t>>& queries,
                                          const ConvexityStage& stage,
                                          TileDetectionResult& result) {
  const CurvatureResult curvature = estimate_curvature(cloud, stage.curvature, queries);
  const std::vector<Eigen::Vector3d> positions =
      queries ? libmap::select_points(cloud, *queries).positions : cloud.positions;
  const std::vector<std::uint8_t> convex =
      find_convex(curvature, positions, {.zero_plane_m = stage.zero_plane_m});
  std::vector<Eigen::Vector3d> convex_points;
  for (std::size_t n = 0; n < positions.size(); ++n)
    if (convex[n] != 0) convex_points.push_back(positions[n]);
  result.curvature_points = positions.size();
  result.convex_points = convex_points.size();
  return convex_points;
}

std::vector<Eigen::Vector3d> find_convex_points(
    const PointCloud& terrain, const VoxelLattice& lattice, const std::vector<TileBounds>& tiles,
    CurvatureExtent curvature_at, const ConvexityStage& stage, TileDetectionResult& result) {
  if (curvature_at == CurvatureExtent::all_points)
    return convex_among(
        stage.average_per_voxel ? voxel_means(terrain, lattice.voxel_size_m) : terrain,
        std::nullopt, stage, result);
  const double reach_m = stage.distance_m + curvature_reach_m(stage.curvature) +
                         margin_voxels(stage) * lattice.voxel_size_m;
  PointCloud nearby =
      libmap::select_points(terrain, points_within(terrain, lattice, tiles, reach_m));
  if (stage.average_per_voxel) nearby = voxel_means(nearby, lattice.voxel_size_m);
  return convex_among(nearby, points_within(nearby, lattice, tiles, stage.distance_m), stage,
                      result);
}

bool is_graspable(const ScoredVoxel& scored, bool convex, double height_m,
                  const GraspableRule& rule) {
  return meets_threshold(scored.counts, scored.score, rule.method, rule.solid_voxel_threshold,
                         rule.score_threshold) &&
         height_m >= rule.zero_plane_m && (convex || !rule.needs_convexity);
}

// `surface` is empty if no normals were fitted.
std::vector<MapVoxel> map_voxels(const std::vector<ScoredVoxel>& scored,
                                 const std::vector<SurfaceNormal>& surface,
                                 const std::vector<std::uint8_t>& convex,
                                 const VoxelLattice& lattice, const TileDetectionOptions& options) {
  std::vector<MapVoxel> voxels;
  voxels.reserve(scored.size());
  for (std::size_t n = 0; n < scored.size(); ++n) {
    MapVoxel voxel{.voxel = scored[n].voxel,
                   .counts = scored[n].counts,
                   .score = scored[n].score,
                   .convex = convex[n] != 0,
                   .border = scored[n].border,
                   .force = scored[n].force,
                   .outward_fall_fraction = scored[n].outward_fall_fraction};
    if (!surface.empty()) voxel.slope_deg = surface[n].slope_deg;
    if (options.tilts_mask && surface[n].normal.allFinite()) voxel.normal = surface[n].normal;
    voxel.graspable = is_graspable(scored[n], voxel.convex, lattice.center_of(voxel.voxel).z(),
                                   options.graspable);
    voxels.push_back(voxel);
  }
  return voxels;
}

// Returns 1 for each scored voxel near a convex point, else 0.
std::vector<std::uint8_t> near_convex(const std::vector<ScoredVoxel>& scored,
                                      const TileSurroundings& surroundings,
                                      const std::vector<TileBounds>& tiles,
                                      CurvatureExtent curvature_at, const ConvexityStage& stage,
                                      TileDetectionResult& result) {
  const VoxelLattice& lattice = surroundings.grid.lattice;
  const std::vector<Eigen::Vector3d> convex_points =
      find_convex_points(surroundings.terrain, lattice, tiles, curvature_at, stage, result);
  std::vector<Eigen::Vector3d> centers;
  centers.reserve(scored.size());
  for (const ScoredVoxel& one : scored) centers.push_back(lattice.center_of(one.voxel));
  return mark_near_convex(centers, convex_points, stage.distance_m);
}

std::optional<ConvexityStage> convexity_of(const Scenario& scenario) {
  if (!(scenario.curvature_radius_m > 0.0)) return std::nullopt;
  return ConvexityStage{
      .curvature = {.method = follows_thesis(scenario.method) ? CurvatureMethod::thesis
                                                              : CurvatureMethod::corrected,
                    .radius_m = scenario.curvature_radius_m},
      .average_per_voxel = plane_method(scenario.method) == PlaneMethod::robust,
      .zero_plane_m = scenario.lowest_target_m(),
      .distance_m = scenario.intersection_distance_m};
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
                                       .bound = "1 to 2^20 times voxel_size_m"});
}

int halo_voxels(const GripperMask& mask, const Scenario& scenario) {
  const TileDetectionOptions options = tile_detection_options(mask, scenario);
  const double voxel_size_m = scenario.voxel_size_m;
  const auto whole = [](double voxels, const char* field, double value) {
    if (voxels > 0x1p28)
      throw libmap::Error("too large for this voxel size",
                          {.field = field, .value = libmap::to_text(value)});
    return static_cast<int>(std::ceil(voxels));
  };
  const int window = std::max(mask.pivot_xy, mask.side - mask.pivot_xy - 1);
  int halo = window + (mask.method == Method::corrected ? 2 * scan_gap_voxels : 0);
  if (const auto& stage = options.convexity)
    halo = std::max(
        halo, whole((stage->distance_m + curvature_reach_m(stage->curvature)) / voxel_size_m + 1.0 +
                        margin_voxels(*stage),
                    "curvature_radius_m", stage->curvature.radius_m));
  if (mask.closing) halo = std::max(halo, closing_reach_voxels(*mask.closing, voxel_size_m));
  if (const auto& radius_m = options.normal_radius_m)
    halo = std::max(halo, whole(*radius_m / voxel_size_m + 1.0, "normal_radius_m", *radius_m));
  return options.tilts_mask ? std::max(halo, tilted_reach_voxels(mask)) : halo;
}

double normal_radius_m(const GripperMask& mask, const Scenario& scenario) {
  return scenario.normal_radius_m > 0.0 ? scenario.normal_radius_m : mask.palm_diameter_m;
}

MapContent content_of(const Scenario& scenario) {
  return {.normals = scenario.orientation == Orientation::surface,
          .slopes = scenario.evaluates_obstacles(),
          .forces = scenario.method == Method::calibrated,
          .outward_fall_fractions =
              scenario.method == Method::corrected && scenario.orientation != Orientation::surface};
}

TileDetectionOptions tile_detection_options(const GripperMask& mask, const Scenario& scenario) {
  return {.tilts_mask = scenario.orientation == Orientation::surface,
          .normal_radius_m = scenario.fits_normals()
                                 ? std::optional(normal_radius_m(mask, scenario))
                                 : std::nullopt,
          .convexity = convexity_of(scenario),
          .graspable = {.method = scenario.method,
                        .solid_voxel_threshold = scenario.solid_voxel_threshold,
                        .score_threshold = scenario.score_threshold(),
                        .zero_plane_m = scenario.lowest_target_m(),
                        // The hold probability includes the shape already.
                        .needs_convexity = scenario.curvature_radius_m > 0.0 &&
                                           scenario.method != Method::calibrated}};
}

TileDetectionResult detect_tiles(const TileSurroundings& surroundings, const GripperMask& mask,
                                 const std::vector<TileBounds>& tiles, CurvatureExtent curvature_at,
                                 const TileDetectionOptions& options, libmap::Progress& progress) {
  TileDetectionResult result;
  const VoxelGrid& grid = surroundings.grid;
  std::vector<Voxel> pivots;
  std::vector<SurfaceNormal> normals;
  if (options.normal_radius_m)
    normals = libmap::timed(result.timings_s, "surface normals", [&] {
      pivots = pivots_of(grid, mask, tiles);
      return normals_at(pivots, surroundings.surface, grid.lattice, *options.normal_radius_m);
    });
  if (options.tilts_mask)
    result.unoriented_voxels = static_cast<std::size_t>(
        std::count_if(normals.begin(), normals.end(),
                      [](const SurfaceNormal& one) { return !one.normal.allFinite(); }));
  const std::vector<ScoredVoxel> scored = libmap::timed(result.timings_s, "voxel matching", [&] {
    const ScoringOptions scoring{.solid_voxel_threshold = options.graspable.solid_voxel_threshold};
    return options.tilts_mask ? score_on_surface(pivots, normals, surroundings.surface, grid, mask,
                                                 tiles, scoring, progress)
                              : score_tiles(grid, mask, tiles, scoring, progress);
  });
  std::vector<std::uint8_t> convex(scored.size(), 0);
  if (options.convexity && !scored.empty())
    convex = libmap::timed(result.timings_s, "convexity", [&] {
      return near_convex(scored, surroundings, tiles, curvature_at, *options.convexity, result);
    });
  result.voxels = map_voxels(scored, normals, convex, grid.lattice, options);
  return result;
}

}  // namespace libgtd
