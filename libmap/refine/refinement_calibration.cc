#include <algorithm>
#include <cmath>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/optimize/graph_covariance.h"
#include "libmap/optimize/sparse_adjustment.h"
#include "libmap/refine/refinement_stages.h"

namespace libmap {

namespace {

constexpr std::size_t max_alternatives = 10;
constexpr double min_rematched_fraction = 0.9;  // minimum share of linked pairs that match again
// Factors of the calibration's standard deviations, measured on simulated scans. They are above 1
// because matches are selected with the uncorrected camera and errors outside the model are
// correlated between frames. With timing, motions also change within a frame.
constexpr double calibration_deviation_scale = 1.1;
constexpr double timing_deviation_scale = 1.4;
// Factor of the reported deviations of delays and rolling shutter: errors of features are
// correlated within a frame, and all motions have a common factor. Measured on the thirds of a real
// sequence.
constexpr double stated_timing_scale = 5.0;
// Deviation of a delay relative to arrival stamps, whose errors exceed their jitter. Measured on
// that sequence.
constexpr double stamp_deviation_s = 0.003;
// Additional deviation of a registration's shift along the optical axis, which is hardly
// distinguished from a scale. Measured on simulated scans.
constexpr double axial_deviation_m = 4e-4;

void add_figures(const CalibrationEstimate& estimate, StageReport& report) {
  const auto add = [&](const std::string& name, double value) {
    report.metrics.emplace_back(name, value);
  };
  add("frames", static_cast<double>(estimate.frames));
  for (const auto& [name, change] : estimate.evaluated_models) {
    add(name + "_matches", change.matches.after);
    add(name + "_surfaces", change.surfaces.after);
  }
  const SensorCalibration& found = estimate.calibration;
  for (std::size_t n = 0; n < found.intrinsics.size(); ++n) {
    const std::string camera = "camera_" + std::to_string(n) + "_";
    add(camera + "fx_share", found.intrinsics[n].fx_relative);
    add(camera + "fy_share", found.intrinsics[n].fy_relative);
    add(camera + "cx_px", found.intrinsics[n].cx_px);
    add(camera + "cy_px", found.intrinsics[n].cy_px);
  }
  for (const auto& [model, reason] : estimate.impossible)
    report.warnings.push_back("calibration " + model + " was not accepted: " + reason);
  for (std::size_t n = 0; n < found.timing.size(); ++n) {
    const std::string camera = "camera_" + std::to_string(n) + "_";
    add(camera + "depth_delay_s", found.timing[n].depth_delay_s);
    add(camera + "rolling_shutter_s", found.timing[n].rolling_shutter_s);
  }
}

// The stored camera is kept unless the held-out data fit another one clearly better. For example,
// RTAB-Map's downsampling shifts images by a fraction of a pixel.
CalibrationChoice choice_of(const RefinementInput& input, const SensorCalibration& known) {
  const RefinementOptions& options = input.options;
  CalibrationChoice choice;
  choice.keeps_registration = !input.color_from_depth.matrix().isIdentity();
  choice.only_if_better = options.intrinsics != IntrinsicsMode::refined;
  choice.converge = !known.empty();  // the first calibration only initializes the next
  choice.start = known;
  if (known.empty()) {
    choice.parts = {options.intrinsics != IntrinsicsMode::fixed, options.correct_depth,
                    options.register_depth, options.estimate_timing};
  } else {
    choice.parts = parts_of(known);
    choice.drop_unneeded = choice.parts.timing;
  }
  return choice;
}

// Standard deviation of the scale from the steps of the poses with the calibration.
double scale_deviation(const std::map<int, Pose>& poses, const CalibrationMoves& moves_of) {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  for (const auto& [node, moves] : moves_of) center += poses.at(node).translation();
  center /= static_cast<double>(std::max<std::size_t>(1, moves_of.size()));
  std::vector<double> growth;
  double squares = 0.0;
  for (const auto& [node, moves] : moves_of) {
    const Pose& pose = poses.at(node);
    const Eigen::Vector3d arm = pose.translation() - center;
    squares += arm.squaredNorm();
    growth.resize(moves.size());
    for (std::size_t n = 0; n < moves.size(); ++n)
      growth[n] += arm.dot(pose.linear() * moves[n].head<3>());
  }
  double variance = 0.0;
  for (const double of_one : growth) variance += of_one * of_one;
  return squares > 0.0 ? std::sqrt(variance) / squares : 0.0;
}

std::optional<ScaleEstimate> odometry_scale(const RefinementInput& input,
                                            const RefinementState& state) {
  std::vector<GraphLinkResult> links;
  if (!input.scan.graph().links.empty()) links = state.results_of_other_links();
  std::erase_if(links, [&](const GraphLinkResult& link) {  // links from depth
    return input.odometry_nodes.contains(link.link.from) ||
           input.odometry_nodes.contains(link.link.to);
  });
  return scale_by_odometry(links, state.poses);
}

// Scales positions, depth and feature links.
void scale_state(double factor, RefinementState& state) {
  const std::vector<GraphComponent>& components = state.graph.components;
  const int fixed = components.empty() ? state.poses.begin()->first : components.front().gauge_node;
  const std::size_t cameras = state.frames->empty() ? 1 : state.frames->front().cameras.size();
  apply_scale(factor, fixed, cameras, state.poses, state.calibration);
  for (std::size_t n = state.other_links.size(); n < state.graph.links.size(); ++n)
    state.graph.links[n].link.from_from_to.translation() *= factor;
}

}  // namespace

CalibrationInput calibration_input(const RefinementInput& input, const RefinementState& state,
                                   const std::vector<GraphLinkResult>& other_links) {
  CalibrationInput data{
      *state.stored_frames, state.feature_links,    state.poses,
      other_links,          state.graph.components, input.options.bundle_adjustment};
  data.options.depth_noise = state.noise;
  return data;
}

SharedFrames calibrated(const std::vector<FrameFeatures>& stored,
                        const SensorCalibration& calibration) {
  auto frames = std::make_shared<std::vector<FrameFeatures>>(stored);
  for (FrameFeatures& frame : *frames) calibrate(frame, calibration);
  return frames;
}

StageResult calibrate_stage(const RefinementInput& input, const RefinementState& state) {
  const std::vector<GraphLinkResult> others = state.results_of_other_links();
  const CalibrationInput data = calibration_input(input, state, others);
  CalibrationEstimate estimate = estimate_calibration(data, choice_of(input, state.calibration));
  StageResult result{.state = state};
  RefinementState& next = result.state;
  add_figures(estimate, result.report);
  const bool is_of_all = estimate.frames == data.frames.size();
  result.report.rejected = estimate.calibration.empty();
  result.is_validated = is_of_all || result.report.rejected;
  result.report.held_out = estimate.held_out;
  next.poses = std::move(estimate.adjustment.map_from_base);
  if (result.report.rejected) return result;
  if (!is_of_all && !estimate.calibration.timing.empty())
    estimate_motions(data, false, estimate.calibration, state.calibration);
  next.calibration = std::move(estimate.calibration);
  next.frames = calibrated(data.frames, next.calibration);
  if (!is_of_all) {
    BundleAdjustmentOptions options = data.options;
    options.with_information = false;
    next.poses =
        adjust_bundle(*next.frames, data.links, state.poses, others, data.components, options)
            .map_from_base;
  }
  return result;
}

std::vector<FeatureLink> rematched_links(const RefinementInput& input,
                                         const RefinementState& state) {
  std::vector<FramePair> pairs;
  std::map<FramePair, LinkType> types;
  for (const FeatureLink& link : state.feature_links)
    if (types.emplace(link.frames, link.link.type).second) pairs.push_back(link.frames);
  PairVerification verified = verify_pairs(*state.frames, pairs, input.options.closures,
                                           input.options.seed, input.progress, input.known_matches);
  if (verified.links.size() <
      static_cast<std::size_t>(min_rematched_fraction * static_cast<double>(pairs.size())))
    return state.feature_links;
  for (FeatureLink& link : verified.links) link.link.type = types.at(link.frames);
  return std::move(verified.links);
}

BlockSystem information_of(const RefinementInput& input, const RefinementState& state) {
  BundleAdjustmentResult found;
  found.map_from_base = state.poses;
  add_information(*state.frames,
                  information_tracks(*state.frames, state.feature_links, state.poses.size()).tracks,
                  state.results_of_other_links(), input.options.bundle_adjustment, found);
  return std::move(found.information);
}

CalibrationMoves calibration_moves(const RefinementInput& input, const RefinementState& state,
                                   SensorCalibration& deviations) {
  CalibrationMoves moves;
  if (state.calibration.empty()) return moves;
  const std::vector<GraphLinkResult> others = state.results_of_other_links();
  BundleAdjustmentResult varied = vary_calibration(calibration_input(input, state, others),
                                                   state.calibration, max_alternatives);
  for (std::size_t n = 0; n < varied.calibration.color_from_depth.size(); ++n) {
    varied.alternatives.push_back(varied.calibration);
    varied.alternatives.back().color_from_depth[n].translation().z() += axial_deviation_m;
  }
  const FeatureTracks tracks =
      information_tracks(*state.frames, state.feature_links, state.poses.size());
  const auto side_with = [&](const SensorCalibration& calibration) {
    const SharedFrames frames = calibrated(*state.stored_frames, calibration);
    const TrackSystem observed(*frames, tracks.tracks,
                               input.options.bundle_adjustment.robust_scale);
    BlockSystem system = observed.system(state.poses, observed.points_at(state.poses));
    system.add(surface_system(*frames, state.poses, state.surface_pairs, state.surface_distance_m,
                              input.options.icp));
    return system.rhs();
  };
  const std::vector<Vector6d> best = side_with(varied.calibration);
  const BlockSolver solver(fix_gauges(state.information, state.poses, state.graph.components),
                           1e-6);
  if (!solver.valid()) return moves;
  const double deviation =
      varied.calibration.timing.empty() ? calibration_deviation_scale : timing_deviation_scale;
  deviations = std::move(varied.deviations);
  const bool by_stamps =
      std::any_of(state.frames->begin(), state.frames->end(),
                  [](const FrameFeatures& frame) { return frame.depth_stamp_offset_s != 0.0; });
  for (CameraTiming& timing : deviations.timing) {
    timing.depth_delay_s =
        std::hypot(stated_timing_scale * timing.depth_delay_s, by_stamps ? stamp_deviation_s : 0.0);
    timing.rolling_shutter_s *= stated_timing_scale;
  }
  for (const SensorCalibration& alternative : varied.alternatives) {
    std::vector<Vector6d> side = side_with(alternative);
    for (std::size_t n = 0; n < side.size(); ++n) side[n] -= best[n];
    std::size_t row = 0;
    const std::vector<Vector6d> steps = solver.solve(side);
    // `covariances` multiplies the covariance by the square of this scale.
    for (const auto& [node, pose] : state.poses)
      moves[node].emplace_back(deviation / state.deviation_scale * steps[row++]);
  }
  return moves;
}

ScaleResult scale_stage(const RefinementInput& input, const RefinementState& state,
                        const std::map<int, Matrix6d>& covariance, const CalibrationMoves& moves) {
  const RefinementOptions& options = input.options;
  const std::optional<ScaleEstimate> odometry = odometry_scale(input, state);
  ScaleResult result;
  std::vector<std::string> warnings = state.warnings;
  const auto times = [](const ScaleEstimate& scale) {
    return "x " + to_fixed_text(scale.factor, 5) + " +- " + to_fixed_text(scale.deviation, 5);
  };
  const auto warn_if_apart = [&](const std::string& what, double chi_square) {
    if (chi_square > 9.0)
      warnings.push_back(what + " disagree by " + to_fixed_text(std::sqrt(chi_square), 1) +
                         " times their noise");
  };
  const std::vector<FrameFeatures>& frames = *state.stored_frames;
  std::optional<ScaleEstimate> scale;
  if (!options.known_lengths.empty()) {
    scale = scale_by_lengths(frames, state.calibration, state.poses, options.known_lengths);
    result.sentence = "scale " + times(*scale) + " by known lengths: corrected";
    warn_if_apart("known lengths", scale->chi_square);
  } else if (options.board) {
    scale = scale_by_board(frames, state.calibration, state.poses, covariance, input.board_views,
                           *options.board);
    result.sentence = "scale " + times(*scale) + " by the board in " +
                      std::to_string(scale->lengths) + " images: corrected";
    warn_if_apart("images of the board", scale->chi_square);
  } else if (options.scale != 1.0) {
    scale = ScaleEstimate{.factor = options.scale};
    result.sentence = "scale x " + to_text(options.scale) + " as given: corrected";
  } else if (options.scale_from == ScaleSource::odometry) {
    if (!odometry)
      throw Error("the scan has no odometry links",
                  {.field = "scale_from", .value = "odometry", .bound = "depth"});
    scale = odometry;
    result.sentence = "scale " + times(*scale) + " by odometry: corrected";
  } else {
    result.sentence = "scale is from the depth camera only";
    if (const double deviation = scale_deviation(state.poses, moves); deviation > 0.0)
      result.sentence += ", +- " + to_fixed_text(100.0 * deviation, 2) + " % from its calibration";
    if (odometry) result.sentence += "; by odometry it is " + times(*odometry);
  }
  if (!scale) return result;
  result.stage = StageResult{.state = state, .report = {.name = "scale"}};
  result.stage->state.warnings = std::move(warnings);
  result.stage->report.metrics = {{"factor", scale->factor},
                                  {"deviation", scale->deviation},
                                  {"lengths", scale->lengths},
                                  {"chi_square", scale->chi_square}};
  scale_state(scale->factor, result.stage->state);
  return result;
}

CameraFile refined_camera(const RefinementResult& result, const ScanSource& scan) {
  for (const TrajectoryPose& pose : result.poses) {
    const std::vector<Camera> cameras =
        scan.read_frame(pose.node, {.color = false, .depth = false}).cameras;
    if (cameras.empty()) continue;
    if (cameras.size() > 1)
      throw Error("a calibration file requires a scan with one camera",
                  {.file = scan.path().string(),
                   .field = "cameras",
                   .value = std::to_string(cameras.size()),
                   .bound = "1"});
    CameraFile file = calibrated_camera(cameras.front(), result.cameras.front(), result.calibration,
                                        scan.graph());
    file.findings = result.findings;
    file.findings.push_back(result.scale);
    return file;
  }
  throw Error("the scan has no calibration", {.file = scan.path().string()});
}

}  // namespace libmap
