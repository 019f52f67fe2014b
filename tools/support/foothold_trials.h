// The virtual field test at the footholds of a map.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libgtd/grasp/grasp_trials.h"
#include "libgtd/score/footholds.h"
#include "libmap/core/manifest.h"
#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"
#include "tools/support/run.h"

namespace graspmap_tools {

// Fewer draws than `grasp` makes at listed locations, and the limits of all directions.
libgtd::GraspOptions foothold_grasp_options();

struct FootholdTrialsOptions {
  std::string mesh;     // of the terrain; empty: no test. Not bound
  std::string gripper;  // name or file; empty: that of the map's manifest, else scar-e
  double min_probability = 0.5;
  libgtd::GraspOptions grasp = foothold_grasp_options();
};
void bind(libmap::ParameterTable& table, FootholdTrialsOptions& options);

// Tests the footholds, leaves those in `result` that hold with min_probability, the one with the
// largest hold_probability first, of equal ones that with the largest holding_force_n, at most
// `max_count` (0: all), and returns their results in this order. Footholds that are not on the mesh
// are left out with a warning. Throws Error: mesh, gripper or map (none of it on the mesh).
std::vector<libgtd::LocationResult> test_footholds(const FootholdTrialsOptions& options,
                                                   int max_count,
                                                   const std::optional<libmap::Manifest>& manifest,
                                                   const libmap::PointCloud& map,
                                                   libgtd::FootholdResult& result, Run& run);

// Adds hold_probability, hold_low, hold_high, holding_force_n (the trials' median of what their
// weakest direction holds) and for each direction pull_away_n, pull_45_0_n, ..., pull_90_315_n
// (what nine of ten trials hold in it). Nothing without results.
void add_trial_fields(const std::vector<libgtd::LocationResult>& trials,
                      libmap::PointCloud& footholds);

}  // namespace graspmap_tools
