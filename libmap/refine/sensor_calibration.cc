#include "libmap/refine/sensor_calibration.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "libmap/core/median.h"
#include "libmap/core/text.h"
#include "libmap/geometry/rigid_motion.h"

namespace libmap {

namespace {

// A subset of the frames of a scan, with its links and tracks.
struct SubScan {
  std::vector<FrameFeatures> frames;
  std::vector<FeatureLink> links;
  FeatureTracks tracks;
  std::map<int, Pose> poses;
  std::vector<GraphLinkResult> graph_links;
  std::vector<GraphComponent> components;
};

constexpr std::size_t max_frames = 80;
// Consecutive frames determine motions; runs that are far apart in time show different views.
constexpr std::size_t frames_per_run = 10;
constexpr std::size_t min_run_links = 10;  // to the selected runs

// Selects runs of consecutive frames: first the run with most links, then runs that are linked to
// the selected ones and farthest from them in time, last the runs with most links to them.
std::set<std::size_t> joined_frames(std::size_t frames, const std::vector<FeatureLink>& links) {
  const std::size_t length = frames <= max_frames ? 1 : frames_per_run;
  const std::size_t runs = (frames + length - 1) / length;
  std::vector<std::map<std::size_t, std::size_t>> joined(runs);
  std::vector<std::size_t> all(runs, 0);
  for (const FeatureLink& link : links) {
    const std::size_t a = link.frames.first / length;
    const std::size_t b = link.frames.second / length;
    ++joined[a][b];
    if (a != b) ++joined[b][a];
    ++all[a];
    ++all[b];
  }
  std::set<std::size_t> taken;
  std::vector<std::size_t> to_taken(runs, 0);
  std::vector<std::size_t> apart(runs, runs);
  auto next = static_cast<std::size_t>(std::max_element(all.begin(), all.end()) - all.begin());
  while (next < runs && (taken.size() + 1) * length <= max_frames) {
    taken.insert(next);
    for (const auto& [run, count] : joined[next]) to_taken[run] += count;
    for (std::size_t run = 0; run < runs; ++run)
      apart[run] = std::min(apart[run], run > next ? run - next : next - run);
    const auto rank = [&](std::size_t run) {
      const bool well = to_taken[run] >= (length == 1 ? 1 : min_run_links);
      return std::tuple(well, well ? apart[run] : 0, to_taken[run]);
    };
    next = runs;
    for (std::size_t run = 0; run < runs; ++run)
      if (to_taken[run] > 0 && !taken.contains(run) && (next == runs || rank(run) > rank(next)))
        next = run;
  }
  std::set<std::size_t> chosen;
  for (const std::size_t run : taken)
    for (std::size_t f = run * length; f < std::min(frames, (run + 1) * length); ++f)
      chosen.insert(f);
  return chosen;
}

SubScan sub_scan_of(const CalibrationInput& input, const std::set<std::size_t>& chosen) {
  SubScan part;
  std::map<std::size_t, std::size_t> index_of;
  for (const std::size_t f : chosen) {
    const auto pose = input.map_from_base.find(input.frames[f].node);
    if (pose == input.map_from_base.end()) continue;
    index_of.emplace(f, part.frames.size());
    part.frames.push_back(input.frames[f]);
    part.frames.back().descriptors = {};
    part.poses.insert(*pose);
  }
  for (const FeatureLink& link : input.links) {
    const auto a = index_of.find(link.frames.first);
    const auto b = index_of.find(link.frames.second);
    if (a == index_of.end() || b == index_of.end()) continue;
    part.links.push_back(link);
    part.links.back().frames = {a->second, b->second};
  }
  part.tracks = build_tracks(part.frames, part.links);
  for (const GraphLinkResult& link : input.graph_links)
    if (part.poses.contains(link.link.from) && part.poses.contains(link.link.to))
      part.graph_links.push_back(link);
  for (const GraphComponent& component : input.components) {
    GraphComponent kept;
    std::copy_if(component.nodes.begin(), component.nodes.end(), std::back_inserter(kept.nodes),
                 [&](int node) { return part.poses.contains(node); });
    if (kept.nodes.empty()) continue;
    kept.gauge_node =
        part.poses.contains(component.gauge_node) ? component.gauge_node : kept.nodes.front();
    part.components.push_back(std::move(kept));
  }
  return part;
}

SubScan joined_sub_scan(const CalibrationInput& input) {
  return sub_scan_of(input, joined_frames(input.frames.size(), input.links));
}

BundleAdjustmentOptions with_free(const CalibrationParts& parts, BundleAdjustmentOptions options) {
  options.refine_intrinsics = parts.intrinsics;
  options.refine_depth = parts.depth;
  options.refine_registration = parts.registration;
  options.refine_timing = parts.timing;
  options.with_information = false;
  return options;
}

constexpr int max_rounds = 4;
constexpr int repeated_rounds = 2;  // of a calibration that begins at an earlier one
// Motions are estimated in windows of consecutive frames. The time of a dense system grows with the
// cube of its frames.
constexpr std::size_t frames_per_window = 24;
constexpr std::size_t window_margin = 8;    // margin on each side, whose motions are not used
constexpr double max_interpolated_s = 1.0;  // maximum gap for interpolating motions
constexpr int motion_rounds = 2;            // other motions hit other points of the depth planes
// Minimum relative gain in the held-out costs; faults of a sensor change them by tens of percent. A
// part with a smaller gain absorbs errors of other parts, and correlated parameters drift.
constexpr double min_gain = 0.002;
constexpr double min_whole_gain = 0.005;  // of all parts together
// On a short path, held-out data share the errors of the other data: simulated scans of nine frames
// along 10 cm gain up to 2.3 % from depth corrections that do not exist.
constexpr double min_short_path_gain = 0.05;
constexpr double short_path = 0.05;  // RMS distance of the poses from their mean, in depths
// With constant motion, a delay of depth is hard to distinguish from a shift.
constexpr double min_timing_gain = 0.02;
// Tolerance of adjustments that are compared or initialize the next one. The last iterations change
// less than the standard errors of the held-out data.
constexpr double rough_tolerance = 1e-4;

// A calibration model and its fit to the held-out data.
struct Candidate {
  CalibrationParts model;
  BundleAdjustmentResult adjustment;
  HeldOutCosts costs;
  bool possible = true;
};

Candidate try_model(const CalibrationParts& model, const SubScan& part,
                    const BundleAdjustmentOptions& options, SensorCalibration start,
                    std::map<int, Pose> poses, int rounds) {
  const BundleAdjustmentOptions free = with_free(model, options);
  Candidate candidate;
  candidate.model = model;
  // A changed registration or timing hits other depth planes, so the adjustment is repeated.
  for (int round = 0; round < rounds; ++round) {
    candidate.adjustment = adjust_bundle(part.frames, part.tracks.tracks, poses, part.graph_links,
                                         part.components, free, {}, start);
    const SensorCalibration& found = candidate.adjustment.calibration;
    if (!model.registration && !model.timing) break;
    if (is_similar_registration(start, found, 1e-4, 5e-5, 3e-4)) break;
    poses = candidate.adjustment.map_from_base;
    start = found;
  }
  std::vector<FrameFeatures> frames = part.frames;
  for (FrameFeatures& frame : frames) calibrate(frame, candidate.adjustment.calibration);
  candidate.costs = held_out_costs(frames, part.links, candidate.adjustment.map_from_base);
  return candidate;
}

// Interpolates the motions of frames without one from the frames before and after.
void interpolate_motions(const std::vector<FrameFeatures>& frames,
                         std::map<int, Vector6d>& motions) {
  std::map<double, Vector6d> known;
  for (const FrameFeatures& frame : frames)
    if (const auto motion = motions.find(frame.node); motion != motions.end())
      known.emplace(frame.stamp_s, motion->second);
  for (const FrameFeatures& frame : frames) {
    const auto after = known.lower_bound(frame.stamp_s);
    if (motions.contains(frame.node) || after == known.begin() || after == known.end()) continue;
    const auto before = std::prev(after);
    if (after->first - before->first > max_interpolated_s) continue;
    const double fraction = (frame.stamp_s - before->first) / (after->first - before->first);
    motions.emplace(frame.node, (1.0 - fraction) * before->second + fraction * after->second);
  }
}

// Adds the known motions of frames that the calibration did not use. They are scaled so that the
// product of motion and time is unchanged, because only the product is observable.
void add_other_motions(const SensorCalibration& known, SensorCalibration& calibration) {
  if (calibration.timing.empty()) return;
  const auto time_of = [&](const SensorCalibration& of) {
    const CameraTiming& timing = known.timing.front();
    return std::abs(timing.rolling_shutter_s) > std::abs(timing.depth_delay_s)
               ? of.timing.front().rolling_shutter_s
               : of.timing.front().depth_delay_s;
  };
  const double time_s = time_of(calibration);
  const double fraction = time_s != 0.0 ? std::clamp(time_of(known) / time_s, 0.5, 2.0) : 1.0;
  for (const auto& [node, motion] : known.motion)
    calibration.motion.emplace(node, fraction * motion);
}

bool is_short_path(const SubScan& part) {
  std::vector<double> depths;
  for (const FrameFeatures& frame : part.frames)
    for (const Feature& feature : frame.features)
      if (feature.depth_m > 0.0F) depths.push_back(static_cast<double>(feature.depth_m));
  if (depths.empty() || part.poses.empty()) return false;
  const auto count = static_cast<double>(part.poses.size());
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& [node, pose] : part.poses) mean += pose.translation() / count;
  double squares = 0.0;
  for (const auto& [node, pose] : part.poses) squares += (pose.translation() - mean).squaredNorm();
  return std::sqrt(squares / count) < short_path * median(std::move(depths));
}

// Returns true if the additional free parameters improve the held-out fit clearly.
bool is_needed(const HeldOutCosts& without, const HeldOutCosts& with, double gain = min_gain) {
  const HeldOutEvaluation change = evaluate_held_out(without, with);
  return !change.is_worse() &&
         change.change() < -std::max(2.0 * change.deviation(), gain * change.before());
}

// Finds the simplest model that fits.
class ModelSearch {
 public:
  ModelSearch(const SubScan& part, const BundleAdjustmentOptions& options,
              const CalibrationChoice& choice)
      : part_(part),
        options_(options),
        rough_(options),
        choice_(choice),
        before_(held_out_costs(part.frames, part.links, part.poses)),
        min_gain_of_all_(is_short_path(part) ? min_short_path_gain : min_whole_gain) {
    rough_.tolerance = rough_tolerance;
    estimate_.frames = part.frames.size();
  }

  CalibrationEstimate run();

 private:
  Candidate attempt(const CalibrationParts& model, const SensorCalibration& start,
                    const std::map<int, Pose>& poses, int rounds) {
    Candidate candidate = try_model(model, part_, rough_, start, poses, rounds);
    estimate_.evaluated_models.emplace_back(model.name(),
                                            evaluate_held_out(before_, candidate.costs));
    if (const auto reason = exceeded_bound(candidate.adjustment.calibration, options_)) {
      candidate.possible = false;
      estimate_.impossible.emplace_back(model.name(), *reason);
    }
    return candidate;
  }
  // One round is enough for a comparison, because it begins at the best model.
  Candidate attempt_from_best(const CalibrationParts& model, int rounds) {
    return attempt(model, best_.adjustment.calibration, best_.adjustment.map_from_base, rounds);
  }
  bool is_good(const Candidate& candidate) const;
  void simplify_to(const CalibrationParts& simpler);
  void drop_unneeded();
  void settle_motions();
  CalibrationParts timing_alone() const {
    return {.registration = choice_.keeps_registration, .timing = true};
  }
  bool is_timing_enough(const CalibrationParts& others);
  void use_timing_alone();
  void try_timing();

  const SubScan& part_;
  const BundleAdjustmentOptions& options_;
  BundleAdjustmentOptions rough_;
  const CalibrationChoice& choice_;
  HeldOutCosts before_;
  double min_gain_of_all_;
  Candidate best_;
  std::optional<Candidate> timed_;  // timing alone, if it is clearly better than the stored camera
  CalibrationEstimate estimate_;
};

bool ModelSearch::is_good(const Candidate& candidate) const {
  const HeldOutEvaluation change = evaluate_held_out(before_, candidate.costs);
  return candidate.adjustment.converged && candidate.possible &&
         (choice_.only_if_better
              ? change.is_clearly_better() && change.change() < -min_gain_of_all_ * change.before()
              : !change.is_worse());
}

// Takes the simpler model unless the dropped parts are needed.
void ModelSearch::simplify_to(const CalibrationParts& simpler) {
  if (!is_good(best_) || simpler.name().empty() || simpler == best_.model) return;
  Candidate candidate = attempt_from_best(simpler, 1);
  // Residual errors of motions would be absorbed by correct parts.
  const double gain = best_.model.timing ? min_timing_gain : min_gain;
  if (is_good(candidate) && !is_needed(candidate.costs, best_.costs, gain))
    best_ = std::move(candidate);
}

void ModelSearch::drop_unneeded() {
  if (!choice_.only_if_better || !choice_.drop_unneeded) return;
  if (best_.model.timing) simplify_to(timing_alone());
  for (bool CalibrationParts::*const part_of :
       {&CalibrationParts::registration, &CalibrationParts::depth, &CalibrationParts::intrinsics}) {
    if (part_of == &CalibrationParts::registration && choice_.keeps_registration) continue;
    CalibrationParts simpler = best_.model;
    simpler.*part_of = false;
    simplify_to(simpler);
  }
}

// Later calibrations begin at this one, so one round is enough.
void ModelSearch::settle_motions() {
  Candidate settled = attempt_from_best(best_.model, 1);
  if (is_good(settled)) best_ = std::move(settled);
}

// Tries timing alone, because a depth correction also fits distortions by late depth and a rolling
// shutter. Returns true if timing fits and all parts together are not clearly better.
bool ModelSearch::is_timing_enough(const CalibrationParts& others) {
  HeldOutCosts without = before_;
  if (choice_.keeps_registration)
    without = attempt({.registration = true}, {}, part_.poses, max_rounds - 1).costs;
  timed_ = attempt(timing_alone(), {}, part_.poses, max_rounds - 1);
  const HeldOutEvaluation change = evaluate_held_out(without, timed_->costs);
  if (!is_good(*timed_) || change.change() > -min_timing_gain * change.before()) {
    timed_.reset();
    return false;
  }
  CalibrationParts all = others;
  all.timing = true;
  if (all == timed_->model) return true;
  const Candidate candidate =
      attempt(all, timed_->adjustment.calibration, timed_->adjustment.map_from_base, 1);
  if (is_good(candidate)) return !is_needed(timed_->costs, candidate.costs);
  // If only its timing is impossible, the other parts are tried without it.
  SensorCalibration without_timing = candidate.adjustment.calibration;
  without_timing.timing.clear();
  return candidate.possible || exceeded_bound(without_timing, options_);
}

// Takes timing alone as the model.
void ModelSearch::use_timing_alone() {
  best_ = std::move(*timed_);
  settle_motions();
}

void ModelSearch::try_timing() {
  if (!is_good(best_)) return;  // timing alone was tried before
  CalibrationParts timed = best_.model;
  timed.timing = true;
  Candidate candidate = attempt_from_best(timed, 1);
  if (!is_good(candidate) || !is_needed(best_.costs, candidate.costs, min_timing_gain)) return;
  best_ = std::move(candidate);
  drop_unneeded();
  settle_motions();
}

CalibrationEstimate ModelSearch::run() {
  CalibrationParts all = choice_.parts;
  all.timing = all.timing && !choice_.start.timing.empty();
  const bool may_time = choice_.parts.timing && choice_.drop_unneeded && !all.timing;
  if (may_time && is_timing_enough(all)) {
    use_timing_alone();
  } else {
    best_ = attempt(all, choice_.start, part_.poses,
                    choice_.start.empty() ? max_rounds : repeated_rounds);
    // With little data, too many free parameters may fit worse than intrinsics alone.
    if (!is_good(best_) && choice_.drop_unneeded && all.intrinsics &&
        (all.depth || all.registration))
      best_ = attempt({.intrinsics = true, .registration = choice_.keeps_registration}, {},
                      part_.poses, 1);
    drop_unneeded();
    if (may_time) try_timing();
    if (timed_ && (!is_good(best_) || is_needed(best_.costs, timed_->costs, min_timing_gain)))
      use_timing_alone();
  }
  if (is_good(best_) && choice_.converge) {
    Candidate settled = try_model(best_.model, part_, options_, best_.adjustment.calibration,
                                  best_.adjustment.map_from_base, 1);
    if (is_good(settled)) best_ = std::move(settled);
  }
  if (is_good(best_)) estimate_.calibration = best_.adjustment.calibration;
  estimate_.held_out = evaluate_held_out(before_, best_.costs);
  estimate_.adjustment = std::move(best_.adjustment);
  return std::move(estimate_);
}

}  // namespace

CalibrationEstimate estimate_calibration(const CalibrationInput& input,
                                         const CalibrationChoice& choice) {
  const SubScan part = joined_sub_scan(input);
  return ModelSearch(part, input.options, choice).run();
}

BundleAdjustmentResult vary_calibration(const CalibrationInput& input,
                                        const SensorCalibration& known, std::size_t count) {
  const SubScan part = joined_sub_scan(input);
  BundleAdjustmentOptions varied = with_free(parts_of(known), input.options);
  varied.alternatives = count;
  varied.tolerance = rough_tolerance;
  BundleAdjustmentResult result =
      adjust_bundle(part.frames, part.tracks.tracks, part.poses, part.graph_links, part.components,
                    varied, {}, known);
  add_other_motions(known, result.calibration);
  for (SensorCalibration& alternative : result.alternatives) add_other_motions(known, alternative);
  return result;
}

void estimate_motions(const CalibrationInput& input, bool fixes_poses,
                      SensorCalibration& calibration, const SensorCalibration& known) {
  const int rounds = fixes_poses || !known.timing.empty() ? 1 : motion_rounds;
  if (!known.timing.empty()) add_other_motions(known, calibration);
  const std::vector<FrameFeatures>& frames = input.frames;
  BundleAdjustmentOptions moving = with_free(parts_of(calibration), input.options);
  moving.fixes_poses = fixes_poses;
  moving.refine_timing = moving.fixes_cameras = true;
  moving.tolerance = rough_tolerance;
  SensorCalibration start = calibration;
  std::map<int, Vector6d> motions;
  for (std::size_t first = 0; first < frames.size(); first += frames_per_window) {
    std::set<std::size_t> window;
    const std::size_t end = std::min(frames.size(), first + frames_per_window);
    for (std::size_t f = first - std::min(first, window_margin);
         f < std::min(frames.size(), end + window_margin); ++f)
      window.insert(f);
    const SubScan part = sub_scan_of(input, window);
    std::map<int, Pose> poses = part.poses;
    start.motion = calibration.motion;
    for (int round = 0; round < rounds; ++round) {
      BundleAdjustmentResult adjusted =
          adjust_bundle(part.frames, part.tracks.tracks, poses, part.graph_links, part.components,
                        moving, {}, start);
      poses = std::move(adjusted.map_from_base);
      start.motion = std::move(adjusted.calibration.motion);
    }
    for (std::size_t f = first; f < end; ++f)
      if (const auto motion = start.motion.find(frames[f].node); motion != start.motion.end())
        motions.insert(*motion);
  }
  calibration.motion = std::move(motions);
  for (const GraphComponent& component : input.components)
    if (component.nodes.size() == 1) calibration.motion.erase(component.nodes.front());
  interpolate_motions(frames, calibration.motion);
}

}  // namespace libmap
