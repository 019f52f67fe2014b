#include "libmap/optimize/graph_covariance.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <utility>

namespace libmap {

namespace {

// Keeps the system regular if unknowns, e.g. of a landmark, are not constrained; negligible.
constexpr double damping = 1e-6;
constexpr double gauge_weight = 1e12;

constexpr std::size_t fixed = std::numeric_limits<std::size_t>::max();

}  // namespace

void GraphCovariance::factor(const BlockSystem& system,
                             const std::vector<GraphComponent>& components) {
  for (std::size_t n = 0; n < components.size(); ++n)
    for (const int node : components[n].nodes) component_[node] = n;
  std::vector<std::size_t> row_of;
  std::size_t unknowns = 0;
  for (const auto& [node, pose] : poses_) {
    const auto found = component_.find(node);
    const bool free = found != component_.end() && components[found->second].gauge_node != node;
    row_of.push_back(free ? unknowns++ : fixed);
    row_[node] = row_of.back();
  }
  BlockSystem reduced(unknowns);
  for (const auto& [key, block] : system.blocks())
    if (row_of[key.first] != fixed && row_of[key.second] != fixed)
      reduced.add(row_of[key.first], row_of[key.second], block);
  for (std::size_t n = 0; n < unknowns; ++n) reduced.add(n, n, Matrix6d::Zero());
  solver_ = std::make_unique<BlockSolver>(reduced, damping);
  if (solver_->valid()) inverse_ = solver_->selected_inverse(reduced);
}

Matrix6d GraphCovariance::between(int a, int b) const {
  const std::size_t row = row_.at(a);
  const std::size_t column = row_.at(b);
  if (row == fixed || column == fixed) return Matrix6d::Zero();
  return inverse_.blocks().contains(std::minmax(row, column))
             ? inverse_.block(row, column)
             : solver_->inverse_column(column)[row];
}

GraphCovariance::GraphCovariance(const PoseGraphResult& graph,
                                 const std::vector<std::pair<int, int>>& pairs)
    : poses_(graph.map_from_base) {
  BlockSystem system = link_system(poses_, graph.links);
  std::map<int, std::size_t> rows;
  for (const auto& [node, pose] : poses_) rows.emplace(node, rows.size());
  for (const auto& [a, b] : pairs)
    if (a != b && rows.contains(a) && rows.contains(b))
      system.add(rows.at(a), rows.at(b), Matrix6d::Zero());
  factor(system, graph.components);
}

GraphCovariance::GraphCovariance(const std::map<int, Pose>& map_from_base,
                                 const BlockSystem& information,
                                 const std::vector<GraphComponent>& components)
    : poses_(map_from_base) {
  factor(information, components);
}

bool GraphCovariance::connected(int a, int b) const {
  const auto of_a = component_.find(a);
  const auto of_b = component_.find(b);
  return of_a != component_.end() && of_b != component_.end() && of_a->second == of_b->second;
}

Matrix6d GraphCovariance::of_relative(int a, int b) const {
  const RelativeJacobian jacobian = relative_jacobian(poses_.at(a).inverse() * poses_.at(b));
  const Matrix6d mixed = jacobian.by_b * between(b, a) * jacobian.by_a.transpose();
  return jacobian.by_a * of_node(a) * jacobian.by_a.transpose() +
         jacobian.by_b * of_node(b) * jacobian.by_b.transpose() + mixed + mixed.transpose();
}

BlockSystem fix_gauges(const BlockSystem& system, const std::map<int, Pose>& map_from_base,
                       const std::vector<GraphComponent>& components) {
  BlockSystem bound = system;
  for (const GraphComponent& component : components) {
    const auto block_row = static_cast<std::size_t>(
        std::distance(map_from_base.begin(), map_from_base.find(component.gauge_node)));
    bound.add(block_row, block_row, gauge_weight * Matrix6d::Identity());
  }
  return bound;
}

}  // namespace libmap
