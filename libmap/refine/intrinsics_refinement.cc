#include "libmap/refine/intrinsics_refinement.h"

#include <algorithm>
#include <deque>
#include <set>
#include <utility>

namespace libmap {

namespace {

// A part of a scan as a scan of its own.
struct Excerpt {
  std::vector<FrameFeatures> frames;
  std::vector<FeatureLink> links;
  std::map<int, Pose> poses;
  std::vector<GraphLinkResult> graph_links;
  std::vector<GraphComponent> components;
};

// Breadth first from the frame with most links.
std::set<std::size_t> joined_frames(std::size_t frames, const std::vector<FeatureLink>& links,
                                    std::size_t most) {
  std::vector<std::vector<std::size_t>> joined(frames);
  for (const FeatureLink& link : links) {
    joined[link.frames.first].push_back(link.frames.second);
    joined[link.frames.second].push_back(link.frames.first);
  }
  const auto first =
      std::max_element(joined.begin(), joined.end(),
                       [](const auto& a, const auto& b) { return a.size() < b.size(); });
  std::set<std::size_t> taken;
  std::deque<std::size_t> next = {static_cast<std::size_t>(first - joined.begin())};
  while (!next.empty() && taken.size() < most) {
    const std::size_t frame = next.front();
    next.pop_front();
    if (!taken.insert(frame).second) continue;
    next.insert(next.end(), joined[frame].begin(), joined[frame].end());
  }
  return taken;
}

Excerpt excerpt_of(const std::vector<FrameFeatures>& frames, const std::vector<FeatureLink>& links,
                   const std::map<int, Pose>& map_from_base,
                   const std::vector<GraphLinkResult>& graph_links,
                   const std::vector<GraphComponent>& components, std::size_t most) {
  Excerpt part;
  std::map<std::size_t, std::size_t> place;
  for (const std::size_t f : joined_frames(frames.size(), links, most)) {
    const auto pose = map_from_base.find(frames[f].node);
    if (pose == map_from_base.end()) continue;
    place.emplace(f, part.frames.size());
    part.frames.push_back(frames[f]);
    part.poses.insert(*pose);
  }
  for (const FeatureLink& link : links) {
    const auto a = place.find(link.frames.first);
    const auto b = place.find(link.frames.second);
    if (a == place.end() || b == place.end()) continue;
    part.links.push_back(link);
    part.links.back().frames = {a->second, b->second};
  }
  for (const GraphLinkResult& link : graph_links)
    if (part.poses.contains(link.link.from) && part.poses.contains(link.link.to))
      part.graph_links.push_back(link);
  for (const GraphComponent& component : components) {
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

IntrinsicsEstimate estimate_from(std::vector<FrameFeatures> frames,
                                 const std::vector<FeatureLink>& links,
                                 const std::map<int, Pose>& map_from_base,
                                 const std::vector<GraphLinkResult>& graph_links,
                                 const std::vector<GraphComponent>& components,
                                 BundleAdjustmentOptions options) {
  options.refine_intrinsics = true;
  IntrinsicsEstimate estimate;
  estimate.frames = frames.size();
  estimate.adjustment =
      adjust_bundle(frames, links, map_from_base, graph_links, components, options);
  const HeldOutCosts before = held_out_costs(frames, links, map_from_base);
  for (FrameFeatures& frame : frames) move_intrinsics(frame, estimate.adjustment.intrinsics);
  estimate.held_out =
      evaluate_held_out(before, held_out_costs(frames, links, estimate.adjustment.map_from_base));
  return estimate;
}

}  // namespace

IntrinsicsEstimate estimate_intrinsics(const std::vector<FrameFeatures>& frames,
                                       const std::vector<FeatureLink>& links,
                                       const std::map<int, Pose>& map_from_base,
                                       const std::vector<GraphLinkResult>& graph_links,
                                       const std::vector<GraphComponent>& components,
                                       const BundleAdjustmentOptions& options,
                                       std::size_t max_frames) {
  if (frames.size() <= max_frames)
    return estimate_from(frames, links, map_from_base, graph_links, components, options);
  Excerpt part = excerpt_of(frames, links, map_from_base, graph_links, components, max_frames);
  return estimate_from(std::move(part.frames), part.links, part.poses, part.graph_links,
                       part.components, options);
}

std::vector<IntrinsicsStep> reversed(const std::vector<IntrinsicsStep>& steps) {
  std::vector<IntrinsicsStep> back;
  back.reserve(steps.size());
  for (const IntrinsicsStep& step : steps)
    back.push_back({1.0 / (1.0 + step.fx_share) - 1.0, 1.0 / (1.0 + step.fy_share) - 1.0,
                    -step.cx_px, -step.cy_px});
  return back;
}

}  // namespace libmap
