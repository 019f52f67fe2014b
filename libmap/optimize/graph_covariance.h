// Computes covariances of a pose graph's poses from the information of the links at the optimum.
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
  // Uses the graph's links with robust weights, without rejected links. The gauge node of each
  // component is fixed. Covariances of all nodes, linked pairs and `pairs` are computed here, in
  // the time of one factorization.
  explicit GraphCovariance(const PoseGraphResult& graph,
                           const std::vector<std::pair<int, int>>& pairs = {});
  // Uses a system with one block per node of `map_from_base`, in the same order. The gauge node of
  // each component is fixed.
  GraphCovariance(const std::map<int, Pose>& map_from_base, const BlockSystem& information,
                  const std::vector<GraphComponent>& components);

  bool valid() const { return solver_->valid(); }  // true if the graph determines the poses
  bool connected(int a, int b) const;              // true if both are in one component
  // Returns the covariance of a node's pose relative to the gauge node of its component.
  // Covariances are of steps (rigid_motion.h) and require valid() and nodes with a pose.
  Matrix6d of_node(int node) const { return between(node, node); }
  // Returns the covariance of a_from_b for two connected nodes.
  Matrix6d of_relative(int a, int b) const;

 private:
  void factor(const BlockSystem& system, const std::vector<GraphComponent>& components);
  Matrix6d between(int a, int b) const;  // covariance of steps of two nodes

  std::map<int, Pose> poses_;
  std::map<int, std::size_t> row_;        // by node, among the unknowns; a constant if fixed
  std::map<int, std::size_t> component_;  // by node
  std::unique_ptr<BlockSolver> solver_;
  BlockSystem inverse_{0};  // blocks of nodes and links
};

// Returns a copy of the system in which a large weight fixes the gauge node of each component.
BlockSystem fix_gauges(const BlockSystem& system, const std::map<int, Pose>& map_from_base,
                       const std::vector<GraphComponent>& components);

}  // namespace libmap
