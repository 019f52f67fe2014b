#include "libgtd/detect.h"

#include <chrono>
#include <cmath>

#include "libgtd/score/scoring.h"
#include "libgtd/shape/convexity.h"
#include "libgtd/shape/curvature.h"
#include "libgtd/terrain/interpolation.h"
#include "libmap/core/error.h"

namespace libgtd {

namespace {

using libmap::PointCloud;

// The author's program and its two siblings share its preparation of the cloud.
bool follows_thesis(Method method) {
  return method == Method::thesis || method == Method::envelope;
}

// Runs `step` and keeps its wall time under `name`.
template <typename Step>
auto timed(DetectionResult& result, const char* name, const Step& step) {
  const auto start = std::chrono::steady_clock::now();
  auto value = step();
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
  result.timings_s.emplace_back(name, taken.count());
  return value;
}

std::vector<Eigen::Vector3f> to_float(const std::vector<Eigen::Vector3d>& points) {
  std::vector<Eigen::Vector3f> floats;
  floats.reserve(points.size());
  for (const Eigen::Vector3d& point : points) floats.push_back(point.cast<float>());
  return floats;
}

// Positions alone: the program's thinning drops all else that it does not use later.
PointCloud thinned(const PointCloud& cloud, double leaf_m) {
  PointCloud thin;
  thin.viewpoint = cloud.viewpoint;
  for (const Eigen::Vector3f& centroid : thin_to_centroids(to_float(cloud.positions), leaf_m))
    thin.positions.push_back(centroid.cast<double>());
  return thin;
}

// The terrain in the terrain frame.
PointCloud prepare_terrain(const PointCloud& input, const DetectionOptions& options,
                           DetectionResult& result) {
  if (options.plane == PlaneSource::none) {
    // No use is made of it, but points in one place or on a line are no terrain in any frame.
    fit_regression_plane(input);
    return input;
  }
  const bool thesis = follows_thesis(options.scenario.method);
  PointCloud cloud = input;
  if (thesis) {
    cloud =
        timed(result, "thinning", [&] { return thinned(input, options.scenario.voxel_size_m); });
    result.thinned_points = cloud.size();
  }
  const PlaneMethod method = thesis ? PlaneMethod::thesis : PlaneMethod::corrected;
  return timed(result, "regression plane", [&] {
    result.plane = fit_regression_plane(cloud, {.method = method, .up = options.up});
    result.map.terrain_from_input = result.plane->terrain_from_input;
    return transform_to_terrain(cloud, *result.plane, method);
  });
}

std::vector<Eigen::Vector3d> surface_points(const PointCloud& terrain, const Scenario& scenario,
                                            DetectionResult& result) {
  if (!scenario.interpolation) return terrain.positions;
  return timed(result, "interpolation", [&] {
    InterpolationOptions options;
    options.method = follows_thesis(scenario.method) ? InterpolationMethod::thesis
                                                     : InterpolationMethod::corrected;
    options.max_edge_m = scenario.interpolation_max_edge_m;
    // A node in each voxel: below its edge, so that rounding leaves none out.
    options.max_grid_spacing_m = 0.9 * scenario.voxel_size_m;
    InterpolationResult filled = interpolate(terrain, options);
    result.grid_spacing_m = filled.grid_spacing_m;
    result.interpolated_points = filled.cloud.size();
    // The author's program goes on with the grid alone; measured points are worth keeping.
    if (!follows_thesis(scenario.method))
      filled.cloud.positions.insert(filled.cloud.positions.end(), terrain.positions.begin(),
                                    terrain.positions.end());
    return std::move(filled.cloud.positions);
  });
}

VoxelGrid make_grid(const std::vector<Eigen::Vector3d>& points, const Scenario& scenario,
                    DetectionResult& result) {
  return timed(result, "voxelization", [&] {
    return follows_thesis(scenario.method)
               ? voxelize_thesis(to_float(points), scenario.voxel_size_m)
               : voxelize(points, scenario.voxel_size_m);
  });
}

// The points whose convexity matters for the scored voxels: those that lie near a tile.
std::vector<std::size_t> points_near_tiles(const PointCloud& terrain, const VoxelLattice& lattice,
                                           const std::vector<TileBounds>& tiles, double margin_m) {
  std::vector<std::size_t> near;
  for (std::size_t n = 0; n < terrain.size(); ++n) {
    const Eigen::Vector3d cell = lattice.cell_of(terrain.positions[n]);
    const double margin = margin_m / lattice.voxel_size_m + 1.0;
    for (const TileBounds& tile : tiles)
      if (cell.x() >= tile.i_begin - margin && cell.x() <= tile.i_end + margin &&
          cell.y() >= tile.j_begin - margin && cell.y() <= tile.j_end + margin) {
        near.push_back(n);
        break;
      }
  }
  return near;
}

std::vector<Eigen::Vector3d> find_convex_points(const PointCloud& terrain,
                                                const std::vector<TileBounds>& tiles,
                                                bool all_tiles, const Scenario& scenario,
                                                DetectionResult& result) {
  const CurvatureMethod method =
      follows_thesis(scenario.method) ? CurvatureMethod::thesis : CurvatureMethod::corrected;
  std::optional<std::vector<std::size_t>> queries;
  std::vector<Eigen::Vector3d> positions = terrain.positions;
  if (!all_tiles) {
    queries =
        points_near_tiles(terrain, result.map.lattice, tiles, scenario.intersection_distance_m);
    positions.clear();
    for (const std::size_t n : *queries) positions.push_back(terrain.positions[n]);
  }
  const CurvatureResult curvature = estimate_curvature(
      terrain, {.method = method, .radius_m = scenario.curvature_radius_m}, queries);
  ConvexityOptions convexity;
  convexity.zero_plane_m = scenario.zero_plane_m;
  const std::vector<std::uint8_t> convex = find_convex(curvature, positions, convexity);
  std::vector<Eigen::Vector3d> convex_points;
  for (std::size_t n = 0; n < positions.size(); ++n)
    if (convex[n] != 0) convex_points.push_back(positions[n]);
  result.curvature_points = positions.size();
  result.convex_points = convex_points.size();
  return convex_points;
}

void fill_map(const std::vector<ScoredVoxel>& scored, const std::vector<std::uint8_t>& convex,
              const Scenario& scenario, DetectionResult& result) {
  const bool judge_convexity = scenario.curvature_radius_m > 0.0;
  for (std::size_t n = 0; n < scored.size(); ++n) {
    MapVoxel voxel{.voxel = scored[n].voxel,
                   .counts = scored[n].counts,
                   .score = scored[n].score,
                   .convex = convex[n] != 0,
                   .graspable = false,
                   .edge = scored[n].edge};
    const double height = result.map.lattice.center_of(voxel.voxel).z();
    voxel.graspable =
        meets_threshold(voxel.counts, voxel.score, scenario.method, scenario.solid_voxel_threshold,
                        scenario.graspability_threshold) &&
        height >= scenario.zero_plane_m && (voxel.convex || !judge_convexity);
    result.graspable_voxels += voxel.graspable ? 1 : 0;
    result.edge_voxels += voxel.edge ? 1 : 0;
    result.map.voxels.push_back(voxel);
  }
}

int tile_voxels(const Scenario& scenario) {
  const double voxels = std::round(scenario.tile_size_m / scenario.voxel_size_m);
  if (voxels >= 1.0 && voxels <= 0x1p20) return static_cast<int>(voxels);
  throw libmap::Error("out of range", {.field = "tile_size_m",
                                       .value = libmap::to_text(scenario.tile_size_m),
                                       .bound = "1 to 2^20 voxels"});
}

}  // namespace

const std::vector<std::pair<std::string, PlaneSource>>& plane_source_names() {
  static const std::vector<std::pair<std::string, PlaneSource>> names = {
      {"fit", PlaneSource::fit}, {"none", PlaneSource::none}};
  return names;
}

DetectionResult detect(const PointCloud& terrain, const DetectionOptions& options,
                       libmap::Progress& progress) {
  const Scenario& scenario = options.scenario;
  scenario.check();
  if (terrain.empty()) throw libmap::Error("the cloud has no points");
  DetectionResult result;
  result.points = terrain.size();
  // Before any work: a voxel size that does not suit the gripper shows here.
  result.mask = make_gripper_mask(
      options.gripper, {scenario.method, scenario.voxel_size_m, scenario.extra_void_layers});
  const int voxels_a_tile = tile_voxels(scenario);
  const PointCloud in_frame = prepare_terrain(terrain, options, result);
  const VoxelGrid grid = make_grid(surface_points(in_frame, scenario, result), scenario, result);
  result.occupied_voxels = grid.voxels.size();
  result.grid_min = grid.min;
  result.grid_max = grid.max;
  result.map.lattice = grid.lattice;
  result.map.zero_plane_m = scenario.zero_plane_m;
  const std::vector<TileBounds> tiles = share_of(make_tiles(grid, voxels_a_tile), options.share);
  result.tiles = tiles.size();
  const std::vector<ScoredVoxel> scored = timed(result, "voxel matching", [&] {
    return score_tiles(grid, result.mask, tiles,
                       {.solid_voxel_threshold = scenario.solid_voxel_threshold}, progress);
  });
  std::vector<std::uint8_t> convex(scored.size(), 0);
  if (scenario.curvature_radius_m > 0.0 && !scored.empty()) {
    convex = timed(result, "convexity", [&] {
      const std::vector<Eigen::Vector3d> convex_points =
          find_convex_points(in_frame, tiles, options.share.count == 1, scenario, result);
      std::vector<Eigen::Vector3d> centers;
      for (const ScoredVoxel& one : scored) centers.push_back(grid.lattice.center_of(one.voxel));
      return mark_near_convex(centers, convex_points, scenario.intersection_distance_m);
    });
  }
  fill_map(scored, convex, scenario, result);
  return result;
}

}  // namespace libgtd
