#include "libmap/poses/initial_poses.h"

#include <algorithm>
#include <cstddef>
#include <functional>
#include <limits>
#include <queue>
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

// What nodes know spreads along links, as if these were gone through in their order again and
// again until nothing changes: known(node) says whether it knows already, tell(link, node) makes
// the link's other end tell `node` and says whether it took it.
template <typename Known, typename Tell>
void spread_by_links(const std::vector<PoseLink>& links, const Known& known, const Tell& tell) {
  std::map<int, std::vector<std::size_t>> links_of;
  // By round, then by place in the list. A link acts once: when one of its ends alone knows.
  using Turn = std::pair<std::size_t, std::size_t>;
  std::priority_queue<Turn, std::vector<Turn>, std::greater<>> turns;
  for (std::size_t n = 0; n < links.size(); ++n) {
    if (!is_between_nodes(links[n])) continue;
    links_of[links[n].from].push_back(n);
    links_of[links[n].to].push_back(n);
    if (known(links[n].from) != known(links[n].to)) turns.emplace(0, n);
  }
  while (!turns.empty()) {
    const auto [round, n] = turns.top();
    turns.pop();
    const PoseLink& link = links[n];
    if (known(link.from) == known(link.to)) continue;
    const int listener = known(link.from) ? link.to : link.from;
    if (!tell(link, listener)) continue;
    for (const std::size_t other : links_of.at(listener))
      if (known(links[other].from) != known(links[other].to))
        turns.emplace(other > n ? round : round + 1, other);
  }
}

// Poses of nodes that have none, by links to nodes that have one.
void place_by_links(const PoseGraph& graph, const std::set<int>& wanted,
                    std::map<int, Pose>& poses) {
  spread_by_links(
      graph.links, [&](int node) { return poses.contains(node); },
      [&](const PoseLink& link, int node) {
        if (!wanted.contains(node)) return false;
        poses.emplace(node, node == link.to ? poses.at(link.from) * link.from_from_to
                                            : poses.at(link.to) * link.from_from_to.inverse());
        return true;
      });
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

// The one with which most agree.
Pose best_move(const std::vector<Bridge>& bridges) {
  // Of very many, candidates evenly taken.
  constexpr std::size_t max_candidates = 500;
  const std::size_t stride = bridges.size() / max_candidates + 1;
  std::size_t best = 0;
  std::size_t most = 0;
  for (std::size_t n = 0; n < bridges.size(); n += stride) {
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
  std::vector<std::vector<int>> sorted = parts;
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const auto& a, const auto& b) { return a.size() > b.size(); });
  std::map<int, std::size_t> part_of;
  for (std::size_t part = 0; part < sorted.size(); ++part)
    for (const int node : sorted[part]) part_of.emplace(node, part);
  // The links of a part that lead to another one.
  std::vector<std::vector<const PoseLink*>> leaving(sorted.size());
  for (const PoseLink& link : links) {
    if (!is_between_nodes(link)) continue;
    const auto from = part_of.find(link.from);
    const auto to = part_of.find(link.to);
    if (from == part_of.end() || to == part_of.end() || from->second == to->second) continue;
    leaving[from->second].push_back(&link);
    leaving[to->second].push_back(&link);
  }
  constexpr std::size_t none = std::numeric_limits<std::size_t>::max();
  std::vector<std::size_t> whole_of(sorted.size(), none);  // which of `joined` a part belongs to
  std::vector<std::vector<int>> joined;
  // How `part` must move to fit to the whole that is being joined.
  const auto bridges_of = [&](std::size_t part) {
    std::vector<Bridge> bridges;
    for (const PoseLink* link : leaving[part]) {
      const bool leads_here = part_of.at(link->to) == part;
      const int inside = leads_here ? link->from : link->to;
      const int outside = leads_here ? link->to : link->from;
      if (whole_of[part_of.at(inside)] != joined.size()) continue;
      const Pose inside_from_outside =
          leads_here ? link->from_from_to : Pose(link->from_from_to.inverse());
      bridges.push_back({poses.at(inside) * inside_from_outside * poses.at(outside).inverse(),
                         poses.at(outside)});
    }
    return bridges;
  };
  for (std::size_t first = 0; first < sorted.size(); ++first) {
    if (whole_of[first] != none) continue;
    whole_of[first] = joined.size();
    std::vector<int> whole = sorted[first];
    std::set<std::size_t> near;  // parts that a link ties to the whole
    const auto look_around = [&](std::size_t part) {
      near.erase(part);
      for (const PoseLink* link : leaving[part])
        for (const int node : {link->from, link->to})
          if (whole_of[part_of.at(node)] == none) near.insert(part_of.at(node));
    };
    look_around(first);
    while (!near.empty()) {
      const std::size_t part = *near.begin();
      const Pose move = best_move(bridges_of(part));
      for (const int node : sorted[part]) {
        poses.at(node) = move * poses.at(node);
        whole.push_back(node);
      }
      whole_of[part] = joined.size();
      look_around(part);
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
  std::map<int, std::size_t> part_of;
  for (std::size_t n = 0; n < result.parts.size(); ++n)
    for (const int node : result.parts[n]) part_of[node] = n;
  spread_by_links(
      graph.links, [&](int node) { return part_of.contains(node); },
      [&](const PoseLink& link, int node) {
        if (!result.map_from_base.contains(node)) return false;
        const std::size_t part = part_of.at(node == link.to ? link.from : link.to);
        part_of[node] = part;
        result.parts[part].push_back(node);
        return true;
      });
  for (std::vector<int>& part : result.parts) std::sort(part.begin(), part.end());
  return result;
}

}  // namespace libmap
