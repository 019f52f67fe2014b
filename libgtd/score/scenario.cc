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
  table.add("method", scenario.method, method_names(),
            "score; calibrated: probability that the gripper holds --load; corrected: share of the "
            "ground voxels that match the gripper mask; thesis: as the original program (2023); "
            "envelope: as thesis, only voxels that fingers reach; climblab: as ClimbLab v3");
  table.add("gripper", scenario.gripper, "gripper: scar-e, hubrobo, limbero, or a gripper file");
  table.add("voxel_size_m", scenario.voxel_size_m, positive, "edge length of the voxels, m");
  table.add("extra_void_layers", scenario.extra_void_layers, {0, 10000},
            "number of mask layers (H_add) added on top, in which ground lowers the score");
  table.add("solid_voxel_threshold", scenario.solid_voxel_threshold, {1, 2147483647},
            "number of ground voxels in the gripper mask (TSV) up to which the score is reduced");
  table.add("load_n", scenario.load_n, positive,
            "method calibrated: pull that the gripper must hold, N");
  table.add(
      "zero_plane_m", scenario.zero_plane_m, libmap::any_number,
      "minimum z of graspable voxels (terrain frame), m; auto: 0; not used by method calibrated");
  table.add("interpolation", scenario.interpolation, "fill terrain gaps by Delaunay interpolation");
  table.add("interpolation_max_edge_m", scenario.interpolation_max_edge_m, not_negative,
            "maximum edge length of an interpolated triangle in the x-y plane, m; 0: no limit");
  table.add("graspability_threshold", scenario.graspability_threshold, libmap::zero_to_one,
            "minimum score of a graspable voxel; auto: 0.8; not used by method calibrated");
  table.add("probability_threshold", scenario.probability_threshold, libmap::zero_to_one,
            "method calibrated: minimum hold probability of a graspable voxel");
  table.add("curvature_radius_m", scenario.curvature_radius_m, not_negative,
            "radius within which curvature is fitted, m; 0: convexity is not evaluated");
  table.add("intersection_distance_m", scenario.intersection_distance_m, positive,
            "distance to a convex point within which a voxel counts as convex, m");
  table.add("orientation", scenario.orientation, orientation_names(),
            "axis along which the gripper mask is placed; plane: z of the terrain frame; surface: "
            "surface normal at each voxel");
  table.add("normal_radius_m", scenario.normal_radius_m, not_negative,
            "radius within which a surface normal is fitted, m; 0: palm diameter of the gripper");
  table.add("obstacle_height_m", scenario.obstacle_height_m, not_negative,
            "height above which a steep face is an obstacle, m; 0: obstacles are not evaluated");
  table.add("obstacle_slope_deg", scenario.obstacle_slope_deg, {0.0, 180.0},
            "slope above which ground is part of a steep face, degrees; 0: no obstacles");
  table.add("tile_size_m", scenario.tile_size_m, positive, "side of the terrain's square tiles, m");
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
    throw libmap::Error("not supported by method " + name_of(method),
                        {.field = "orientation",
                         .value = "surface",
                         .bound = "plane; surface requires method corrected or climblab"});
}

}  // namespace libgtd
