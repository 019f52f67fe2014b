// How certain the poses of a graph are, from the information of its links at the optimum.
#pragma once

#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "libmap/refine/block_system.h"
#include "libmap/refine/pose_graph_optimization.h"

namespace libmap {

class GraphCovariance {
 public:
  // Links that were rejected do not count; others do by their weight. Components are bound at their
  // gauge nodes. All that the nodes and the links are asked for is found at once, in about the time
  // of one factorization; so are `pairs` of nodes that no link joins.
  explicit GraphCovariance(const PoseGraphResult& graph,
                           const std::vector<std::pair<int, int>>& pairs = {});
  // Of any system whose blocks are those of `nodes`, in their order, of which the first of each
  // component is held.
  GraphCovariance(const std::map<int, Pose>& map_from_base, const BlockSystem& information,
                  const std::vector<GraphComponent>& components);
  ~GraphCovariance();
  GraphCovariance(const GraphCovariance&) = delete;
  GraphCovariance& operator=(const GraphCovariance&) = delete;

  bool valid() const;                  // whether the graph determines its poses
  bool connected(int a, int b) const;  // whether links lead from one node to the other
  // Of a step of the node's pose against the gauge node of its component.
  Matrix6d of_node(int node) const;
  // Of a step of a_from_b, of two nodes that are connected.
  Matrix6d of_relative(int a, int b) const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

// The system with the gauge node of each component held: what it is bound by is not asked.
BlockSystem with_gauges(const BlockSystem& system, const std::map<int, Pose>& map_from_base,
                        const std::vector<GraphComponent>& components);

// The information of links between poses as a system over `map_from_base`'s nodes, in their order,
// and its right-hand side: minus the gradient of half the weighted squares.
BlockSystem link_system(const std::map<int, Pose>& map_from_base,
                        const std::vector<GraphLinkResult>& links);

}  // namespace libmap
