#include "libmap/refine/refinement.h"

#include <algorithm>
#include <ctime>
#include <iterator>
#include <set>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/refine/graph_covariance.h"
#include "libmap/refine/refinement_work.h"

namespace libmap {

namespace {

constexpr const char* feature_group = "features";
constexpr double settled_share = 0.01;  // new links of those before: with less, rounds end
constexpr const char* odometry_group = "visual odometry";
// Features err alike in the pictures of one place, which no residual shows: measured on simulated
// scans.
constexpr double min_deviation_scale = 1.3;

// Says how two nodes lie to each other.
bool is_motion(const PoseLink& link) {
  return link.from > 0 && link.to > 0 && link.from != link.to;
}

// "3, 5, 6, 10-40": of ten or more in a row the ends.
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

}  // namespace

Trajectory Refinement::trajectory(const std::map<int, Pose>& poses) const {
  Trajectory trajectory;
  for (const auto& [node, pose] : poses)
    if (const GraphNode* known = node > 0 ? scan_.graph().find_node(node) : nullptr)
      trajectory.push_back({node, known->stamp_s, pose});
  return trajectory;
}

std::optional<StageError> Refinement::error_of(const std::map<int, Pose>& poses) const {
  if (truth_.empty()) return std::nullopt;
  std::map<int, Pose> joined = poses;
  for (const int node : unjoined(parts_)) joined.erase(node);
  try {
    const Trajectory estimate = trajectory(joined);
    return StageError{absolute_trajectory_error(estimate, truth_),
                      relative_trajectory_error(estimate, truth_)};
  } catch (const Error&) {
    return std::nullopt;  // fewer than three poses in common
  }
}

bool Refinement::evaluate(StageReport& stage, const std::map<int, Pose>& before,
                          const std::map<int, Pose>& after) const {
  stage.held_out = evaluate_held_out(held_out_costs(frames_, links_, before),
                                     held_out_costs(frames_, links_, after));
  stage.rejected = stage.held_out.is_worse();
  if (stage.rejected) stage.rejected_error = error_of(after);
  return stage.rejected;
}

void Refinement::close(StageReport stage) {
  const auto now = Clock::now();
  stage.seconds = std::chrono::duration<double>(now - stage_begin_).count();
  stage_begin_ = now;
  const std::clock_t clock = std::clock();
  stage.processor_seconds =
      static_cast<double>(clock - processor_begin_) / static_cast<double>(CLOCKS_PER_SEC);
  processor_begin_ = clock;
  stage.error = error_of(poses_);
  result_.stages.push_back(std::move(stage));
}

void Refinement::start() {
  const int gauge = options_.graph.gauge_node;
  if (gauge != 0 && scan_.graph().find_node(gauge) == nullptr)
    throw Error("the scan has no such node",
                {.field = "gauge_node", .value = std::to_string(gauge)});
  InitialPoses initial = initial_poses(scan_.graph(), options_.start);
  poses_ = start_ = std::move(initial.map_from_base);
  parts_ = start_parts_ = std::move(initial.parts);
  result_.without_pose = std::move(initial.without_pose);
  stored_ = stored_links(scan_.graph());
  if (options_.start == StartPoses::visual)
    std::erase_if(stored_, [](const GraphLink& link) { return is_motion(link.link); });
  drop_unusable(stored_, result_.warnings);
  if (stored_.empty() && options_.start != StartPoses::visual)
    stored_ = odometry_links(scan_.graph());
  if (may_be_visual()) {
    tracked_.insert(result_.without_pose.begin(), result_.without_pose.end());
    result_.without_pose.clear();
  } else if (!result_.without_pose.empty()) {
    result_.warnings.push_back(std::to_string(result_.without_pose.size()) +
                               " nodes have no pose, by odometry or by links: they are left out");
  }
  StageReport stage;
  stage.name = "start: " + initial.source;
  close(std::move(stage));
}

void Refinement::find_frames() {
  if (options_.board && !options_.known_lengths.empty())
    throw Error("known lengths determine the scale already", {.field = "board"});
  if (options_.scale != 1.0 && (options_.board || !options_.known_lengths.empty() ||
                                options_.scale_from == ScaleSource::odometry))
    throw Error("the scale is determined in two ways",
                {.field = "scale",
                 .value = to_text(options_.scale),
                 .bound = "1 with known lengths, a board or the scale from odometry"});
  std::vector<int> nodes;
  for (const auto& [node, pose] : poses_) nodes.push_back(node);
  nodes.insert(nodes.end(), tracked_.begin(), tracked_.end());
  std::sort(nodes.begin(), nodes.end());
  FeatureResult found = find_features(scan_, nodes, options_.features, progress_, &cache_);
  frames_ = std::move(found.frames);
  result_.skipped = std::move(found.skipped);
  check_known_lengths(frames_, options_.known_lengths);
  std::size_t without_depth = 0;
  for (const FrameFeatures& frame : frames_) {
    result_.features += frame.features.size();
    without_depth += frame.without_depth;
  }
  if (!frames_.empty()) result_.cameras = frames_.front().cameras;
  StageReport stage;
  stage.name = "features";
  stage.figures = {{"frames", static_cast<double>(frames_.size())},
                   {"features", static_cast<double>(result_.features)},
                   {"without_depth", static_cast<double>(without_depth)}};
  close(std::move(stage));
  if (!options_.board) return;
  board_views_ = find_boards(scan_, frames_, *options_.board, progress_);
  stage = {};
  stage.name = "board";
  stage.figures = {{"pictures", static_cast<double>(board_views_.size())}};
  close(std::move(stage));
}

// Of nodes that neither poses nor links place. Its motions are links of features like all others.
void Refinement::odometry() {
  if (tracked_.empty()) return;
  TrackingStart known{{}, poses_, parts_, {}};
  for (const GraphNode& node : scan_.graph().nodes) {
    known.session[node.id] = node.session;
    if (node.odometry_from_base) known.first[node.id] = *node.odometry_from_base;
  }
  VisualOdometryResult tracked =
      track_frames(frames_, known, options_.closures, options_.odometry, options_.seed, progress_);
  poses_ = std::move(tracked.map_from_base);
  parts_ = std::move(tracked.parts);
  links_ = std::move(tracked.links);
  for (const PoseLink& link : tracked.depth_links) stored_.push_back({link, depth_group});
  tried_ = std::move(tracked.tried);
  result_.losses = std::move(tracked.losses);
  StageReport stage;
  stage.name = "odometry" + again_;
  stage.figures = {{"frames", static_cast<double>(tracked_.size())},
                   {"key_frames", static_cast<double>(tracked.key_frames.size())},
                   {"links", static_cast<double>(links_.size())},
                   {"tracked_by_depth", static_cast<double>(tracked.depth_links.size())},
                   {"lost_nodes", static_cast<double>(result_.losses.size())},
                   {"relocalized", static_cast<double>(tracked.relocalized)},
                   {"parts", static_cast<double>(parts_.size())}};
  const LinkConsistency consistency = link_consistency(links_, truth_);
  if (consistency.links > 0)
    stage.figures.emplace_back("squared_error_per_freedom", consistency.squared_error_per_freedom);
  close(std::move(stage));
}

// Parts that visual odometry has begun and nothing has joined lie anywhere; so do all but the
// largest, where one map is wanted.
std::vector<int> Refinement::unjoined(const std::vector<std::vector<int>>& parts) const {
  std::vector<int> left;
  if (tracked_.empty() && !options_.one_map) return left;
  const bool nothing_known = is_all_tracked();
  const auto largest = std::max_element(
      parts.begin(), parts.end(), [](const auto& a, const auto& b) { return a.size() < b.size(); });
  for (auto part = parts.begin(); part != parts.end(); ++part) {
    const bool alone = std::all_of(part->begin(), part->end(),
                                   [&](int node) { return node < 0 || tracked_.contains(node); });
    if (options_.one_map ? part != largest : alone && !(part == largest && nothing_known))
      left.insert(left.end(), part->begin(), part->end());
  }
  return left;
}

void Refinement::leave_out_unjoined() {
  if (!result_.losses.empty())
    result_.warnings.push_back("visual odometry lost its way: " + describe(result_.losses));
  std::vector<std::vector<int>> parts;
  for (const GraphComponent& component : result_.components) parts.push_back(component.nodes);
  std::vector<int> left = unjoined(parts);
  const auto kept = std::count_if(parts.begin(), parts.end(), [&](const auto& part) {
    return std::find(left.begin(), left.end(), part.front()) == left.end();
  });
  if (kept > 1)
    result_.warnings.push_back(
        "the scan is in " + std::to_string(kept) +
        " parts that no link joins: their poses say nothing about each other");
  if (tracked_.empty() && !options_.one_map) return;
  for (const int node : left) result_.covariance.erase(node);
  std::sort(left.begin(), left.end());
  std::erase_if(left, [](int node) { return node < 0; });
  std::erase_if(result_.poses, [&](const TrajectoryPose& pose) {
    return std::binary_search(left.begin(), left.end(), pose.node);
  });
  std::erase_if(result_.links, [&](const PoseLink& link) {
    return std::binary_search(left.begin(), left.end(), link.from);
  });
  std::erase_if(result_.closures, [&](const PoseLink& link) {
    return std::binary_search(left.begin(), left.end(), link.from);
  });
  for (const auto& [node, reason] : result_.skipped)
    if (tracked_.contains(node)) left.push_back(node);
  std::sort(left.begin(), left.end());
  if (!left.empty())
    result_.warnings.push_back("left out, since nothing joins them to the rest: nodes " +
                               join_numbers(left));
  result_.without_pose = std::move(left);
}

// First frames that follow each other: they say how good the odometry is. Then what looks alike,
// then what is near by the poses of the last round.
std::vector<FramePair> Refinement::candidates(int number) {
  std::set<FramePair> pairs;
  if (number == 0) {
    pairs = consecutive_pairs(frames_, options_.closures.neighbors);
  } else {
    pairs = near_pairs(frames_, poses_, graph_.components, options_.closures);
    if (number == 1)
      pairs.merge(similar_pairs(frames_, graph_.components, options_.closures, options_.seed));
  }
  std::vector<FramePair> fresh;
  for (const FramePair& pair : pairs)
    if (tried_.insert(pair).second) fresh.push_back(pair);
  return fresh;
}

std::vector<GraphLink> Refinement::with_features(const std::vector<FeatureLink>& links) const {
  std::vector<GraphLink> all = stored_;
  for (const FeatureLink& link : links) {
    const bool odometry = link.link.type == LinkType::neighbor;
    all.push_back({link.link, odometry ? odometry_group : feature_group, !odometry});
  }
  return all;
}

// Parts that closures connect get into one frame before the graph is optimized; the links before
// `first` are not new.
void Refinement::join_new(std::size_t first) {
  if (parts_.size() < 2) return;
  std::vector<PoseLink> between;
  for (std::size_t n = first; n < links_.size(); ++n) between.push_back(links_[n].link);
  parts_ = join_parts(poses_, parts_, between);
}

// False if there was nothing new to try, or hardly any link was new.
bool Refinement::round(int number) {
  const std::vector<FramePair> pairs = candidates(number);
  if (pairs.empty()) return false;
  StageReport stage;
  stage.name = (number == 0 ? "neighbors" : "closures " + std::to_string(number)) + again_;
  PairVerification verified =
      verify_pairs(frames_, pairs, options_.closures, options_.seed, progress_, matches_to_keep());
  stage.closures = verified.counts;
  check_against_graph(verified.links, graph_, options_.closures, stage.closures);
  const std::size_t before = links_.size();
  const std::map<int, Pose> poses_before = poses_;
  const auto parts_before = parts_;
  const std::size_t fresh = verified.links.size();
  links_.insert(links_.end(), std::make_move_iterator(verified.links.begin()),
                std::make_move_iterator(verified.links.end()));
  join_new(before);
  progress_.begin("pose graph", 0);
  PoseGraphResult graph = optimize_pose_graph(poses_, with_features(links_), options_.graph);
  progress_.end();
  stage.groups = graph.groups;
  if (evaluate(stage, poses_before, graph.map_from_base)) {
    links_.resize(before);
    poses_ = poses_before;
    parts_ = parts_before;
  } else {
    // Those that the optimization has rejected do not come back.
    std::size_t place = stored_.size();
    const std::size_t rejected =
        std::erase_if(links_, [&](const FeatureLink&) { return graph.links[place++].rejected; });
    stage.figures.emplace_back("rejected_by_optimization", static_cast<double>(rejected));
    std::vector<GraphLinkResult> results(
        graph.links.begin(), graph.links.begin() + static_cast<std::ptrdiff_t>(stored_.size()));
    for (std::size_t n = stored_.size(); n < graph.links.size(); ++n)
      if (!graph.links[n].rejected) results.push_back(graph.links[n]);
    graph.links = std::move(results);
    poses_ = graph.map_from_base;
    graph_ = std::move(graph);
  }
  close(std::move(stage));
  return static_cast<double>(fresh) > settled_share * static_cast<double>(before);
}

void Refinement::bundle() {
  StageReport stage;
  stage.name = "bundle adjustment";
  BundleAdjustmentResult adjusted =
      adjust_bundle(frames_, links_, poses_, without_features(graph_.links, stored_.size()),
                    graph_.components, options_.bundle_adjustment, {}, progress_);
  evaluate(stage, poses_, adjusted.map_from_base);
  stage.rejected = stage.rejected || !adjusted.converged;
  stage.figures = {{"tracks", static_cast<double>(adjusted.tracks)},
                   {"observations", static_cast<double>(adjusted.observations)},
                   {"conflicts", static_cast<double>(adjusted.conflicts)},
                   {"outliers", static_cast<double>(adjusted.outliers)},
                   {"iterations", static_cast<double>(adjusted.iterations)},
                   {"initial_cost", adjusted.initial_cost},
                   {"final_cost", adjusted.final_cost},
                   {"reprojection_rms_px", adjusted.reprojection_rms_px},
                   {"depth_rms_m", adjusted.depth_rms_m}};
  if (!stage.rejected) {
    poses_ = std::move(adjusted.map_from_base);
    information_ = std::move(adjusted.information);
    by_observations_ = true;
  }
  close(std::move(stage));
}

void Refinement::icp() {
  StageReport stage;
  stage.name = options_.icp.mode == IcpMode::links ? "surfaces of links" : "surfaces";
  std::vector<PoseLink> links;
  for (const GraphLinkResult& link : graph_.links)
    if (!link.rejected) links.push_back(link.link);
  IcpResult aligned = align_surfaces(frames_, poses_, information_, graph_.components, links,
                                     options_.icp, progress_);
  const HeldOutCosts before = held_out_costs(frames_, links_, poses_);
  const SensorCalibration calibration = result_.calibration;
  move_frames(aligned.map_from_base);
  stage.held_out =
      evaluate_held_out(before, held_out_costs(frames_, links_, aligned.map_from_base));
  stage.rejected = stage.held_out.is_worse();
  if (stage.rejected) {
    stage.rejected_error = error_of(aligned.map_from_base);
    calibrate_frames(calibration);
  }
  stage.figures = {{"pairs", static_cast<double>(aligned.pairs)},
                   {"samples", static_cast<double>(aligned.samples)},
                   {"degenerate_directions", static_cast<double>(aligned.degenerate_directions)},
                   {"iterations", static_cast<double>(aligned.iterations)},
                   {"initial_rms_m", aligned.initial_rms_m},
                   {"final_rms_m", aligned.final_rms_m},
                   {"deviation_scale", aligned.deviation_scale}};
  if (!stage.rejected) {
    poses_ = std::move(aligned.map_from_base);
    information_ = std::move(aligned.information);
    surface_pairs_ = std::move(aligned.frame_pairs);
    surface_distance_m_ = aligned.max_distance_m;
    deviation_scale_ = aligned.deviation_scale;
  }
  close(std::move(stage));
}

void Refinement::finish() {
  result_.poses = trajectory(poses_);
  for (std::size_t n = 0; n < graph_.links.size(); ++n) {
    const GraphLinkResult& link = graph_.links[n];
    if (link.rejected) {
      result_.rejected_links.push_back(link.link);
      continue;
    }
    result_.links.push_back(link.link);
    if (n >= stored_.size()) result_.closures.push_back(link.link);
  }
  result_.findings = findings(result_.calibration, result_.cameras);
  result_.components = graph_.components;
  result_.without_links = graph_.without_links;
}

// In units of the depth camera.
void Refinement::find_covariances() {
  progress_.begin("covariances", 0);
  const GraphCovariance covariance(poses_, information_, graph_.components);
  progress_.end();
  const double scale =
      by_observations_ ? std::max(1.0, min_deviation_scale / deviation_scale_) : 1.0;
  if (covariance.valid())
    for (const auto& [node, pose] : poses_) {
      if (node <= 0) continue;
      Matrix6d of_node = covariance.of_node(node);
      if (const auto moves = moves_.find(node); moves != moves_.end())
        for (const Vector6d& move : moves->second) of_node += move * move.transpose();
      result_.covariance[node] = scale * scale * of_node;
    }
}

// From the start.
void Refinement::find_poses() {
  // The parts of stored odometry and links, at the poses of the start: closures are checked
  // against it.
  odometry();
  PoseGraphOptions as_stored = options_.graph;
  as_stored.recalibrate = false;
  graph_ = optimize_pose_graph(poses_, with_features(links_), as_stored);
  for (int number = 0; number <= options_.rounds; ++number)
    if (!round(number) && number > 0) break;
  information_ = link_system(poses_, graph_.links);
}

RefinementResult Refinement::run() {
  start();
  find_frames();
  find_poses();
  if (links_.empty()) {
    if (is_all_tracked() && stored_.empty() && frames_.empty() && !result_.skipped.empty())
      throw result_.skipped.front().second;
    if (is_all_tracked() && stored_.empty())
      throw Error("its pictures give no poses: no two of them could be matched",
                  {.field = "frames", .value = std::to_string(frames_.size())});
    result_.warnings.push_back(
        "no two frames could be matched by features: the poses rest on the other links alone");
  } else {
    if (options_.bundle) bundle();
    if (options_.bundle && (options_.intrinsics != IntrinsicsMode::fixed || options_.correct_depth))
      calibrate_sensor();
    for (FrameFeatures& frame : frames_) frame.descriptors = {};
    known_matches_.clear();
    if (options_.icp.mode != IcpMode::off) icp();
    keep_start_if_better();
    vary_calibration();
  }
  find_covariances();
  find_scale();
  finish();
  leave_out_unjoined();
  return std::move(result_);
}

RefinementResult refine_poses(const ScanSource& scan, const RefinementOptions& options,
                              Progress& progress, const FeatureCache& cache) {
  return Refinement(scan, options, progress, cache).run();
}

}  // namespace libmap
