#include "libgtd/detect.h"

#include <utility>

#include "libgtd/terrain/interpolation.h"
#include "libgtd/tile_detection.h"
#include "libmap/core/error.h"
#include "libmap/core/stage_timer.h"

namespace libgtd {

namespace {

using libmap::PointCloud;

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
    cloud = libmap::timed(result.timings_s, "thinning",
                          [&] { return thinned(input, options.scenario.voxel_size_m); });
    result.thinned_points = cloud.size();
  }
  const PlaneMethod method = thesis ? PlaneMethod::thesis : PlaneMethod::corrected;
  return libmap::timed(result.timings_s, "regression plane", [&] {
    result.plane = fit_regression_plane(cloud, {.method = method, .up = options.up});
    result.map.terrain_from_input = result.plane->terrain_from_input;
    return transform_to_terrain(cloud, *result.plane, method);
  });
}

std::vector<Eigen::Vector3d> surface_points(const PointCloud& terrain, const Scenario& scenario,
                                            DetectionResult& result) {
  if (!scenario.interpolation) return terrain.positions;
  return libmap::timed(result.timings_s, "interpolation", [&] {
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
  return libmap::timed(result.timings_s, "voxelization", [&] {
    return follows_thesis(scenario.method)
               ? voxelize_thesis(to_float(points), scenario.voxel_size_m)
               : voxelize(points, scenario.voxel_size_m);
  });
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
  TileDetectionResult detected = detect_tiles(
      in_frame, grid, result.mask, tiles,
      options.share.count == 1 ? CurvatureAt::all_points : CurvatureAt::points_near_tiles, scenario,
      progress);
  result.curvature_points = detected.curvature_points;
  result.convex_points = detected.convex_points;
  result.timings_s.insert(result.timings_s.end(), detected.timings_s.begin(),
                          detected.timings_s.end());
  result.map.voxels = std::move(detected.voxels);
  for (const MapVoxel& voxel : result.map.voxels) {
    result.graspable_voxels += voxel.graspable ? 1 : 0;
    result.edge_voxels += voxel.edge ? 1 : 0;
  }
  return result;
}

}  // namespace libgtd
