// Parameters of a detection, as in a scenario file (tab. B 2-1 of the thesis).
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libgtd/gripper/gripper_mask.h"
#include "libmap/core/parameters.h"

namespace libgtd {

// Axis of the gripper mask. plane: z axis of the terrain frame. surface: surface normal at each
// voxel (thesis, 6.2), for walls.
enum class Orientation { plane, surface };
const std::vector<std::pair<std::string, Orientation>>& orientation_names();

struct Scenario {
  Method method = Method::calibrated;
  std::string gripper = "scar-e";  // name of a gripper in the toolkit, or a file
  std::vector<std::pair<std::string, std::string>> gripper_overrides;  // "gripper.KEY: VALUE"
  double voxel_size_m = 0.01;
  int extra_void_layers = 1;        // H_add: void layers on top of the gripper mask
  int solid_voxel_threshold = 120;  // TSV: the score is reduced for fewer occupied voxels (SSV)
  double load_n = 5.0;  // pull for which method calibrated predicts the hold probability, N
  // Minimum height of a target in the terrain frame; nullopt: 0. Not used by method calibrated,
  // which also predicts forces on level ground.
  std::optional<double> zero_plane_m;
  bool interpolation = false;                    // fills gaps (interpolation.h)
  double interpolation_max_edge_m = 0.0;         // maximum triangle edge in x-y; 0: no limit
  std::optional<double> graspability_threshold;  // minimum score (not calibrated); nullopt: 0.8
  double probability_threshold = 0.5;            // minimum score of method calibrated
  double curvature_radius_m = 0.09;              // radius of estimates; 0: no convexity
  double intersection_distance_m = 0.01;         // voxels this close to a convex point are convex
  Orientation orientation = Orientation::plane;
  double normal_radius_m = 0.0;  // radius of normal fits; 0: palm diameter of the gripper
  // Minimum rise of a steep face that counts as an obstacle; ground above it is unreachable. 0:
  // obstacles are not evaluated.
  double obstacle_height_m = 0.0;
  double obstacle_slope_deg = 60.0;  // minimum slope of a steep face; 0: no obstacles
  double tile_size_m = 1.0;          // width of a tile

  // Return the values for the method: minimum height of a target (terrain frame, m; -infinity for
  // calibrated), and minimum score of a graspable voxel.
  double lowest_target_m() const;
  double score_threshold() const;
  // Sets zero_plane_m and graspability_threshold to the values of these functions, for a manifest.
  void set_defaults();
  bool evaluates_obstacles() const { return obstacle_height_m > 0.0 && obstacle_slope_deg > 0.0; }
  bool fits_normals() const { return orientation == Orientation::surface || evaluates_obstacles(); }

  // Throws Error naming field, value and bound, also for orientation `surface` with the methods
  // thesis, envelope and calibrated.
  void check() const;
};

// Returns the options of the gripper mask in a scenario.
GripperMaskOptions mask_options(const Scenario& scenario);

// Binds the keys of a scenario file; "gripper.KEY" overrides a value of the gripper.
void bind(libmap::ParameterTable& table, Scenario& scenario);

}  // namespace libgtd
