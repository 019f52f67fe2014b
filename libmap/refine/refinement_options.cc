#include <algorithm>

#include "libmap/refine/refinement.h"

namespace libmap {

void bind(ParameterTable& table, RefinementOptions& options) {
  table.add("start", options.start,
            {{"auto", StartPoses::automatic},
             {"odometry", StartPoses::odometry},
             {"stored", StartPoses::stored},
             {"visual", StartPoses::visual}},
            "poses that the work starts from; visual: by the pictures alone; auto: visual where "
            "neither poses nor links are");
  table.add("rounds", options.rounds, not_negative,
            "of loop closures, each on the poses of the last, at most");
  bind(table, options.features);
  bind(table, options.odometry);
  bind(table, options.closures);
  bind(table, options.graph);
  table.add("bundle", options.bundle, "adjust poses and points together");
  table.add("intrinsics", options.intrinsics,
            {{"fixed", IntrinsicsMode::fixed},
             {"refined", IntrinsicsMode::refined},
             {"auto", IntrinsicsMode::automatic}},
            "focal length and principal point: as stored, or estimated; auto: estimated where the "
            "held-out matches fit better then");
  table.add("correct_depth", options.correct_depth,
            "estimate a correction of depth by range and radius, if what was held out fits better "
            "then");
  table.add("scale_from", options.scale_from,
            {{"depth", ScaleSource::depth}, {"odometry", ScaleSource::odometry}},
            "what determines the scale where neither a factor, lengths nor a board are known");
  table.add("scale", options.scale, {0.5, 2.0},
            "known factor of the scale, that of crop --border-size for one; 1: none is known");
  bind(table, options.bundle_adjustment);
  bind(table, options.icp);
  table.add("seed", options.seed, not_negative, "of all that is random");
}

void describe(ResultTable& table, const RefinementResult& result) {
  const auto rejected = std::count_if(result.stages.begin(), result.stages.end(),
                                      [](const StageReport& stage) { return stage.rejected; });
  std::optional<std::string> sensor;
  for (const std::string& finding : result.findings)
    sensor = sensor ? *sensor + "; " + finding : finding;
  std::optional<double> rmse_m;
  std::optional<double> rotation_deg;
  if (!result.stages.empty() && result.stages.back().error) {
    rmse_m = result.stages.back().error->absolute.rmse_m;
    rotation_deg = result.stages.back().error->absolute.mean_rotation_deg;
  }
  table.add("poses", result.poses.size(), "poses");
  table.add("links", result.links.size(), "links between poses");
  table.add("closures_found", result.closures.size(), "links that were found");
  table.add("parts", result.components.size(), "connected components of the pose graph");
  table.add("nodes_without_pose", result.without_pose.size(), "nodes without a pose");
  table.add("nodes_without_links", result.without_links.size(), "nodes without links");
  table.add("frames_skipped", result.skipped.size(), "frames without features");
  table.add("features", result.features, "features of all frames");
  table.add("sensor", sensor, "findings about the sensor");
  table.add("scale", result.scale, "source and uncertainty of the scale");
  table.add("stages_undone", rejected, "stages that were rejected");
  table.add("trajectory_rmse_m", rmse_m, "absolute error of the trajectory, of a scan with truth");
  table.add("trajectory_rotation_error_deg", rotation_deg,
            "mean rotation error of the trajectory, of a scan with truth");
}

}  // namespace libmap
