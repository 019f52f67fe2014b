#include "libgtd/score/scenario.h"

#include <limits>

#include "libmap/core/error.h"

namespace libgtd {

const std::vector<std::pair<std::string, Orientation>>& orientation_names() {
  static const std::vector<std::pair<std::string, Orientation>> names = {
      {"plane", Orientation::plane}, {"surface", Orientation::surface}};
  return names;
}

void bind(libmap::ParameterTable& table, Scenario& scenario) {
  using libmap::not_negative;
  using libmap::positive;
  table.add(
      "method", scenario.method, method_names(),
      "calibrated: the probability to hold; corrected: the shape alone; or a program before it");
  table.add("gripper", scenario.gripper, "scar-e, hubrobo, limbero, or a gripper file");
  table.add("voxel_size_m", scenario.voxel_size_m, positive, "edge of a voxel, m");
  table.add("extra_void_layers", scenario.extra_void_layers, {0, 10000},
            "void layers on top of the gripper mask (H_add), voxels");
  table.add("solid_voxel_threshold", scenario.solid_voxel_threshold, {1, 2147483647},
            "fewer solid voxels around a pivot lower its score (TSV)");
  table.add("load_n", scenario.load_n, positive,
            "pull in any direction whose hold probability method calibrated predicts, N");
  table.add(
      "zero_plane_m", scenario.zero_plane_m, libmap::any_number,
      "height in the terrain frame below which nothing is a target, m; auto: 0; not of method "
      "calibrated");
  table.add("interpolation", scenario.interpolation, "fill gaps by Delaunay interpolation");
  table.add("interpolation_max_edge_m", scenario.interpolation_max_edge_m, not_negative,
            "longest edge of a triangle that is filled, m; 0 for no limit");
  table.add("graspability_threshold", scenario.graspability_threshold, libmap::zero_to_one,
            "least score of a graspable voxel; auto: 0.8; not of method calibrated");
  table.add("probability_threshold", scenario.probability_threshold, libmap::zero_to_one,
            "least hold probability of a graspable voxel, of method calibrated");
  table.add("curvature_radius_m", scenario.curvature_radius_m, not_negative,
            "radius in which curvature is measured, m; 0: convexity is not evaluated");
  table.add("intersection_distance_m", scenario.intersection_distance_m, positive,
            "a voxel this close to a convex point counts as convex, m");
  table.add("orientation", scenario.orientation, orientation_names(),
            "plane: the mask stands upright; surface: along the surface's normal at each voxel");
  table.add("normal_radius_m", scenario.normal_radius_m, not_negative,
            "radius in which the surface's normal is fitted, m; 0: the gripper's palm diameter");
  table.add("obstacle_height_m", scenario.obstacle_height_m, not_negative,
            "steep faces that rise more than this are obstacles, m; 0: not evaluated");
  table.add("obstacle_slope_deg", scenario.obstacle_slope_deg, {0.0, 180.0},
            "slope beyond which a face is steep, degrees; 0: not evaluated");
  table.add("tile_size_m", scenario.tile_size_m, positive, "edge of a tile, m");
  table.add_overrides("gripper", scenario.gripper_overrides);
}

double Scenario::lowest_target_m() const {
  return method == Method::calibrated ? -std::numeric_limits<double>::infinity()
                                      : zero_plane_m.value_or(0.0);
}

double Scenario::score_threshold() const {
  return method == Method::calibrated ? probability_threshold
                                      : graspability_threshold.value_or(0.8);
}

void Scenario::set_defaults() {
  graspability_threshold = score_threshold();
  zero_plane_m = method == Method::calibrated ? std::nullopt : std::optional(lowest_target_m());
}

GripperMaskOptions mask_options(const Scenario& scenario) {
  return {.method = scenario.method,
          .voxel_size_m = scenario.voxel_size_m,
          .extra_void_layers = scenario.extra_void_layers,
          .load_n = scenario.load_n};
}

void Scenario::check() const {
  libmap::check_parameters(*this);
  if (orientation == Orientation::surface &&
      (method == Method::thesis || method == Method::envelope || method == Method::calibrated))
    throw libmap::Error("not with method " + name_of(method) + ", which knows no tilted mask",
                        {.field = "orientation",
                         .value = "surface",
                         .bound = "plane, or method corrected or climblab"});
}

}  // namespace libgtd
