#include "libmap/refine/initial_poses.h"

#include <algorithm>
#include <cstddef>
#include <functional>
#include <limits>
#include <queue>
#include <set>
#include <utility>

#include "libmap/core/error.h"
#include "libmap/geometry/rigid_motion.h"

namespace libmap {

namespace {

constexpr double agreement_m = 0.1;
constexpr double agreement_rad = 0.1;

// RTAB-Map stores a variance of 9999 for an unknown motion.
constexpr double unknown_information = 1.001e-4;

bool is_between_nodes(const PoseLink& link) {
  return link.from > 0 && link.to > 0 && link.from != link.to &&
         link.information.diagonal().minCoeff() > unknown_information;
}

// Propagates values of nodes along links, in the order of repeated passes over the list until
// nothing changes. known(node) returns true if the node has a value. propagate(link, node) passes
// the value of the link's other end to `node` and returns true if the node accepts it.
template <typename Known, typename Propagate>
void spread_by_links(const std::vector<PoseLink>& links, const Known& known,
                     const Propagate& propagate) {
  std::map<int, std::vector<std::size_t>> links_of;
  // Ordered by pass, then by index in the list. A link acts once, when one end has a value.
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
    if (!propagate(link, listener)) continue;
    for (const std::size_t other : links_of.at(listener))
      if (known(links[other].from) != known(links[other].to))
        turns.emplace(other > n ? round : round + 1, other);
  }
}

// Computes missing poses from links to nodes with a pose.
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

// For a scan without poses: the first node of each connected component begins a part.
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

// Motion of the second part that satisfies one link.
struct Bridge {
  Pose move;
  Pose probe;  // a pose of the second part, where agreement is measured
};

// The motion that most others agree with.
Pose best_move(const std::vector<Bridge>& bridges) {
  // Candidates are a regular sample of a long list.
  constexpr std::size_t max_candidates = 500;
  const std::size_t stride = bridges.size() / max_candidates + 1;
  std::size_t best = 0;
  std::size_t most = 0;
  for (std::size_t n = 0; n < bridges.size(); n += stride) {
    std::size_t votes = 0;
    for (const Bridge& other : bridges)
      votes += is_near(bridges[n].move * bridges[n].probe, other.move * bridges[n].probe,
                       agreement_m, agreement_rad);
    if (votes > most) {
      most = votes;
      best = n;
    }
  }
  return bridges[best].move;
}

// Joins parts by their links: each joined part grows from the largest part that is left.
class PartJoiner {
 public:
  PartJoiner(std::map<int, Pose>& poses, std::vector<std::vector<int>> parts,
             const std::vector<PoseLink>& links)
      : poses_(poses), parts_(std::move(parts)) {
    std::stable_sort(parts_.begin(), parts_.end(),
                     [](const auto& a, const auto& b) { return a.size() > b.size(); });
    for (std::size_t part = 0; part < parts_.size(); ++part)
      for (const int node : parts_[part]) part_of_.emplace(node, part);
    leaving_.resize(parts_.size());
    whole_of_.assign(parts_.size(), none);
    for (const PoseLink& link : links) add(link);
  }

  std::vector<std::vector<int>> run() {
    for (std::size_t first = 0; first < parts_.size(); ++first) {
      if (whole_of_[first] != none) continue;
      std::vector<int> whole;
      for (near_ = {first}; !near_.empty();) {
        const std::size_t part = *near_.begin();
        if (part != first) move(part);
        whole.insert(whole.end(), parts_[part].begin(), parts_[part].end());
        whole_of_[part] = joined_.size();
        look_around(part);
      }
      std::sort(whole.begin(), whole.end());
      joined_.push_back(std::move(whole));
    }
    return std::move(joined_);
  }

 private:
  static constexpr std::size_t none = std::numeric_limits<std::size_t>::max();

  void add(const PoseLink& link) {
    if (!is_between_nodes(link)) return;
    const auto from = part_of_.find(link.from);
    const auto to = part_of_.find(link.to);
    if (from == part_of_.end() || to == part_of_.end() || from->second == to->second) return;
    leaving_[from->second].push_back(&link);
    leaving_[to->second].push_back(&link);
  }

  // Moves the part into the frame of the present joined part.
  void move(std::size_t part) {
    std::vector<Bridge> bridges;
    for (const PoseLink* link : leaving_[part]) {
      const bool leads_here = part_of_.at(link->to) == part;
      const int inside = leads_here ? link->from : link->to;
      const int outside = leads_here ? link->to : link->from;
      if (whole_of_[part_of_.at(inside)] != joined_.size()) continue;
      const Pose inside_from_outside =
          leads_here ? link->from_from_to : Pose(link->from_from_to.inverse());
      bridges.push_back({poses_.at(inside) * inside_from_outside * poses_.at(outside).inverse(),
                         poses_.at(outside)});
    }
    const Pose move = best_move(bridges);
    for (const int node : parts_[part]) poses_.at(node) = move * poses_.at(node);
  }

  void look_around(std::size_t part) {
    near_.erase(part);
    for (const PoseLink* link : leaving_[part])
      for (const int node : {link->from, link->to})
        if (whole_of_[part_of_.at(node)] == none) near_.insert(part_of_.at(node));
  }

  std::map<int, Pose>& poses_;
  std::vector<std::vector<int>> parts_;  // by descending size
  std::map<int, std::size_t> part_of_;
  std::vector<std::vector<const PoseLink*>> leaving_;  // links from each part to other parts
  std::vector<std::size_t> whole_of_;                  // index in joined_ of each part
  std::set<std::size_t> near_;                         // parts linked to the present joined part
  std::vector<std::vector<int>> joined_;
};

}  // namespace

std::vector<std::vector<int>> join_parts(std::map<int, Pose>& poses,
                                         const std::vector<std::vector<int>>& parts,
                                         const std::vector<PoseLink>& links) {
  return PartJoiner(poses, parts, links).run();
}

InitialPoses initial_poses(const PoseGraph& graph, StartPoses start) {
  InitialPoses result;
  std::set<int> wanted;
  std::map<int, Pose> odometry;
  std::map<int, Pose> stored;
  std::map<int, int> session;
  for (const GraphNode& node : graph.nodes) {
    if (node.weight == GraphNode::invalid_weight) continue;
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
  // Stored poses of all sessions are in one frame.
  std::map<int, std::vector<int>> parts;
  for (const auto& [node, pose] : result.map_from_base)
    parts[by_odometry ? session.at(node) : 0].push_back(node);
  for (auto& [number, nodes] : parts) result.parts.push_back(std::move(nodes));
  if (result.map_from_base.empty()) {
    if (start != StartPoses::automatic)
      throw Error("the scan has no poses from this source; use start auto or visual",
                  {.field = "poses", .value = result.source});
    result.parts = begin_by_links(graph, wanted, result.map_from_base);
    result.source = result.parts.empty() ? "visual" : "links";
  }
  result.parts = join_parts(result.map_from_base, result.parts, graph.links);
  place_by_links(graph, wanted, result.map_from_base);
  for (const int node : wanted)
    if (!result.map_from_base.contains(node)) result.without_pose.push_back(node);
  // A node whose pose is from links belongs to its neighbor's part.
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
