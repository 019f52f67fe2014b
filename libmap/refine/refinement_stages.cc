#include "libmap/refine/refinement_stages.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "libmap/core/parallel.h"
#include "libmap/optimize/graph_links.h"

namespace libmap {

namespace {

constexpr const char* feature_group = "features";
constexpr const char* odometry_group = "visual odometry";

std::vector<GraphLink> all_links(const RefinementState& state) {
  std::vector<GraphLink> all = state.other_links;
  for (const FeatureLink& link : state.feature_links) {
    const bool odometry = link.link.type == LinkType::neighbor;
    all.push_back({link.link, odometry ? odometry_group : feature_group, !odometry});
  }
  return all;
}

}  // namespace

StageResult track_stage(const RefinementInput& input, const RefinementState& state) {
  const RefinementOptions& options = input.options;
  TrackingStart known{{}, state.poses, state.parts, {}};
  for (const GraphNode& node : input.scan.graph().nodes) {
    known.session[node.id] = node.session;
    if (node.odometry_from_base) known.first[node.id] = *node.odometry_from_base;
  }
  VisualOdometryResult tracked = track_frames(*state.frames, known, options.closures,
                                              options.odometry, options.seed, input.progress);
  StageResult result{.state = state, .report = {.name = "odometry"}};
  RefinementState& next = result.state;
  next.poses = std::move(tracked.map_from_base);
  next.parts = std::move(tracked.parts);
  next.feature_links = std::move(tracked.links);
  for (const PoseLink& link : tracked.depth_links)
    next.other_links.push_back({link, depth_link_group});
  next.tried_pairs = std::move(tracked.tried_pairs);
  next.losses = std::move(tracked.losses);
  result.report.metrics = {{"frames", input.odometry_nodes.size()},
                           {"key_frames", tracked.key_frames.size()},
                           {"links", next.feature_links.size()},
                           {"tracked_by_depth", tracked.depth_links.size()},
                           {"lost_nodes", next.losses.size()},
                           {"relocalized", tracked.relocalized},
                           {"parts", next.parts.size()}};
  const LinkConsistency consistency = link_consistency(
      next.feature_links, trajectory_of(input.scan.graph(), PoseSource::ground_truth));
  if (consistency.links > 0)
    result.report.metrics.emplace_back("squared_error_per_freedom",
                                       consistency.squared_error_per_freedom);
  return result;
}

PoseGraphResult graph_as_stored(const RefinementInput& input, const RefinementState& state) {
  PoseGraphOptions options = input.options.graph;
  options.recalibrate = false;
  return optimize_pose_graph(state.poses, all_links(state), options);
}

std::set<FramePair> candidate_pairs(const RefinementInput& input, const RefinementState& state,
                                    int round) {
  const LoopClosureDetectionOptions& options = input.options.closures;
  const std::vector<GraphComponent>& components = state.graph.components;
  if (round == 0) return consecutive_pairs(*state.frames, options.neighbors);
  std::set<FramePair> pairs = near_pairs(*state.frames, state.poses, components, options);
  if (round == 1)
    pairs.merge(similar_pairs(*state.frames, components, options, input.options.seed));
  return pairs;
}

StageResult link_stage(const RefinementInput& input, const RefinementState& state, int round,
                       const std::vector<FramePair>& pairs) {
  const RefinementOptions& options = input.options;
  StageResult result{.state = state};
  StageReport& report = result.report;
  report.name = round == 0 ? "neighbors" : "closures " + std::to_string(round);
  PairVerification verified = verify_pairs(*state.frames, pairs, options.closures, options.seed,
                                           input.progress, input.known_matches);
  report.closures = verified.counts;
  check_against_graph(verified.links, state.graph, options.closures, report.closures);
  RefinementState& next = result.state;
  std::vector<PoseLink> links;
  for (const FeatureLink& link : verified.links) links.push_back(link.link);
  next.feature_links.insert(next.feature_links.end(),
                            std::make_move_iterator(verified.links.begin()),
                            std::make_move_iterator(verified.links.end()));
  // Newly connected parts must be in one frame before the graph is optimized.
  if (next.parts.size() > 1) next.parts = join_parts(next.poses, next.parts, links);
  input.progress.begin("pose graph", 0);
  next.graph = optimize_pose_graph(next.poses, all_links(next), options.graph);
  input.progress.end();
  next.poses = next.graph.map_from_base;
  report.groups = next.graph.groups;
  return result;
}

StageResult depth_link_stage(const RefinementInput& input, const RefinementState& state) {
  const RefinementOptions& options = input.options;
  const std::vector<FrameFeatures>& frames = *state.frames;
  StageResult result{.state = state, .report = {.name = "links by depth"}};
  RefinementState& next = result.state;
  std::vector<bool> linked(frames.size(), false);
  for (const FeatureLink& link : state.feature_links)
    linked[link.frames.first] = linked[link.frames.second] = true;
  std::set<FramePair> candidates = consecutive_pairs(frames, options.closures.neighbors);
  candidates.merge(near_pairs(frames, state.poses, state.graph.components, options.closures));
  std::vector<FramePair> pairs;
  for (const FramePair& pair : candidates)
    if ((!linked[pair.first] || !linked[pair.second]) &&
        state.poses.contains(frames[pair.first].node) &&
        state.poses.contains(frames[pair.second].node))
      pairs.push_back(pair);
  std::vector<std::optional<PoseLink>> found(pairs.size());
  input.progress.begin("links by depth", pairs.size());
  parallel_each(pairs.size(), [&](std::size_t n) {
    const FrameFeatures& a = frames[pairs[n].first];
    const FrameFeatures& b = frames[pairs[n].second];
    found[n] = align_pair(a, b, state.poses.at(a.node).inverse() * state.poses.at(b.node));
    input.progress.advance(1);
  });
  input.progress.end();
  std::vector<FeatureLink> links;
  for (std::size_t n = 0; n < pairs.size(); ++n) {
    if (!found[n]) continue;
    if (pairs[n].second > pairs[n].first + 1) found[n]->type = LinkType::local_space_closure;
    links.push_back({.frames = pairs[n], .link = *found[n]});
  }
  RejectionCounts& counts = result.report.closures;
  counts.candidates = pairs.size();
  counts.not_converged = pairs.size() - links.size();
  counts.accepted = links.size();
  check_against_graph(links, state.graph, options.closures, counts);
  next.feature_links.insert(next.feature_links.end(), links.begin(), links.end());
  next.graph = optimize_pose_graph(next.poses, all_links(next), options.graph);
  next.poses = next.graph.map_from_base;
  next.information = link_system(next.poses, next.graph.links);
  result.report.groups = next.graph.groups;
  result.report.rejected = links.empty();
  return result;
}

std::size_t drop_rejected_links(RefinementState& state) {
  std::vector<GraphLinkResult>& links = state.graph.links;
  const auto first_of_features =
      links.begin() + static_cast<std::ptrdiff_t>(state.other_links.size());
  auto link = first_of_features;
  const std::size_t dropped =
      std::erase_if(state.feature_links, [&](const FeatureLink&) { return (link++)->rejected; });
  links.erase(std::remove_if(first_of_features, links.end(),
                             [](const GraphLinkResult& result) { return result.rejected; }),
              links.end());
  return dropped;
}

StageResult bundle_stage(const RefinementInput& input, const RefinementState& state) {
  BundleAdjustmentResult adjusted =
      adjust_bundle(*state.frames, state.feature_links, state.poses, state.results_of_other_links(),
                    state.graph.components, input.options.bundle_adjustment, {}, input.progress);
  StageResult result{.state = state, .report = {.name = "bundle adjustment"}};
  result.report.rejected = !adjusted.converged;
  result.report.metrics = {
      {"tracks", adjusted.tracks},          {"observations", adjusted.observations},
      {"conflicts", adjusted.conflicts},    {"outliers", adjusted.outliers},
      {"iterations", adjusted.iterations},  {"initial_cost", adjusted.initial_cost},
      {"final_cost", adjusted.final_cost},  {"reprojection_rms_px", adjusted.reprojection_rms_px},
      {"depth_rms_m", adjusted.depth_rms_m}};
  result.state.poses = std::move(adjusted.map_from_base);
  result.state.information = std::move(adjusted.information);
  result.state.is_from_bundle = true;
  return result;
}

StageResult surface_stage(const RefinementInput& input, const RefinementState& state) {
  const IcpOptions& options = input.options.icp;
  std::vector<PoseLink> links;
  for (const GraphLinkResult& link : state.graph.links)
    if (!link.rejected) links.push_back(link.link);
  IcpResult aligned = align_surfaces(*state.frames, state.poses, state.information,
                                     state.graph.components, links, options, input.progress);
  StageResult result{.state = state};
  result.report.name = options.mode == IcpMode::links ? "surfaces of links" : "surfaces";
  result.report.metrics = {{"pairs", aligned.pairs},
                           {"samples", aligned.samples},
                           {"degenerate_directions", aligned.degenerate_directions},
                           {"iterations", aligned.iterations},
                           {"initial_rms_m", aligned.initial_rms_m},
                           {"final_rms_m", aligned.final_rms_m},
                           {"deviation_scale", aligned.deviation_scale}};
  RefinementState& next = result.state;
  next.poses = std::move(aligned.map_from_base);
  next.information = std::move(aligned.information);
  next.surface_pairs = std::move(aligned.frame_pairs);
  next.surface_distance_m = aligned.max_distance_m;
  next.deviation_scale = aligned.deviation_scale;
  // Motions were estimated for the former poses.
  if (!next.calibration.timing.empty()) {
    const std::vector<GraphLinkResult> others = next.results_of_other_links();
    estimate_motions(calibration_input(input, next, others), true, next.calibration);
    next.frames = calibrated(*next.stored_frames, next.calibration);
  }
  return result;
}

}  // namespace libmap
