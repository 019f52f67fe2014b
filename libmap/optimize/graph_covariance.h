// How certain the poses of a graph are, from the information of its links at the optimum.
#pragma once

#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "libmap/optimize/block_system.h"
#include "libmap/optimize/pose_graph_optimization.h"

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

  bool valid() const { return solver_->valid(); }  // whether the graph determines its poses
  bool connected(int a, int b) const;              // whether links lead from one node to the other
  // Of a step of the node's pose against the gauge node of its component.
  Matrix6d of_node(int node) const { return between(node, node); }
  // Of a step of a_from_b, of two nodes that are connected.
  Matrix6d of_relative(int a, int b) const;

 private:
  void factor(const BlockSystem& system, const std::vector<GraphComponent>& components);
  Matrix6d between(int a, int b) const;  // covariance of steps of two nodes

  std::map<int, Pose> poses_;
  std::map<int, std::size_t> row_;        // among the unknowns; none if fixed
  std::map<int, std::size_t> component_;  // by node
  std::unique_ptr<BlockSolver> solver_;
  BlockSystem inverse_{0};  // where there are links or nodes
};

// The system with the gauge node of each component held: what it is bound by is not asked.
BlockSystem fix_gauges(const BlockSystem& system, const std::map<int, Pose>& map_from_base,
                       const std::vector<GraphComponent>& components);

}  // namespace libmap
