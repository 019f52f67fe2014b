#include "libmap/poses/initial_poses.h"

#include <algorithm>
#include <cstddef>
#include <set>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/poses/rigid_motion.h"

namespace libmap {

namespace {

constexpr int invalid_weight = -9;
constexpr double agreement_m = 0.1;
constexpr double agreement_rad = 0.1;

// RTAB-Map's variance of a motion that it does not know is 9999.
constexpr double unknown_information = 1.001e-4;

bool is_between_nodes(const PoseLink& link) {
  return link.from > 0 && link.to > 0 && link.from != link.to &&
         link.information.diagonal().minCoeff() > unknown_information;
}

// Poses of nodes that have none, by links to nodes that have one.
void place_by_links(const PoseGraph& graph, const std::set<int>& wanted,
                    std::map<int, Pose>& poses) {
  for (bool any = true; any;) {
    any = false;
    for (const PoseLink& link : graph.links) {
      if (!is_between_nodes(link)) continue;
      const auto from = poses.find(link.from);
      const auto to = poses.find(link.to);
      if (from != poses.end() && to == poses.end() && wanted.contains(link.to)) {
        poses.emplace(link.to, from->second * link.from_from_to);
        any = true;
      } else if (from == poses.end() && to != poses.end() && wanted.contains(link.from)) {
        poses.emplace(link.from, to->second * link.from_from_to.inverse());
        any = true;
      }
    }
  }
}

// Of a scan without any pose: the first node of each chain of links begins a part.
std::vector<std::vector<int>> begin_by_links(const PoseGraph& graph, const std::set<int>& wanted,
                                             std::map<int, Pose>& poses) {
  std::set<int> linked;
  for (const PoseLink& link : graph.links)
    if (is_between_nodes(link) && wanted.contains(link.from) && wanted.contains(link.to))
      linked.insert({link.from, link.to});
  std::vector<std::vector<int>> parts;
  std::map<int, Pose> placed;
  for (const int node : linked) {
    if (placed.contains(node)) continue;
    placed.emplace(node, Pose::Identity());
    poses.emplace(node, Pose::Identity());
    parts.push_back({node});
    place_by_links(graph, wanted, placed);
  }
  return parts;
}

// How the second part must move.
struct Bridge {
  Pose move;
  Pose probe;  // a pose of the second part, where agreement is measured
};

Pose best_move(const std::vector<Bridge>& bridges) {
  std::size_t best = 0;
  std::size_t most = 0;
  for (std::size_t n = 0; n < bridges.size(); ++n) {
    std::size_t votes = 0;
    for (const Bridge& other : bridges) {
      const Vector6d apart =
          step_between(bridges[n].move * bridges[n].probe, other.move * bridges[n].probe);
      votes += apart.head<3>().norm() < agreement_m && apart.tail<3>().norm() < agreement_rad;
    }
    if (votes > most) {
      most = votes;
      best = n;
    }
  }
  return bridges[best].move;
}

}  // namespace

std::vector<std::vector<int>> join_parts(std::map<int, Pose>& poses,
                                         const std::vector<std::vector<int>>& parts,
                                         const std::vector<PoseLink>& links) {
  std::vector<std::vector<int>> open = parts;
  std::stable_sort(open.begin(), open.end(),
                   [](const auto& a, const auto& b) { return a.size() > b.size(); });
  std::vector<std::vector<int>> joined;
  while (!open.empty()) {
    std::vector<int> whole = std::move(open.front());
    open.erase(open.begin());
    for (bool any = true; any;) {
      any = false;
      const std::set<int> inside(whole.begin(), whole.end());
      for (std::size_t n = 0; n < open.size(); ++n) {
        const std::set<int> outside(open[n].begin(), open[n].end());
        std::vector<Bridge> bridges;
        for (const PoseLink& link : links) {
          if (!is_between_nodes(link)) continue;
          if (inside.contains(link.from) && outside.contains(link.to))
            bridges.push_back(
                {poses.at(link.from) * link.from_from_to * poses.at(link.to).inverse(),
                 poses.at(link.to)});
          if (inside.contains(link.to) && outside.contains(link.from))
            bridges.push_back(
                {poses.at(link.to) * link.from_from_to.inverse() * poses.at(link.from).inverse(),
                 poses.at(link.from)});
        }
        if (bridges.empty()) continue;
        const Pose move = best_move(bridges);
        for (const int node : open[n]) {
          poses.at(node) = move * poses.at(node);
          whole.push_back(node);
        }
        open.erase(open.begin() + static_cast<std::ptrdiff_t>(n));
        any = true;
        break;
      }
    }
    std::sort(whole.begin(), whole.end());
    joined.push_back(std::move(whole));
  }
  return joined;
}

InitialPoses initial_poses(const PoseGraph& graph, StartPoses start) {
  InitialPoses result;
  std::set<int> wanted;
  std::map<int, Pose> odometry;
  std::map<int, Pose> stored;
  std::map<int, int> session;
  for (const GraphNode& node : graph.nodes) {
    if (node.weight == invalid_weight) continue;
    wanted.insert(node.id);
    session[node.id] = node.session;
    if (node.odometry_from_base) odometry[node.id] = *node.odometry_from_base;
    const auto optimized = graph.optimized_map_from_base.find(node.id);
    if (optimized != graph.optimized_map_from_base.end()) stored[node.id] = optimized->second;
  }
  if (start == StartPoses::visual) {
    result.source = "visual";
    result.without_pose.assign(wanted.begin(), wanted.end());
    return result;
  }
  const bool by_odometry =
      start == StartPoses::odometry ||
      (start == StartPoses::automatic && (odometry.size() == wanted.size() || stored.empty()));
  result.source = by_odometry ? "odometry" : "stored";
  result.map_from_base = by_odometry ? odometry : stored;
  // Stored poses are in one frame, whatever their session.
  std::map<int, std::vector<int>> parts;
  for (const auto& [node, pose] : result.map_from_base)
    parts[by_odometry ? session.at(node) : 0].push_back(node);
  for (auto& [number, nodes] : parts) result.parts.push_back(std::move(nodes));
  if (result.map_from_base.empty()) {
    if (start != StartPoses::automatic)
      throw Error("the scan has no poses to start from",
                  {.file = {}, .field = "poses", .value = result.source, .bound = {}});
    result.parts = begin_by_links(graph, wanted, result.map_from_base);
    result.source = result.parts.empty() ? "visual" : "links";
  }
  result.parts = join_parts(result.map_from_base, result.parts, graph.links);
  place_by_links(graph, wanted, result.map_from_base);
  for (const int node : wanted)
    if (!result.map_from_base.contains(node)) result.without_pose.push_back(node);
  // A node that links have placed belongs to its neighbour's part.
  for (bool any = true; any;) {
    any = false;
    std::map<int, std::size_t> part_of;
    for (std::size_t n = 0; n < result.parts.size(); ++n)
      for (const int node : result.parts[n]) part_of[node] = n;
    for (const PoseLink& link : graph.links) {
      if (!is_between_nodes(link)) continue;
      for (const auto& [known, other] : {std::pair(link.from, link.to), {link.to, link.from}})
        if (part_of.contains(known) && !part_of.contains(other) &&
            result.map_from_base.contains(other)) {
          part_of[other] = part_of.at(known);
          result.parts[part_of.at(known)].push_back(other);
          any = true;
        }
    }
  }
  for (std::vector<int>& part : result.parts) std::sort(part.begin(), part.end());
  return result;
}

}  // namespace libmap
