#include "libmap/refine/graph_covariance.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <utility>

namespace libmap {

namespace {

// Keeps unknowns that no link binds, such as the rotation of a landmark that is only a point, from
// making the system singular; nothing beside the information of any link.
constexpr double damping = 1e-6;
constexpr double gauge_weight = 1e12;

constexpr std::size_t held = std::numeric_limits<std::size_t>::max();

}  // namespace

struct GraphCovariance::Parts {
  std::map<int, Pose> poses;
  std::map<int, std::size_t> place;      // among the unknowns, or held
  std::map<int, std::size_t> component;  // by node
  std::unique_ptr<BlockSolver> solver;
  BlockSystem inverse{0};  // where there are links or nodes

  void factor(const BlockSystem& system, const std::vector<GraphComponent>& components);
  // The covariance of steps of two nodes.
  Matrix6d between(int a, int b) const {
    const std::size_t row = place.at(a);
    const std::size_t column = place.at(b);
    if (row == held || column == held) return Matrix6d::Zero();
    return inverse.blocks().contains(std::minmax(row, column))
               ? inverse.block(row, column)
               : solver->inverse_column(column)[row];
  }
};

void GraphCovariance::Parts::factor(const BlockSystem& system,
                                    const std::vector<GraphComponent>& components) {
  for (std::size_t n = 0; n < components.size(); ++n)
    for (const int node : components[n].nodes) component[node] = n;
  std::vector<std::size_t> row_of;
  std::size_t unknowns = 0;
  for (const auto& [node, pose] : poses) {
    const auto found = component.find(node);
    const bool free = found != component.end() && components[found->second].gauge_node != node;
    row_of.push_back(free ? unknowns++ : held);
    place[node] = row_of.back();
  }
  BlockSystem reduced(unknowns);
  for (const auto& [key, block] : system.blocks())
    if (row_of[key.first] != held && row_of[key.second] != held)
      reduced.add(row_of[key.first], row_of[key.second], block);
  for (std::size_t n = 0; n < unknowns; ++n) reduced.add(n, n, Matrix6d::Zero());
  solver = std::make_unique<BlockSolver>(reduced, damping);
  if (solver->valid()) inverse = solver->selected_inverse(reduced);
}

GraphCovariance::GraphCovariance(const PoseGraphResult& graph,
                                 const std::vector<std::pair<int, int>>& pairs)
    : parts_(std::make_unique<Parts>()) {
  parts_->poses = graph.map_from_base;
  BlockSystem system = link_system(graph.map_from_base, graph.links);
  std::map<int, std::size_t> place;
  for (const auto& [node, pose] : graph.map_from_base) place.emplace(node, place.size());
  for (const auto& [a, b] : pairs)
    if (a != b && place.contains(a) && place.contains(b))
      system.add(place.at(a), place.at(b), Matrix6d::Zero());
  parts_->factor(system, graph.components);
}

GraphCovariance::GraphCovariance(const std::map<int, Pose>& map_from_base,
                                 const BlockSystem& information,
                                 const std::vector<GraphComponent>& components)
    : parts_(std::make_unique<Parts>()) {
  parts_->poses = map_from_base;
  parts_->factor(information, components);
}

GraphCovariance::~GraphCovariance() = default;

bool GraphCovariance::valid() const { return parts_->solver->valid(); }

bool GraphCovariance::connected(int a, int b) const {
  const auto of_a = parts_->component.find(a);
  const auto of_b = parts_->component.find(b);
  return of_a != parts_->component.end() && of_b != parts_->component.end() &&
         of_a->second == of_b->second;
}

Matrix6d GraphCovariance::of_node(int node) const { return parts_->between(node, node); }

Matrix6d GraphCovariance::of_relative(int a, int b) const {
  const RelativeJacobian jacobian =
      relative_jacobian(parts_->poses.at(a).inverse() * parts_->poses.at(b));
  const Matrix6d mixed = jacobian.by_b * parts_->between(b, a) * jacobian.by_a.transpose();
  return jacobian.by_a * of_node(a) * jacobian.by_a.transpose() +
         jacobian.by_b * of_node(b) * jacobian.by_b.transpose() + mixed + mixed.transpose();
}

BlockSystem with_gauges(const BlockSystem& system, const std::map<int, Pose>& map_from_base,
                        const std::vector<GraphComponent>& components) {
  BlockSystem bound = system;
  for (const GraphComponent& component : components) {
    const auto place = static_cast<std::size_t>(
        std::distance(map_from_base.begin(), map_from_base.find(component.gauge_node)));
    bound.add(place, place, gauge_weight * Matrix6d::Identity());
  }
  return bound;
}

BlockSystem link_system(const std::map<int, Pose>& map_from_base,
                        const std::vector<GraphLinkResult>& links) {
  std::map<int, std::size_t> place;
  for (const auto& [node, pose] : map_from_base) place.emplace(node, place.size());
  BlockSystem system(place.size());
  for (const GraphLinkResult& result : links) {
    const PoseLink& link = result.link;
    if (result.rejected || link.from == link.to || !place.contains(link.from) ||
        !place.contains(link.to))
      continue;
    const Pose relative = map_from_base.at(link.from).inverse() * map_from_base.at(link.to);
    const RelativeJacobian jacobian = relative_jacobian(relative);
    const Matrix6d weighted = result.weight * link.information;
    const Vector6d error = step_between(link.from_from_to, relative);
    const std::size_t a = place.at(link.from);
    const std::size_t b = place.at(link.to);
    system.add(a, a, jacobian.by_a.transpose() * weighted * jacobian.by_a);
    system.add(a, b, jacobian.by_a.transpose() * weighted * jacobian.by_b);
    system.add(b, b, jacobian.by_b.transpose() * weighted * jacobian.by_b);
    system.add_side(a, -jacobian.by_a.transpose() * weighted * error);
    system.add_side(b, -jacobian.by_b.transpose() * weighted * error);
  }
  return system;
}

}  // namespace libmap
