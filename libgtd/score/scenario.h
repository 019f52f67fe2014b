// One set of parameters of a detection, as a scenario file gives it (tab. B 2-1 of the thesis).
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libgtd/gripper/gripper_mask.h"
#include "libmap/core/parameters.h"

namespace libgtd {

// Which way the gripper mask stands: along the terrain frame's z axis everywhere, or along the
// normal of the surface at each voxel (thesis, 6.2), so that walls are evaluated as walls.
enum class Orientation { plane, surface };
const std::vector<std::pair<std::string, Orientation>>& orientation_names();

struct Scenario {
  Method method = Method::calibrated;
  std::string gripper = "scar-e";  // name of a gripper of the toolkit, or a file
  std::vector<std::pair<std::string, std::string>> gripper_overrides;  // "gripper.KEY: VALUE"
  double voxel_size_m = 0.01;
  int extra_void_layers = 1;        // H_add
  int solid_voxel_threshold = 120;  // TSV
  double load_n = 5.0;              // of method calibrated: the pull whose hold probability counts
  // Height in the terrain frame; ground below it is no target. Nothing: 0. Not of method
  // calibrated, which has a force for level ground too.
  std::optional<double> zero_plane_m;
  bool interpolation = false;
  double interpolation_max_edge_m = 0.0;         // 0: no limit
  std::optional<double> graspability_threshold;  // nothing: 0.8; not of method calibrated
  double probability_threshold = 0.5;            // of method calibrated
  double curvature_radius_m = 0.09;              // 0: convexity is not evaluated
  double intersection_distance_m = 0.01;
  Orientation orientation = Orientation::plane;
  double normal_radius_m = 0.0;  // of the surface's normals; 0: the gripper's palm diameter
  // A steep face that rises more than this, and what stands on it out of reach, is an obstacle; 0:
  // not evaluated.
  double obstacle_height_m = 0.0;
  double obstacle_slope_deg = 60.0;  // steeper than this is steep; 0: not evaluated
  double tile_size_m = 1.0;

  // The zero plane (m, -infinity with method calibrated) and the least score of a graspable voxel
  // that the method uses.
  double lowest_target_m() const;
  double score_threshold() const;
  // Sets zero plane and threshold to those that the method uses, so that a manifest states them.
  void set_defaults();
  bool evaluates_obstacles() const { return obstacle_height_m > 0.0 && obstacle_slope_deg > 0.0; }
  bool fits_normals() const { return orientation == Orientation::surface || evaluates_obstacles(); }

  // Throws Error naming the field, its value and its bound; `orientation` surface with a method
  // that prepares the cloud as the author's program does, on a lattice of its own.
  void check() const;
};

// The options of the gripper mask in a scenario.
GripperMaskOptions mask_options(const Scenario& scenario);

// The keys of a scenario file, bound to `scenario`; "gripper.KEY" overrides a gripper's measure.
void bind(libmap::ParameterTable& table, Scenario& scenario);

}  // namespace libgtd
