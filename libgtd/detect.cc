#include "libgtd/detect.h"

#include <utility>

#include "libgtd/gripper/gripper_io.h"
#include "libgtd/terrain/interpolation.h"
#include "libgtd/tile_detection.h"
#include "libmap/core/error.h"
#include "libmap/core/stage_timer.h"
#include "libmap/geometry/normal_sides.h"

namespace libgtd {

namespace {

using libmap::PointCloud;

std::vector<Eigen::Vector3f> to_float(const std::vector<Eigen::Vector3d>& points) {
  std::vector<Eigen::Vector3f> floats;
  floats.reserve(points.size());
  for (const Eigen::Vector3d& point : points) floats.push_back(point.cast<float>());
  return floats;
}

// Downsamples positions only: the author's program drops all other fields here.
PointCloud downsampled(const PointCloud& cloud, double leaf_m) {
  PointCloud thin;
  thin.viewpoint = cloud.viewpoint;
  for (const Eigen::Vector3f& centroid : voxel_centroids(to_float(cloud.positions), leaf_m))
    thin.positions.push_back(centroid.cast<double>());
  return thin;
}

// Inputs of each stage, resolved once from the options. No stage sees the scenario.
struct DetectionStages {
  int tile_voxels = 0;
  std::optional<double> downsampling_leaf_m;    // only `thesis` downsamples
  std::optional<RegressionPlaneOptions> plane;  // nullopt: the cloud is in the terrain frame
  std::optional<InterpolationOptions> interpolation;
  double voxel_size_m = 0.01;
  bool thesis_lattice = false;
  TileDetectionOptions tiles;
  std::optional<ObstacleOptions> obstacles;
  GripperMask mask;
};

std::optional<InterpolationOptions> interpolation_of(const Scenario& scenario) {
  if (!scenario.interpolation) return std::nullopt;
  // Spacing below the voxel edge, so that rounding leaves no voxel without a node.
  return InterpolationOptions{.method = follows_thesis(scenario.method)
                                            ? InterpolationMethod::thesis
                                            : InterpolationMethod::corrected,
                              .max_edge_m = scenario.interpolation_max_edge_m,
                              .max_grid_spacing_m = 0.9 * scenario.voxel_size_m};
}

DetectionStages stages_of(const DetectionOptions& options, GripperMask mask) {
  const Scenario& scenario = options.scenario;
  const bool thesis = follows_thesis(scenario.method);
  const bool fits_plane = options.plane == PlaneSource::fit;
  return {.tile_voxels = tile_voxels(scenario),
          .downsampling_leaf_m =
              thesis && fits_plane ? std::optional(scenario.voxel_size_m) : std::nullopt,
          .plane = fits_plane
                       ? std::optional(RegressionPlaneOptions{plane_method(scenario.method),
                                                              options.up, options.max_tilt_deg})
                       : std::nullopt,
          .interpolation = interpolation_of(scenario),
          .voxel_size_m = scenario.voxel_size_m,
          .thesis_lattice = thesis,
          .tiles = tile_detection_options(mask, scenario),
          // Obstacles need the whole map, because a face may cross any number of tiles.
          .obstacles = scenario.evaluates_obstacles()
                           ? std::optional(ObstacleOptions{scenario.obstacle_slope_deg,
                                                           scenario.obstacle_height_m,
                                                           normal_radius_m(mask, scenario)})
                           : std::nullopt,
          .mask = std::move(mask)};
}

// Transforms the cloud into the terrain frame.
PointCloud prepare_terrain(const PointCloud& input, const DetectionStages& stages,
                           DetectionResult& result) {
  // Normals with random sides do not indicate the outside of the surface.
  const auto with_sound_normals = [](PointCloud cloud, const RegressionPlane& plane) {
    if (plane.opposing_normals > libmap::max_opposing_fraction) cloud.normals.clear();
    return cloud;
  };
  if (!stages.plane)
    // Coincident or collinear points are not a terrain in any frame.
    return with_sound_normals(input,
                              fit_regression_plane(input, {.method = PlaneMethod::corrected}));
  PointCloud cloud = input;
  if (stages.downsampling_leaf_m) {
    cloud = libmap::timed(result.timings_s, "downsampling",
                          [&] { return downsampled(input, *stages.downsampling_leaf_m); });
    result.downsampled_points = cloud.size();
  }
  return libmap::timed(result.timings_s, "regression plane", [&] {
    result.plane = fit_regression_plane(cloud, *stages.plane);
    result.map.terrain_from_input = result.plane->terrain_from_input;
    return with_sound_normals(transform_to_terrain(cloud, *result.plane, stages.plane->method),
                              *result.plane);
  });
}

// Fills the gaps of the terrain.
PointCloud interpolated_surface(const PointCloud& terrain, const InterpolationOptions& options,
                                DetectionResult& result) {
  InterpolationResult filled = interpolate(terrain, options);
  result.grid_spacing_m = filled.grid_spacing_m;
  result.interpolated_points = filled.cloud.size();
  PointCloud surface;
  surface.positions = std::move(filled.cloud.positions);
  // The author's program continues with the grid only. We keep the measured points.
  if (options.method == InterpolationMethod::thesis) return surface;
  if (terrain.has_normals()) {
    surface.normals.assign(surface.size(), Eigen::Vector3f::Zero());
    surface.normals.insert(surface.normals.end(), terrain.normals.begin(), terrain.normals.end());
  }
  surface.positions.insert(surface.positions.end(), terrain.positions.begin(),
                           terrain.positions.end());
  return surface;
}

// Sets the obstacles of the map and returns the number of obstacle voxels.
std::size_t evaluate_obstacles(const ObstacleOptions& options, GraspabilityMap& map) {
  std::vector<Voxel> voxels;
  std::vector<float> slopes_deg;
  for (const MapVoxel& one : map.voxels) {
    voxels.push_back(one.voxel);
    slopes_deg.push_back(one.slope_deg);
  }
  const std::vector<Obstacle> obstacles =
      find_obstacles(voxels, slopes_deg, map.lattice.voxel_size_m, options);
  map.content.obstacles = true;
  std::size_t count = 0;
  for (std::size_t n = 0; n < obstacles.size(); ++n) {
    map.voxels[n].obstacle = obstacles[n];
    count += obstacles[n] == Obstacle::none ? 0 : 1;
  }
  return count;
}

}  // namespace

void bind(libmap::ParameterTable& table, DetectionOptions& options) {
  bind(table, options.scenario);
  table.add("plane", options.plane, {{"fit", PlaneSource::fit}, {"none", PlaneSource::none}},
            "terrain frame, whose z is up; fit: frame of the plane fitted to the cloud; none: "
            "frame of the cloud");
}

Gripper gripper_of(const DetectionOptions& options) {
  const Scenario& scenario = options.scenario;
  return options.gripper ? *options.gripper
                         : find_gripper(scenario.gripper, scenario.gripper_overrides);
}

DetectionResult detect(const PointCloud& terrain, const DetectionOptions& options,
                       libmap::Progress& progress) {
  options.scenario.check();
  if (terrain.empty()) throw libmap::no_elements("points of the cloud");
  const Scenario& scenario = options.scenario;
  // Rejects a voxel size that does not fit the gripper before any work.
  const DetectionStages stages =
      stages_of(options, make_gripper_mask(gripper_of(options), mask_options(scenario)));
  DetectionResult result;
  result.points = terrain.size();
  result.mask = stages.mask;
  const PointCloud in_frame = prepare_terrain(terrain, stages, result);
  PointCloud filled;
  if (stages.interpolation)
    filled = libmap::timed(result.timings_s, "interpolation", [&] {
      return interpolated_surface(in_frame, *stages.interpolation, result);
    });
  const PointCloud& surface = stages.interpolation ? filled : in_frame;
  const VoxelGrid grid = libmap::timed(result.timings_s, "voxelization", [&] {
    return stages.thesis_lattice ? voxelize_thesis(to_float(surface.positions), stages.voxel_size_m)
                                 : voxelize(surface.positions, stages.voxel_size_m);
  });
  result.occupied_voxels = grid.voxels.size();
  result.isolated_voxels = count_isolated(grid.voxels);
  // The earlier methods score any cloud, as their programs do.
  const Method method = stages.tiles.graspable.method;
  if (method == Method::corrected || method == Method::calibrated)
    require_dense(result.isolated_voxels, result.occupied_voxels, stages.voxel_size_m,
                  surface.positions);
  result.grid_min = grid.min;
  result.grid_max = grid.max;
  result.map.lattice = grid.lattice;
  result.map.zero_plane_m = stages.tiles.graspable.zero_plane_m;
  result.map.content = content_of(scenario);
  if (scenario.fits_normals()) result.normal_radius_m = normal_radius_m(result.mask, scenario);
  const std::vector<TileBounds> tiles = make_tiles(grid, stages.tile_voxels);
  result.tiles = tiles.size();
  TileDetectionResult detected = detect_tiles({in_frame, surface, grid}, stages.mask, tiles,
                                              CurvatureExtent::all_points, stages.tiles, progress);
  result.curvature_points = detected.curvature_points;
  result.convex_points = detected.convex_points;
  result.timings_s.insert(result.timings_s.end(), detected.timings_s.begin(),
                          detected.timings_s.end());
  result.map.voxels = std::move(detected.voxels);
  result.unoriented_voxels = detected.unoriented_voxels;
  if (stages.obstacles)
    result.obstacle_voxels = libmap::timed(result.timings_s, "obstacles", [&] {
      return evaluate_obstacles(*stages.obstacles, result.map);
    });
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
  table.add("lattice_origin_m", result.map.lattice.origin_m,
            "lowest corner of voxel (0, 0, 0) in the terrain frame, m");
  table.add("input_points", result.points, "number of input points");
  table.add("plane_rmse_m", result.plane ? std::optional(result.plane->rmse_m) : std::nullopt,
            "RMS distance of the points from the regression plane, m");
  table.add(
      "up_source",
      result.plane ? std::optional(std::string(to_text(result.plane->up_source))) : std::nullopt,
      "criterion that decided which side of the plane is up");
  table.add("up_normals_share", result.plane ? result.plane->normals_up : std::nullopt,
            "share of the normals that point up");
  table.add("opposing_normals",
            result.plane && result.plane->normals_up ? std::optional(result.plane->opposing_normals)
                                                     : std::nullopt,
            "share of neighboring normals that point to opposite sides of the surface");
  table.add("downsampled_points", only_if(result.downsampled_points > 0, result.downsampled_points),
            "number of points after downsampling");
  table.add("interpolated_points", only_if(has_grid, result.interpolated_points),
            "number of points after interpolation");
  table.add("interpolation_grid_m", only_if(has_grid, result.grid_spacing_m),
            "spacing of the interpolation grid, m");
  table.add("occupied_voxels", result.occupied_voxels, "number of voxels with points");
  table.add("isolated_voxels", result.isolated_voxels,
            "number of occupied voxels without an occupied neighbor");
  table.add("mask_side_voxels", result.mask.side, "side of the gripper mask, voxels");
  table.add("mask_layers", result.mask.layers, "number of layers of the gripper mask");
  table.add("tiles", result.tiles, "number of tiles that cover the terrain");
  table.add("scored_voxels", result.map.voxels.size(), "number of voxels of the map");
  table.add("border_voxels", result.border_voxels,
            "number of scored voxels at the border of the terrain");
  table.add("curvature_points", result.curvature_points,
            "number of points at which the curvature was estimated");
  table.add("convex_points", result.convex_points, "number of curvature points on convex ground");
  table.add("graspable_voxels", result.graspable_voxels, "number of graspable voxels");
  table.add("normal_radius_m", result.normal_radius_m, "radius within which normals are fitted, m");
  table.add("unoriented_voxels", only_if(result.map.content.normals, result.unoriented_voxels),
            "number of voxels without a normal, scored with an upright mask");
  table.add("obstacle_voxels", only_if(result.map.content.obstacles, result.obstacle_voxels),
            "number of voxels that are obstacles or unreachable");
}

}  // namespace libgtd
