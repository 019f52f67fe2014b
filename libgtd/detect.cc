#include "libgtd/detect.h"

#include <utility>

#include "libgtd/gripper/gripper_io.h"
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

// Positions alone: the program's downsampling drops all else that it does not use later.
PointCloud downsampled(const PointCloud& cloud, double leaf_m) {
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
    fit_regression_plane(input, {.method = PlaneMethod::corrected});
    return input;
  }
  const bool thesis = follows_thesis(options.scenario.method);
  PointCloud cloud = input;
  if (thesis) {
    cloud = libmap::timed(result.timings_s, "downsampling",
                          [&] { return downsampled(input, options.scenario.voxel_size_m); });
    result.downsampled_points = cloud.size();
  }
  const PlaneMethod method = plane_method(options.scenario.method);
  return libmap::timed(result.timings_s, "regression plane", [&] {
    result.plane = fit_regression_plane(cloud, {.method = method, .up = options.up});
    result.map.terrain_from_input = result.plane->terrain_from_input;
    return transform_to_terrain(cloud, *result.plane, method);
  });
}

// The terrain with its gaps filled.
PointCloud interpolated_surface(const PointCloud& terrain, const Scenario& scenario,
                                DetectionResult& result) {
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
    PointCloud surface;
    surface.positions = std::move(filled.cloud.positions);
    // The author's program goes on with the grid alone; measured points are worth keeping.
    if (follows_thesis(scenario.method)) return surface;
    if (terrain.has_normals()) {
      surface.normals.assign(surface.size(), Eigen::Vector3f::Zero());
      surface.normals.insert(surface.normals.end(), terrain.normals.begin(), terrain.normals.end());
    }
    surface.positions.insert(surface.positions.end(), terrain.positions.begin(),
                             terrain.positions.end());
    return surface;
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

void evaluate_obstacles(const Scenario& scenario, DetectionResult& result) {
  std::vector<Voxel> voxels;
  std::vector<float> slopes_deg;
  for (const MapVoxel& one : result.map.voxels) {
    voxels.push_back(one.voxel);
    slopes_deg.push_back(one.slope_deg);
  }
  const std::vector<Obstacle> obstacles =
      find_obstacles(voxels, slopes_deg, scenario.voxel_size_m,
                     {.slope_deg = scenario.obstacle_slope_deg,
                      .height_m = scenario.obstacle_height_m,
                      .normal_radius_m = normal_radius_m(result.mask, scenario)});
  for (std::size_t n = 0; n < obstacles.size(); ++n) {
    result.map.voxels[n].obstacle = obstacles[n];
    result.obstacle_voxels += obstacles[n] == Obstacle::none ? 0 : 1;
  }
  result.map.content.obstacles = true;
}

}  // namespace

const std::vector<std::pair<std::string, PlaneSource>>& plane_source_names() {
  static const std::vector<std::pair<std::string, PlaneSource>> names = {
      {"fit", PlaneSource::fit}, {"none", PlaneSource::none}};
  return names;
}

void bind(libmap::ParameterTable& table, DetectionOptions& options) {
  bind(table, options.scenario);
  table.add("plane", options.plane, plane_source_names(),
            "fit: regression plane; none: the cloud is already in the terrain frame");
}

Gripper gripper_of(const DetectionOptions& options) {
  const Scenario& scenario = options.scenario;
  return options.gripper ? *options.gripper
                         : find_gripper(scenario.gripper, scenario.gripper_overrides);
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
      gripper_of(options), {scenario.method, scenario.voxel_size_m, scenario.extra_void_layers});
  const int voxels_a_tile = tile_voxels(scenario);
  const PointCloud in_frame = prepare_terrain(terrain, options, result);
  const PointCloud filled =
      scenario.interpolation ? interpolated_surface(in_frame, scenario, result) : PointCloud{};
  const PointCloud& surface = scenario.interpolation ? filled : in_frame;
  const VoxelGrid grid = make_grid(surface.positions, scenario, result);
  result.occupied_voxels = grid.voxels.size();
  result.grid_min = grid.min;
  result.grid_max = grid.max;
  result.map.lattice = grid.lattice;
  result.map.zero_plane_m = scenario.zero_plane_m;
  const std::vector<TileBounds> tiles = share_of(make_tiles(grid, voxels_a_tile), options.share);
  result.tiles = tiles.size();
  TileDetectionResult detected = detect_tiles(
      {in_frame, surface, grid}, result.mask, tiles,
      options.share.count == 1 ? CurvatureAt::all_points : CurvatureAt::points_near_tiles, scenario,
      progress);
  result.curvature_points = detected.curvature_points;
  result.convex_points = detected.convex_points;
  result.timings_s.insert(result.timings_s.end(), detected.timings_s.begin(),
                          detected.timings_s.end());
  result.map.voxels = std::move(detected.voxels);
  result.unoriented_voxels = detected.unoriented_voxels;
  result.map.content = content_of(scenario);
  if (scenario.fits_normals()) result.normal_radius_m = normal_radius_m(result.mask, scenario);
  if (scenario.evaluates_obstacles() && options.share.count == 1)
    libmap::timed(result.timings_s, "obstacles", [&] { evaluate_obstacles(scenario, result); });
  for (const MapVoxel& voxel : result.map.voxels) {
    result.graspable_voxels += voxel.graspable ? 1 : 0;
    result.border_voxels += voxel.border ? 1 : 0;
  }
  return result;
}

void describe(libmap::ResultTable& table, const DetectionResult& result) {
  const auto only_if = [](bool is_there, const auto& value) {
    return is_there ? std::optional(value) : std::nullopt;
  };
  const bool has_grid = result.grid_spacing_m > 0.0;
  table.add("lattice_origin_m", result.map.lattice.origin_m, "corner of voxel (0, 0, 0)");
  table.add("input_points", result.points, "points of the terrain");
  table.add("plane_rmse_m", result.plane ? std::optional(result.plane->rmse_m) : std::nullopt,
            "root mean square distance of the points from the regression plane");
  table.add(
      "up_source",
      result.plane ? std::optional(std::string(to_text(result.plane->up_source))) : std::nullopt,
      "what determined which side of the plane is up");
  table.add("downsampled_points", only_if(result.downsampled_points > 0, result.downsampled_points),
            "points after downsampling");
  table.add("interpolated_points", only_if(has_grid, result.interpolated_points),
            "points after interpolation");
  table.add("interpolation_grid_m", only_if(has_grid, result.grid_spacing_m),
            "spacing of the grid of interpolation");
  table.add("occupied_voxels", result.occupied_voxels, "voxels with points");
  table.add("mask_side_voxels", result.mask.side, "side of the gripper mask");
  table.add("mask_layers", result.mask.layers, "layers of the gripper mask");
  table.add("tiles", result.tiles, "tiles that were scored");
  table.add("scored_voxels", result.map.voxels.size(), "voxels of the map");
  table.add("border_voxels", result.border_voxels, "scored voxels at the border of the terrain");
  table.add("curvature_points", result.curvature_points, "points with a curvature");
  table.add("convex_points", result.convex_points, "points on convex ground");
  table.add("graspable_voxels", result.graspable_voxels, "scored voxels that can be grasped");
  table.add("normal_radius_m", result.normal_radius_m, "radius of the fit of normals");
  table.add("unoriented_voxels", only_if(result.map.content.normals, result.unoriented_voxels),
            "voxels without a normal, scored upright");
  table.add("obstacle_voxels", only_if(result.map.content.obstacles, result.obstacle_voxels),
            "voxels that are obstacles");
}

}  // namespace libgtd
