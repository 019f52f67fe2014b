#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/refine/graph_covariance.h"
#include "libmap/refine/refinement_work.h"
#include "libmap/refine/sparse_adjustment.h"

namespace libmap {

namespace {

constexpr int max_calibrations = 3;
// A calibration that changes less does not let other features match.
constexpr double settled_m = 5e-4;
constexpr double settled_rad = 3e-4;
constexpr double settled_s = 1e-3;
constexpr std::size_t max_alternatives = 10;
// Of a calibration: matches are chosen by the camera that they correct, and what a model does not
// cover errs alike in all frames. Of timing more, whose motions change within a frame. Measured on
// simulated scans.
constexpr double calibration_deviation_scale = 1.1;
constexpr double timing_deviation_scale = 1.4;
// Of a registration's shift along the optical axis, which hardly differs from a scale, beyond what
// the observations say. Measured on simulated scans.
constexpr double axial_deviation_m = 4e-4;
constexpr double explained_cost = 0.35;  // of held-out matches; of normal errors it is 0.26

bool is_by_depth(const GraphLink& link) { return link.group == depth_group; }

void add_figures(const CalibrationEstimate& estimate, StageReport& stage) {
  stage.figures.emplace_back("frames", static_cast<double>(estimate.frames));
  for (const auto& [name, change] : estimate.tried) {
    stage.figures.emplace_back(name + "_matches", change.matches.after);
    stage.figures.emplace_back(name + "_surfaces", change.surfaces.after);
  }
  for (std::size_t n = 0; n < estimate.calibration.intrinsics.size(); ++n) {
    const IntrinsicsStep& step = estimate.calibration.intrinsics[n];
    const std::string camera = "camera_" + std::to_string(n) + "_";
    stage.figures.emplace_back(camera + "fx_share", step.fx_share);
    stage.figures.emplace_back(camera + "fy_share", step.fy_share);
    stage.figures.emplace_back(camera + "cx_px", step.cx_px);
    stage.figures.emplace_back(camera + "cy_px", step.cy_px);
  }
  for (std::size_t n = 0; n < estimate.calibration.timing.size(); ++n) {
    const CameraTiming& timing = estimate.calibration.timing[n];
    const std::string camera = "camera_" + std::to_string(n) + "_";
    stage.figures.emplace_back(camera + "depth_delay_s", timing.depth_delay_s);
    stage.figures.emplace_back(camera + "rolling_shutter_s", timing.rolling_shutter_s);
  }
}

}  // namespace

// The same with intrinsics, depth and its registration free. What the camera's file says is kept
// unless what was held out speaks against it: the pictures of RTAB-Map's own downsampling, for one,
// are a fraction of a pixel off.
bool Refinement::calibrate_sensor(const std::string& name) {
  StageReport stage;
  stage.name = name;
  const std::vector<GraphLinkResult> others = without_features(graph_.links, stored_.size());
  CalibrationChoice choice;
  choice.intrinsics = options_.intrinsics != IntrinsicsMode::fixed;
  choice.depth = choice.registration = choice.timing = options_.correct_depth;
  choice.only_if_better = options_.intrinsics != IntrinsicsMode::refined;
  choice.settle = !result_.calibration.empty();  // the first one begins the next
  if (const SensorCalibration& known = result_.calibration; !known.empty()) {
    choice.intrinsics = !known.intrinsics.empty();
    choice.depth = !known.depth.empty();
    choice.registration = !known.color_from_depth.empty();
    choice.timing = !known.timing.empty();
    choice.leave_out = choice.timing;
    choice.start = known;
  }
  CalibrationEstimate estimate = estimate_calibration(
      frames_, links_, poses_, others, graph_.components, options_.bundle_adjustment, choice);
  stage.held_out = estimate.held_out;
  add_figures(estimate, stage);
  stage.rejected = estimate.calibration.empty();
  BundleAdjustmentResult& adjusted = estimate.adjustment;
  if (!stage.rejected) {
    if (estimate.frames < frames_.size() && !estimate.calibration.timing.empty())
      find_motions(frames_, links_, poses_, others, graph_.components, options_.bundle_adjustment,
                   false, estimate.calibration);
    std::vector<FrameFeatures> as_stored = frames_;
    for (FrameFeatures& frame : frames_) calibrate(frame, estimate.calibration);
    if (estimate.frames < frames_.size()) {
      BundleAdjustmentOptions options = options_.bundle_adjustment;
      options.with_information = false;
      adjusted = adjust_bundle(frames_, links_, poses_, others, graph_.components, options);
      stage.held_out = evaluate_held_out(held_out_costs(as_stored, links_, poses_),
                                         held_out_costs(frames_, links_, adjusted.map_from_base));
      stage.rejected = stage.held_out.is_worse();
    }
    if (stage.rejected)
      frames_ = std::move(as_stored);
    else
      stored_frames_ = std::move(as_stored);
  }
  const bool accepted = !stage.rejected;
  if (accepted) {
    poses_ = std::move(adjusted.map_from_base);
    result_.calibration = std::move(estimate.calibration);
  } else {
    stage.rejected_error = error_of(adjusted.map_from_base);
  }
  close(std::move(stage));
  return accepted;
}

// As if they had been recorded with the calibration.
void Refinement::calibrate_frames(const SensorCalibration& calibration) {
  if (calibration.timing.empty()) return;  // nothing depends on poses
  for (std::size_t f = 0; f < frames_.size(); ++f) {
    frames_[f] = stored_frames_[f];
    calibrate(frames_[f], calibration);
  }
  result_.calibration = calibration;
}

// Motions have been estimated together with poses: with other poses they are others.
void Refinement::move_frames(const std::map<int, Pose>& poses) {
  SensorCalibration calibration = result_.calibration;
  if (calibration.timing.empty()) return;
  find_motions(stored_frames_, links_, poses, without_features(graph_.links, stored_.size()),
               graph_.components, options_.bundle_adjustment, true, calibration);
  calibrate_frames(calibration);
}

// Matches that a wrong camera hid come back with the right one, and those that it let pass go.
void Refinement::match_again() {
  std::vector<FramePair> pairs;
  std::map<FramePair, LinkType> types;
  for (const FeatureLink& link : links_)
    if (types.emplace(link.frames, link.link.type).second) pairs.push_back(link.frames);
  PairVerification verified =
      verify_pairs(frames_, pairs, options_.closures, options_.seed, progress_, matches_to_keep());
  if (verified.links.size() < static_cast<std::size_t>(0.9 * static_cast<double>(pairs.size())))
    return;
  for (FeatureLink& link : verified.links) link.link.type = types.at(link.frames);
  links_ = std::move(verified.links);
}

// A rolling shutter distorts pictures so that few matches agree on a rigid motion, and frames are
// lost: all of it again with what has been found of the sensor.
void Refinement::track_again() {
  auto state = std::tie(poses_, parts_, links_, stored_, tried_, graph_, result_.losses);
  const auto before =
      std::apply([](const auto&... values) { return std::make_tuple(values...); }, state);
  const std::map<int, Pose> poses = poses_;
  const std::size_t left = unjoined(parts_).size();
  poses_ = start_;
  parts_ = start_parts_;
  links_.clear();
  tried_.clear();
  std::erase_if(stored_, is_by_depth);
  again_ = " again";
  find_poses();
  again_.clear();
  StageReport stage;
  stage.name = "tracking again";
  evaluate(stage, poses, poses_);
  stage.rejected = stage.rejected || unjoined(parts_).size() > left;
  const bool rejected = stage.rejected;
  if (rejected) state = before;
  close(std::move(stage));
  if (rejected) match_again();
}

// Again with matches by what has been found: those of the first time are what the stored camera let
// pass. A wrong registration hides most of them.
void Refinement::calibrate_sensor() {
  std::vector<FrameFeatures> calibrated;
  for (int pass = 1; pass <= max_calibrations; ++pass) {
    const SensorCalibration before = result_.calibration;
    if (!calibrate_sensor(pass == 1 ? "calibration" : "calibration " + std::to_string(pass))) {
      if (pass == 1) return;
      stored_frames_ = std::move(frames_);
      frames_ = std::move(calibrated);
      break;
    }
    if (pass == max_calibrations ||
        (pass > 1 &&
         takes_depth_from_near(before, result_.calibration, settled_m, settled_rad, settled_s)))
      break;
    const bool was_lost =
        !result_.losses.empty() || std::any_of(stored_.begin(), stored_.end(), is_by_depth);
    if (pass == 1 && !result_.calibration.timing.empty() && was_lost)
      track_again();
    else
      match_again();
    calibrated = std::move(frames_);
    frames_ = std::exchange(stored_frames_, {});
  }
  for (FrameFeatures& frame : stored_frames_) frame.descriptors = {};
  BundleAdjustmentResult found;
  found.map_from_base = poses_;
  add_information(frames_, information_tracks(frames_, links_, poses_.size()).tracks,
                  without_features(graph_.links, stored_.size()), options_.bundle_adjustment,
                  found);
  information_ = std::move(found.information);
  by_observations_ = true;
}

// The poses rest on a calibration that is uncertain itself: what a standard deviation of it asks of
// them, and how they would move, to first order.
void Refinement::vary_calibration() {
  if (result_.calibration.empty() || stored_frames_.empty()) return;
  BundleAdjustmentResult varied = libmap::vary_calibration(
      stored_frames_, links_, poses_, without_features(graph_.links, stored_.size()),
      graph_.components, options_.bundle_adjustment, result_.calibration, max_alternatives);
  for (std::size_t n = 0; n < varied.calibration.color_from_depth.size(); ++n) {
    varied.alternatives.push_back(varied.calibration);
    varied.alternatives.back().color_from_depth[n].translation().z() += axial_deviation_m;
  }
  const FeatureTracks tracks = information_tracks(frames_, links_, poses_.size());
  const auto asked = [&](const SensorCalibration& calibration) {
    std::vector<FrameFeatures> frames = stored_frames_;
    for (FrameFeatures& frame : frames) calibrate(frame, calibration);
    const TrackSystem observed(frames, tracks.tracks, options_.bundle_adjustment.robust_scale);
    BlockSystem system = observed.system(poses_, observed.points_at(poses_));
    system.add(surface_system(frames, poses_, surface_pairs_, surface_distance_m_, options_.icp));
    return system.rhs();
  };
  const std::vector<Vector6d> best = asked(varied.calibration);
  const BlockSolver solver(fix_gauges(information_, poses_, graph_.components), 1e-6);
  if (!solver.valid()) return;
  const double deviation =
      varied.calibration.timing.empty() ? calibration_deviation_scale : timing_deviation_scale;
  for (const SensorCalibration& alternative : varied.alternatives) {
    std::vector<Vector6d> side = asked(alternative);
    for (std::size_t n = 0; n < side.size(); ++n) side[n] -= best[n];
    std::size_t row = 0;
    const std::vector<Vector6d> moves = solver.solve(side);
    // The information is divided by the scale's square, as the covariance is multiplied by it.
    for (const auto& [node, pose] : poses_)
      moves_[node].emplace_back(deviation / deviation_scale_ * moves[row++]);
  }
}

// The whole, by what no stage was estimated from. A part that had no poses has nothing to fall back
// to.
void Refinement::keep_start_if_better() {
  if (!tracked_.empty() || start_.size() != poses_.size()) return;
  const HeldOutEvaluation whole = evaluate_held_out(
      held_out_costs(stored_frames_.empty() ? frames_ : stored_frames_, links_, start_),
      held_out_costs(frames_, links_, poses_));
  if (whole.change() > 2.0 * whole.deviation()) {
    poses_ = start_;
    result_.calibration = {};
    result_.warnings.push_back(
        "what was held out fits the poses of the start better: they are kept, and the camera as "
        "it is stored");
  } else if (whole.matches.after > explained_cost) {
    result_.warnings.push_back(
        "held-out matches fit worse than noise explains: the sensor has faults that the "
        "calibration does not cover");
  }
}

// Of the scale, by the moves of the poses with the calibration.
double Refinement::scale_deviation() const {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  for (const auto& [node, moves] : moves_) center += poses_.at(node).translation();
  center /= static_cast<double>(std::max<std::size_t>(1, moves_.size()));
  std::vector<double> growth;
  double squares = 0.0;
  for (const auto& [node, moves] : moves_) {
    const Pose& pose = poses_.at(node);
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

// Nothing else fixes the scale: depth, poses and their links of features keep their shape.
void Refinement::find_scale() {
  std::vector<GraphLinkResult> stored;
  if (!scan_.graph().links.empty()) stored = without_features(graph_.links, stored_.size());
  std::erase_if(stored, [&](const GraphLinkResult& link) {  // by depth itself
    return tracked_.contains(link.link.from) || tracked_.contains(link.link.to);
  });
  const std::optional<ScaleEstimate> odometry = scale_by_odometry(stored, poses_);
  const auto times = [](const ScaleEstimate& scale) {
    return "x " + to_fixed_text(scale.factor, 5) + " +- " + to_fixed_text(scale.deviation, 5);
  };
  const std::vector<FrameFeatures>& frames = stored_frames_.empty() ? frames_ : stored_frames_;
  const auto warn_if_apart = [&](const std::string& what, double chi_square) {
    if (chi_square > 9.0)
      result_.warnings.push_back(what + " disagree by " + to_fixed_text(std::sqrt(chi_square), 1) +
                                 " times their noise");
  };
  std::optional<ScaleEstimate> scale;
  if (!options_.known_lengths.empty()) {
    scale = scale_by_lengths(frames, result_.calibration, poses_, options_.known_lengths);
    result_.scale = "scale " + times(*scale) + " by known lengths: corrected";
    warn_if_apart("known lengths", scale->chi_square);
  } else if (options_.board) {
    scale = scale_by_board(frames, result_.calibration, poses_, result_.covariance, board_views_,
                           *options_.board);
    result_.scale = "scale " + times(*scale) + " by the board in " +
                    std::to_string(scale->lengths) + " pictures: corrected";
    warn_if_apart("pictures of the board", scale->chi_square);
  } else if (options_.scale != 1.0) {
    scale = ScaleEstimate{.factor = options_.scale};
    result_.scale = "scale x " + to_text(options_.scale) + " as given: corrected";
  } else if (options_.scale_from == ScaleSource::odometry) {
    if (!odometry)
      throw Error("the scan has no links of odometry",
                  {.field = "scale_from", .value = "odometry", .bound = "depth"});
    scale = odometry;
    result_.scale = "scale " + times(*scale) + " by odometry: corrected";
  } else {
    result_.scale = "scale comes from the depth camera alone";
    if (const double deviation = scale_deviation(); deviation > 0.0)
      result_.scale += ", +- " + to_fixed_text(100.0 * deviation, 2) + " % by its calibration";
    if (odometry) result_.scale += "; by odometry it is " + times(*odometry);
  }
  if (!scale) return;
  StageReport stage;
  stage.name = "scale";
  stage.figures = {{"factor", scale->factor},
                   {"deviation", scale->deviation},
                   {"lengths", static_cast<double>(scale->lengths)},
                   {"chi_square", scale->chi_square}};
  const int fixed =
      graph_.components.empty() ? poses_.begin()->first : graph_.components.front().gauge_node;
  apply_scale(scale->factor, fixed, frames_.empty() ? 1 : frames_.front().cameras.size(), poses_,
              result_.calibration);
  for (std::size_t n = stored_.size(); n < graph_.links.size(); ++n)
    graph_.links[n].link.from_from_to.translation() *= scale->factor;
  close(std::move(stage));
}

}  // namespace libmap
