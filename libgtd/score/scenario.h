// One set of parameters of a detection, as a scenario file gives it (tab. B 2-1 of the thesis).
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "libgtd/gripper/gripper_mask.h"
#include "libmap/core/parameters.h"

namespace libgtd {

struct Scenario {
  Method method = Method::corrected;
  std::string gripper = "scar-e";  // name of a gripper of the toolkit, or a file
  std::vector<std::pair<std::string, std::string>> gripper_overrides;  // "gripper.KEY: VALUE"
  double voxel_size_m = 0.01;
  int extra_void_layers = 1;        // H_add
  int solid_voxel_threshold = 120;  // TSV
  double zero_plane_m = 0.0;        // height in the terrain frame; what lies below is no target
  bool interpolation = false;
  double interpolation_max_edge_m = 0.0;  // 0: no limit
  double graspability_threshold = 0.8;
  double curvature_radius_m = 0.09;  // 0: convexity is not judged
  double intersection_distance_m = 0.01;
  double tile_size_m = 1.0;

  // Throws Error naming the field, its value and its bound.
  void check() const;
};

// The keys of a scenario file, bound to `scenario`; "gripper.KEY" overrides a gripper's measure.
void bind(libmap::ParameterTable& table, Scenario& scenario);

}  // namespace libgtd
