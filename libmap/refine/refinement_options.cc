#include <algorithm>
#include <optional>
#include <string>

#include "libmap/camera/sensor_model.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/refine/refinement_stages.h"

namespace libmap {

void bind(ParameterTable& table, RefinementOptions& options) {
  table.add("start", options.start,
            {{"auto", StartPoses::automatic},
             {"odometry", StartPoses::odometry},
             {"stored", StartPoses::stored},
             {"visual", StartPoses::visual}},
            "source of the initial poses; odometry, stored: poses of the scan; visual: images "
            "only; auto: odometry if complete, else stored poses, links or images");
  table.add("rounds", options.rounds, not_negative,
            "maximum number of rounds in which loop closures are searched for; 0: only consecutive "
            "frames are linked");
  bind(table, options.features);
  bind(table, options.odometry);
  bind(table, options.closures);
  bind(table, options.graph);
  table.add("bundle", options.bundle, "refine poses and landmarks by bundle adjustment");
  table.add("sensor", options.sensor,
            "depth camera: a name in data/sensors or a file, from which depth noise, depth range, "
            "timing and bounds of the calibration are taken unless options set them; auto: the "
            "noise is estimated");
  table.add("intrinsics", options.intrinsics,
            {{"fixed", IntrinsicsMode::fixed},
             {"refined", IntrinsicsMode::refined},
             {"auto", IntrinsicsMode::automatic}},
            "focal length and principal point; fixed: as stored; refined: estimated; auto: "
            "estimated if observations not used in the fit then agree better");
  table.add("correct_depth", options.correct_depth,
            "estimate a depth correction (function of depth and distance from the image center); "
            "used if observations not used in the fit then agree better");
  table.add(
      "register_depth", options.register_depth,
      "estimate the pose of the depth camera relative to the color camera; used if observations "
      "not used in the fit then agree better; false: displaced depth edges only cause a warning");
  table.add("estimate_timing", options.estimate_timing,
            "estimate depth delay and rolling shutter time; used if observations not used in the "
            "fit then agree better");
  table.add("scale_from", options.scale_from,
            {{"depth", ScaleSource::depth}, {"odometry", ScaleSource::odometry}},
            "source of the scale if no scale factor, known length or board is given; depth: depth "
            "images; odometry: odometry links of the scan");
  table.add("scale", options.scale, {0.5, 2.0},
            "known factor by which poses and depth are multiplied, e.g. as printed by crop "
            "--border-size; 1: no factor is known");
  bind(table, options.bundle_adjustment);
  bind(table, options.icp);
  table.add("seed", options.seed, not_negative, "random seed");
}

void require_one_scale(const RefinementOptions& options) {
  if (options.board && !options.known_lengths.empty())
    throw Error("cannot be combined with known lengths; both determine the scale",
                {.field = "board"});
  if (options.scale != 1.0 && (options.board || !options.known_lengths.empty() ||
                               options.scale_from == ScaleSource::odometry))
    throw Error("another option also determines the scale; use one of them",
                {.field = "scale",
                 .value = to_text(options.scale),
                 .bound = "1 with known lengths, a board or the scale from odometry"});
}

RefinementOptions with_sensor(RefinementOptions options) {
  if (options.sensor == "auto") return options;
  const SensorModel model = read_sensor_model(options.sensor);
  const RefinementOptions defaults;
  const auto set = [](double& field, double unset, double value) {
    if (field == unset) field = value;
  };
  apply(model, options.features.planes);
  BundleAdjustmentOptions& bundle = options.bundle_adjustment;
  const CalibrationBounds& bounds = defaults.bundle_adjustment.bounds;
  set(bundle.bounds.frame_time_s, bounds.frame_time_s, model.frame_time_s);
  set(bundle.bounds.max_depth_correction_m, bounds.max_depth_correction_m,
      model.max_depth_correction_m);
  set(bundle.bounds.max_depth_correction_of_range, bounds.max_depth_correction_of_range,
      model.max_depth_correction_of_range);
  bundle.timing_mean = {model.depth_delay_s, model.rolling_shutter_s};
  return options;
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
  table.add("poses", result.poses.size(), "number of poses");
  table.add("links", result.links.size(), "number of links between nodes");
  table.add("closures_found", result.closures.size(), "number of links found by refinement");
  table.add("parts", result.components.size(), "number of connected components of the pose graph");
  table.add("nodes_without_pose", result.without_pose.size(), "number of nodes without a pose");
  table.add("nodes_without_links", result.without_links.size(), "number of nodes without links");
  table.add("frames_skipped", result.skipped.size(),
            "number of frames that cannot be read or have no depth");
  table.add("features", result.features, "number of features of all frames");
  table.add("sensor", sensor, "findings about the sensor, such as calibration errors");
  table.add("noise", result.noise, "depth noise and its source");
  table.add("scale", result.scale, "source and uncertainty of the scale");
  table.add("rejected_stages", rejected, "number of rejected refinement stages");
  table.add("trajectory_rmse_m", rmse_m, "absolute trajectory error against true poses (RMS), m");
  table.add("trajectory_rotation_error_deg", rotation_deg,
            "mean rotation error against true poses, degrees");
}

}  // namespace libmap
