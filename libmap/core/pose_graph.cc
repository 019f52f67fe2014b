#include "libmap/core/pose_graph.h"

#include <algorithm>
#include <array>

namespace libmap {

std::string to_text(LinkType type) {
  constexpr std::array names = {
      "neighbor",     "global closure",  "local space closure", "local time closure",
      "user closure", "virtual closure", "neighbor merged",     "pose prior",
      "landmark",     "gravity"};
  const auto number = static_cast<std::size_t>(type);
  return number < names.size() ? names[number] : "type " + std::to_string(static_cast<int>(type));
}

bool is_absolute(const PoseLink& link) {
  return link.type == LinkType::pose_prior || link.type == LinkType::gravity;
}

std::string to_text(PoseSource source) {
  constexpr std::array names = {"odometry", "optimized", "ground-truth"};
  return names.at(static_cast<std::size_t>(source));
}

const GraphNode* PoseGraph::find_node(int id) const {
  const auto entry =
      std::lower_bound(nodes.begin(), nodes.end(), id,
                       [](const GraphNode& node, int value) { return node.id < value; });
  return entry != nodes.end() && entry->id == id ? &*entry : nullptr;
}

Trajectory trajectory_of(const PoseGraph& graph, PoseSource source) {
  Trajectory trajectory;
  for (const GraphNode& node : graph.nodes) {
    if (node.weight == GraphNode::invalid_weight) continue;
    std::optional<Pose> pose;
    if (source == PoseSource::odometry) pose = node.odometry_from_base;
    if (source == PoseSource::ground_truth) pose = node.truth_from_base;
    if (source == PoseSource::optimized) {
      const auto entry = graph.optimized_map_from_base.find(node.id);
      if (entry != graph.optimized_map_from_base.end()) pose = entry->second;
    }
    if (pose) trajectory.push_back({node.id, node.stamp_s, *pose});
  }
  return trajectory;
}

double path_length(const Trajectory& trajectory) {
  double length = 0.0;
  for (std::size_t i = 1; i < trajectory.size(); ++i)
    length += (trajectory[i].world_from_base.translation() -
               trajectory[i - 1].world_from_base.translation())
                  .norm();
  return length;
}

}  // namespace libmap
