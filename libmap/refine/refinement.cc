#include "libmap/refine/refinement.h"

#include <algorithm>
#include <chrono>
#include <ctime>
#include <iterator>
#include <utility>

#include "libmap/consistency/pose_consistency.h"
#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/optimize/graph_covariance.h"
#include "libmap/refine/depth_registration.h"
#include "libmap/refine/noise_estimate.h"
#include "libmap/refine/refinement_stages.h"

namespace libmap {

namespace {

constexpr double settled_fraction = 0.01;  // rounds end with a smaller share of new links
constexpr int max_calibrations = 3;
// A smaller change of the calibration does not change the matches.
constexpr double settled_m = 5e-4;
constexpr double settled_rad = 3e-4;
constexpr double settled_s = 1e-3;
// Features of one location have correlated errors. Measured on simulated scans.
constexpr double min_deviation_scale = 1.3;
constexpr double explained_cost = 0.35;  // of held-out matches; 0.26 for normal errors

bool is_motion(const PoseLink& link) {
  return link.from > 0 && link.to > 0 && link.from != link.to;
}

bool is_by_depth(const GraphLink& link) { return link.group == depth_link_group; }

// "3, 5, 6, 10-40": ten or more consecutive numbers are a range.
std::string join_numbers(const std::vector<int>& numbers) {
  std::string text;
  for (std::size_t n = 0; n < numbers.size(); ++n) {
    std::size_t last = n;
    while (last + 1 < numbers.size() && numbers[last + 1] == numbers[last] + 1) ++last;
    if (last < n + 9) last = n;
    text += (text.empty() ? "" : ", ") + std::to_string(numbers[n]);
    if (last > n) text += "-" + std::to_string(numbers[last]);
    n = last;
  }
  return text;
}

Trajectory trajectory_at(const PoseGraph& graph, const std::map<int, Pose>& poses) {
  Trajectory trajectory;
  for (const auto& [node, pose] : poses)
    if (const GraphNode* known = node > 0 ? graph.find_node(node) : nullptr)
      trajectory.push_back({node, known->stamp_s, pose});
  return trajectory;
}

bool is_all_tracked(const RefinementInput& input, const RefinementState& state) {
  return std::all_of(state.poses.begin(), state.poses.end(), [&](const auto& pose) {
    return pose.first < 0 || input.odometry_nodes.contains(pose.first);
  });
}

// Returns nodes with undetermined poses: parts from visual odometry that no link joins to others.
// With one_map, all parts but the largest.
std::vector<int> unjoined(const RefinementInput& input, const RefinementState& state,
                          const std::vector<std::vector<int>>& parts) {
  std::vector<int> left;
  const bool one_map = input.options.one_map;
  if (input.odometry_nodes.empty() && !one_map) return left;
  const bool nothing_known = is_all_tracked(input, state);
  const auto largest = std::max_element(
      parts.begin(), parts.end(), [](const auto& a, const auto& b) { return a.size() < b.size(); });
  for (auto part = parts.begin(); part != parts.end(); ++part) {
    const bool alone = std::all_of(part->begin(), part->end(), [&](int node) {
      return node < 0 || input.odometry_nodes.contains(node);
    });
    if (one_map ? part != largest : alone && !(part == largest && nothing_known))
      left.insert(left.end(), part->begin(), part->end());
  }
  return left;
}

HeldOutCosts costs_at(const RefinementState& state, const std::vector<FeatureLink>& links) {
  return held_out_costs(*state.frames, links, state.poses);
}

// Present state of a refinement, and the reports of its stages.
struct Run {
  RefinementInput input;
  RefinementState state{};
  RefinementResult result{};
  Trajectory truth = trajectory_of(input.scan.graph(), PoseSource::ground_truth);
  std::chrono::steady_clock::time_point begin = std::chrono::steady_clock::now();
  std::clock_t processor_begin = std::clock();

  std::optional<StageError> error_of(const RefinementState& at) const {
    if (truth.empty()) return std::nullopt;
    std::map<int, Pose> joined = at.poses;
    for (const int node : unjoined(input, at, at.parts)) joined.erase(node);
    try {
      const Trajectory estimate = trajectory_at(input.scan.graph(), joined);
      return StageError{absolute_trajectory_error(estimate, truth),
                        relative_trajectory_error(estimate, truth)};
    } catch (const Error&) {
      return std::nullopt;  // fewer than three poses in common
    }
  }

  // Ends a stage: records its times and the errors of the present poses.
  void report(StageReport stage) {
    const auto now = std::chrono::steady_clock::now();
    stage.seconds = std::chrono::duration<double>(now - std::exchange(begin, now)).count();
    const std::clock_t clock = std::clock();
    stage.processor_seconds = static_cast<double>(clock - std::exchange(processor_begin, clock)) /
                              static_cast<double>(CLOCKS_PER_SEC);
    stage.error = error_of(state);
    result.stages.push_back(std::move(stage));
  }

  void accept(StageResult stage) {
    state = std::move(stage.state);
    report(std::move(stage.report));
  }

  // Accepts the stage unless it has failed or its state fits the held-out observations of its links
  // worse than `before`, from which it started.
  bool propose(StageResult stage, const RefinementState& before) {
    StageReport& made = stage.report;
    if (!stage.is_validated) {
      const std::vector<FeatureLink>& links = stage.state.feature_links;
      made.held_out = evaluate_held_out(costs_at(before, links), costs_at(stage.state, links));
      made.rejected = made.rejected || made.held_out.is_worse();
    }
    const bool accepted = !made.rejected;
    if (made.rejected) made.rejected_error = error_of(stage.state);
    if (accepted) state = std::move(stage.state);
    report(std::move(made));
    return accepted;
  }
  bool propose(StageResult stage) { return propose(std::move(stage), state); }
};

// Warns if depth images contradict the poses, which then have another convention or unit. Only the
// largest part is compared, because each part has its own frame.
void warn_of_contradictions(Run& run) {
  const RefinementState& state = run.state;
  if (state.poses.empty()) return;
  const auto largest =
      std::max_element(state.parts.begin(), state.parts.end(),
                       [](const auto& a, const auto& b) { return a.size() < b.size(); });
  Trajectory poses = trajectory_at(run.input.scan.graph(), state.poses);
  if (largest != state.parts.end())
    std::erase_if(poses, [&](const TrajectoryPose& pose) {
      return std::find(largest->begin(), largest->end(), pose.node) == largest->end();
    });
  const PoseConsistency found = check_pose_consistency(run.input.scan, poses);
  if (std::string warning = found.warning(); !warning.empty())
    run.state.warnings.push_back("initial poses: " + std::move(warning));
}

void start(Run& run) {
  const RefinementOptions& options = run.input.options;
  const PoseGraph& graph = run.input.scan.graph();
  const int gauge = options.graph.gauge_node;
  if (gauge != 0 && graph.find_node(gauge) == nullptr)
    throw Error("the scan has no node with this id",
                {.field = "gauge_node", .value = std::to_string(gauge)});
  InitialPoses initial = initial_poses(graph, options.start);
  RefinementState& state = run.state;
  state.poses = run.input.start = std::move(initial.map_from_base);
  state.parts = run.input.start_parts = std::move(initial.parts);
  state.other_links = stored_links(graph);
  if (options.start == StartPoses::visual)
    std::erase_if(state.other_links, [](const GraphLink& link) { return is_motion(link.link); });
  drop_invalid(state.other_links, state.warnings);
  if (state.other_links.empty() && options.start != StartPoses::visual)
    state.other_links = odometry_links(graph);
  if (options.start == StartPoses::visual || options.start == StartPoses::automatic) {
    run.input.odometry_nodes.insert(initial.without_pose.begin(), initial.without_pose.end());
  } else {
    run.result.without_pose = std::move(initial.without_pose);
    if (!run.result.without_pose.empty())
      state.warnings.push_back(std::to_string(run.result.without_pose.size()) +
                               " nodes have neither a pose of this source nor a link to a node "
                               "with a pose; they are skipped");
  }
  warn_of_contradictions(run);
  run.report({.name = "start: " + initial.source});
}

void find_frames(Run& run, const FeatureCache& cache) {
  RefinementInput& input = run.input;
  const RefinementOptions& options = input.options;
  RefinementResult& result = run.result;
  std::vector<int> nodes;
  for (const auto& [node, pose] : run.state.poses) nodes.push_back(node);
  nodes.insert(nodes.end(), input.odometry_nodes.begin(), input.odometry_nodes.end());
  std::sort(nodes.begin(), nodes.end());
  FeatureResult found = find_features(input.scan, nodes, options.features, input.progress, &cache);
  check_known_lengths(found.frames, options.known_lengths);
  result.skipped = std::move(found.skipped);
  std::size_t without_depth = 0;
  for (const FrameFeatures& frame : found.frames) {
    result.features += frame.features.size();
    without_depth += frame.without_depth;
  }
  if (!found.frames.empty()) result.cameras = found.frames.front().cameras;
  run.state.frames = run.state.stored_frames =
      std::make_shared<std::vector<FrameFeatures>>(std::move(found.frames));
  const std::vector<FrameFeatures>& frames = *run.state.frames;
  run.report({.name = "features",
              .metrics = {{"frames", frames.size()},
                          {"features", result.features},
                          {"without_depth", without_depth}}});
  if (!options.board) return;
  input.board_views = find_boards(input.scan, frames, *options.board, input.progress);
  run.report({.name = "board", .metrics = {{"images", input.board_views.size()}}});
}

// Computes poses of all nodes by visual odometry and links; stage names end with the suffix.
void link_frames(Run& run, const std::string& suffix = {}) {
  const RefinementInput& input = run.input;
  RefinementState& state = run.state;
  const auto named = [&](StageResult stage) {
    stage.report.name += suffix;
    return stage;
  };
  if (!input.odometry_nodes.empty()) run.accept(named(track_stage(input, state)));
  state.graph = graph_as_stored(input, state);
  for (int round = 0; round <= input.options.rounds; ++round) {
    std::vector<FramePair> pairs;
    for (const FramePair& pair : candidate_pairs(input, state, round))
      if (state.tried_pairs.insert(pair).second) pairs.push_back(pair);
    const std::size_t before = state.feature_links.size();
    if (round > 0 &&
        static_cast<double>(pairs.size()) <= settled_fraction * static_cast<double>(before))
      break;
    if (pairs.empty()) continue;
    StageResult stage = named(link_stage(input, state, round, pairs));
    const std::size_t fresh = stage.state.feature_links.size() - before;
    if (run.propose(std::move(stage)))
      run.result.stages.back().metrics.emplace_back("rejected_by_optimization",
                                                    drop_rejected_links(state));
    if (round > 0 && static_cast<double>(fresh) <= settled_fraction * static_cast<double>(before))
      break;
  }
  state.information = link_system(state.poses, state.graph.links);
}

// Tracks and links frames again, because an uncorrected rolling shutter causes lost frames.
void link_again(Run& run) {
  RefinementState before = run.state;
  run.state.poses = run.input.start;
  run.state.parts = run.input.start_parts;
  run.state.feature_links.clear();
  run.state.tried_pairs.clear();
  std::erase_if(run.state.other_links, is_by_depth);
  link_frames(run, " again");
  StageResult stage{.state = std::exchange(run.state, std::move(before)),
                    .report = {.name = "tracking again"}};
  const auto lost = [&](const RefinementState& state) {
    return unjoined(run.input, state, state.parts).size();
  };
  stage.report.rejected = lost(stage.state) > lost(run.state);
  if (!run.propose(std::move(stage)))
    run.state.feature_links = rematched_links(run.input, run.state);
}

// Replaces the assumed depth noise by the noise of the held-out depth. Returns true if replaced.
bool adapt_noise(Run& run) {
  RefinementState& state = run.state;
  const RefinementOptions& options = run.input.options;
  if (is_noise_given(options.sensor, options.features.planes.noise)) {
    run.result.noise = "depth noise " + describe(state.noise) + " as given";
    return false;
  }
  ScanNoise chosen =
      choose_noise(surface_residuals(*state.frames, state.feature_links, state.poses), state.noise);
  run.result.noise = std::move(chosen.sentence);
  if (!chosen.is_estimated) return false;
  for (const SharedFrames& frames : {state.frames, state.stored_frames}) {
    for (FrameFeatures& frame : *frames) set_depth_noise(frame, state.noise, chosen.noise);
    if (state.frames == state.stored_frames) break;
  }
  state.noise = chosen.noise;
  return true;
}

// Repeats calibration and matching, because a wrong stored calibration hides matches.
void calibrate_sensor(Run& run) {
  RefinementState& state = run.state;
  for (int pass = 1; pass <= max_calibrations; ++pass) {
    const SensorCalibration last = state.calibration;
    RefinementState stored = state;
    stored.frames = stored.stored_frames;
    StageResult stage = calibrate_stage(run.input, stored);
    stage.report.name = pass == 1 ? "calibration" : "calibration " + std::to_string(pass);
    const bool accepted = run.propose(std::move(stage), stored);
    const bool is_other_noise = pass == 1 && run.result.noise.empty() && adapt_noise(run);
    if (!accepted) {
      if (is_other_noise) {
        run.propose(bundle_stage(run.input, state));
        return calibrate_sensor(run);
      }
      if (pass == 1) return;
      break;
    }
    if (pass == max_calibrations ||
        (pass > 1 &&
         is_similar_registration(last, state.calibration, settled_m, settled_rad, settled_s)))
      break;
    const bool was_lost =
        !state.losses.empty() ||
        std::any_of(state.other_links.begin(), state.other_links.end(), is_by_depth);
    if (pass == 1 && !state.calibration.timing.empty() && was_lost)
      link_again(run);
    else
      state.feature_links = rematched_links(run.input, state);
  }
  state.information = information_of(run.input, state);
  state.is_from_bundle = true;
}

void drop_descriptors(RefinementState& state) {
  for (const SharedFrames& frames : {state.frames, state.stored_frames})
    for (FrameFeatures& frame : *frames) frame.descriptors = {};
}

// Restores the initial poses if the held-out observations fit them better than the final ones.
// This is impossible for a scan with nodes without initial poses.
void keep_start_if_better(const RefinementInput& input, RefinementState& state) {
  if (!input.odometry_nodes.empty() || input.start.size() != state.poses.size()) return;
  const HeldOutEvaluation whole =
      evaluate_held_out(held_out_costs(*state.stored_frames, state.feature_links, input.start),
                        costs_at(state, state.feature_links));
  if (whole.change() > 2.0 * whole.deviation()) {
    state.poses = input.start;
    state.calibration = {};
    state.warnings.push_back(
        "held-out observations fit the initial poses better; initial poses and stored camera are "
        "kept");
  } else if (whole.matches.after > explained_cost) {
    state.warnings.push_back(
        "residuals of held-out matches exceed the noise: the sensor has errors that the "
        "calibration does not model");
  }
}

// Covariances of the nodes' poses, in units of the depth camera.
std::map<int, Matrix6d> covariances(const RefinementInput& input, const RefinementState& state,
                                    const CalibrationMoves& moves) {
  input.progress.begin("covariances", 0);
  const GraphCovariance covariance(state.poses, state.information, state.graph.components);
  input.progress.end();
  const double scale =
      state.is_from_bundle ? std::max(1.0, min_deviation_scale / state.deviation_scale) : 1.0;
  std::map<int, Matrix6d> of_nodes;
  if (!covariance.valid()) return of_nodes;
  for (const auto& [node, pose] : state.poses) {
    if (node <= 0) continue;
    Matrix6d of_node = covariance.of_node(node);
    if (const auto of_calibration = moves.find(node); of_calibration != moves.end())
      for (const Vector6d& move : of_calibration->second) of_node += move * move.transpose();
    of_nodes[node] = scale * scale * of_node;
  }
  return of_nodes;
}

// Drops the nodes of unjoined(): their poses relative to the others are undetermined.
void drop_unjoined(const RefinementInput& input, const RefinementState& state,
                   RefinementResult& result) {
  std::vector<std::vector<int>> parts;
  for (const GraphComponent& component : result.components) parts.push_back(component.nodes);
  std::vector<int> left = unjoined(input, state, parts);
  const auto kept = std::count_if(parts.begin(), parts.end(), [&](const auto& part) {
    return std::find(left.begin(), left.end(), part.front()) == left.end();
  });
  if (kept > 1)
    result.warnings.push_back("no link connects " + std::to_string(kept) +
                              " parts of the scan; the relative poses of these parts are unknown");
  if (input.odometry_nodes.empty() && !input.options.one_map) return;
  for (const int node : left) result.covariance.erase(node);
  std::sort(left.begin(), left.end());
  std::erase_if(left, [](int node) { return node < 0; });
  const auto is_left = [&](int node) { return std::binary_search(left.begin(), left.end(), node); };
  const auto leaves = [&](const PoseLink& link) { return is_left(link.from); };
  std::erase_if(result.poses, [&](const TrajectoryPose& pose) { return is_left(pose.node); });
  std::erase_if(result.links, leaves);
  std::erase_if(result.closures, leaves);
  for (const auto& [node, reason] : result.skipped)
    if (input.odometry_nodes.contains(node)) left.push_back(node);
  std::sort(left.begin(), left.end());
  if (!left.empty())
    result.warnings.push_back("nodes are skipped, because no link connects them to the others: " +
                              join_numbers(left));
  result.without_pose = std::move(left);
}

RefinementResult finish(const RefinementInput& input, RefinementState state,
                        RefinementResult result) {
  result.poses = trajectory_at(input.scan.graph(), state.poses);
  for (std::size_t n = 0; n < state.graph.links.size(); ++n) {
    const GraphLinkResult& link = state.graph.links[n];
    if (!link.rejected && n >= state.other_links.size()) result.closures.push_back(link.link);
    (link.rejected ? result.rejected_links : result.links).push_back(link.link);
  }
  result.calibration = std::move(state.calibration);
  add_registration(input.color_from_depth, result.cameras.size(), result.calibration);
  result.findings = findings(result.calibration, result.deviations, result.cameras);
  if (!(input.options.features.planes.noise == state.noise))
    result.findings.push_back(result.noise);
  result.components = std::move(state.graph.components);
  result.without_links = std::move(state.graph.without_links);
  result.warnings = std::move(state.warnings);
  result.losses = std::move(state.losses);
  if (!result.losses.empty())
    result.warnings.push_back("visual odometry lost track: " + describe(result.losses));
  drop_unjoined(input, state, result);
  return result;
}

// Links frames without feature links by their depth.
void link_by_depth(Run& run) {
  std::set<std::size_t> linked;
  for (const FeatureLink& link : run.state.feature_links) {
    linked.insert(link.frames.first);
    linked.insert(link.frames.second);
  }
  if (linked.size() == run.state.frames->size() || run.input.options.icp.mode == IcpMode::off)
    return;
  StageResult stage = depth_link_stage(run.input, run.state);
  if (stage.report.closures.candidates == 0) return;
  if (run.propose(std::move(stage)))
    run.result.stages.back().metrics.emplace_back("rejected_by_optimization",
                                                  drop_rejected_links(run.state));
}

bool may_calibrate(const RefinementOptions& options) {
  return options.intrinsics != IntrinsicsMode::fixed || options.correct_depth ||
         options.register_depth || options.estimate_timing;
}

bool has_matches(const RefinementState& state) {
  return std::any_of(state.feature_links.begin(), state.feature_links.end(),
                     [](const FeatureLink& link) { return !link.matches.empty(); });
}

// Requires links of the scan if there are no feature links.
void require_other_links(Run& run) {
  const RefinementState& state = run.state;
  if (is_all_tracked(run.input, state) && state.other_links.empty()) {
    if (state.frames->empty() && !run.result.skipped.empty())
      throw run.result.skipped.front().second;
    throw Error("no two images match, and the scan has no links: the poses are undetermined",
                {.field = "frames", .value = std::to_string(state.frames->size())});
  }
  run.state.warnings.push_back(
      "no two frames could be matched by features: the poses depend on the scan's own links only");
}

}  // namespace

RefinementResult refine_poses(const ScanSource& given_scan, const RefinementOptions& given,
                              Progress& progress, const FeatureCache& cache) {
  const RefinementOptions options = with_sensor(given);
  const CoarseRegistration coarse = register_coarsely(given_scan, options.register_depth);
  const ScanSource& scan = coarse.scan ? *coarse.scan : given_scan;
  Run run{.input = {scan, options, progress}};
  run.input.color_from_depth = coarse.color_from_depth;
  RefinementState& state = run.state;
  state.noise = options.features.planes.noise;
  if (!coarse.finding.empty()) state.warnings.push_back(coarse.finding);
  start(run);
  require_one_scale(options);
  find_frames(run, cache);
  KnownMatches matches;
  run.input.known_matches = &matches;
  link_frames(run);
  link_by_depth(run);
  CalibrationMoves moves;
  if (state.feature_links.empty()) {
    require_other_links(run);
  } else {
    const bool bundle = options.bundle && has_matches(state);
    if (bundle) run.propose(bundle_stage(run.input, state));
    if (bundle && may_calibrate(options)) calibrate_sensor(run);
    drop_descriptors(state);
    matches.clear();
    if (options.icp.mode != IcpMode::off) run.propose(surface_stage(run.input, state));
    keep_start_if_better(run.input, state);
    moves = calibration_moves(run.input, state, run.result.deviations);
  }
  run.result.covariance = covariances(run.input, state, moves);
  ScaleResult scale = scale_stage(run.input, state, run.result.covariance, moves);
  run.result.scale = std::move(scale.sentence);
  if (scale.stage) run.accept(std::move(*scale.stage));
  return finish(run.input, std::move(run.state), std::move(run.result));
}

}  // namespace libmap
