#include "libmap/optimize/graph_links.h"

#include <cstddef>
#include <string>

#include "libmap/core/error.h"
#include "libmap/geometry/rigid_motion.h"
#include "libmap/geometry/symmetric_eigen.h"

namespace libmap {

namespace {

Eigen::Vector3d up_in(const Pose& pose) { return pose.linear().transpose().col(2); }

// Calls visit(link, row of `from`, its pose, row of `to`, its pose, weight) for each link in use.
template <typename Visit>
void visit_links(const std::map<int, Pose>& map_from_base,
                 const std::vector<GraphLinkResult>& links, const Visit& visit) {
  std::map<int, std::size_t> rows;
  for (const auto& [node, pose] : map_from_base) rows.emplace(node, rows.size());
  for (const GraphLinkResult& result : links) {
    const PoseLink& link = result.link;
    const auto from = map_from_base.find(link.from);
    const auto to = map_from_base.find(is_absolute(link) ? link.from : link.to);
    if (result.rejected || from == map_from_base.end() || to == map_from_base.end()) continue;
    if (link.from == link.to && !is_absolute(link)) continue;
    visit(link, rows.at(from->first), from->second, rows.at(to->first), to->second,
          is_absolute(link) ? 1.0 : result.weight);
  }
}

BlockSystem system_of(const std::map<int, Pose>& map_from_base,
                      const std::vector<GraphLinkResult>& links, bool with_absolute) {
  BlockSystem system(map_from_base.size());
  visit_links(map_from_base, links,
              [&](const PoseLink& link, std::size_t a, const Pose& from, std::size_t b,
                  const Pose& to, double weight) {
                if (is_absolute(link) && !with_absolute) return;
                const LinkJacobian jacobian = link_jacobian(link, from, to);
                const Matrix6d weighted = weight * link_information(link);
                const Vector6d rhs = -weighted * link_residual(link, from, to);
                if (!is_absolute(link)) {
                  system.add_pair(a, b, jacobian.by_from, jacobian.by_to, weighted, rhs);
                  return;
                }
                system.add(a, a, jacobian.by_from.transpose() * weighted * jacobian.by_from);
                system.add_rhs(a, jacobian.by_from.transpose() * rhs);
              });
  return system;
}

}  // namespace

void require_usable(const PoseLink& link) {
  const Matrix6d& information = link.information;
  const std::string field = "link " + std::to_string(link.from) + " -> " + std::to_string(link.to);
  if (!information.allFinite() || !link.from_from_to.matrix().allFinite())
    throw Error("the pose or the information matrix is not finite", {.field = field});
  const Vector6d values = symmetric_eigen(information).values;
  if (values[5] <= 0.0 || values[0] < -1e-9 * values[5])
    throw Error("the information matrix is zero or not positive semidefinite", {.field = field});
}

std::vector<GraphLink> stored_links(const PoseGraph& graph) {
  std::vector<GraphLink> links;
  for (const PoseLink& link : graph.links) {
    const bool odometry = link.type == LinkType::neighbor || link.type == LinkType::neighbor_merged;
    const bool closure = !odometry && !is_absolute(link) && link.type != LinkType::landmark;
    links.push_back({link, to_text(link.type), closure});
  }
  return links;
}

void drop_invalid(std::vector<GraphLink>& links, std::vector<std::string>& warnings) {
  std::size_t dropped = 0;
  std::string first;
  std::erase_if(links, [&](const GraphLink& link) {
    try {
      require_usable(link.link);
      return false;
    } catch (const Error& error) {
      if (dropped++ == 0) first = error.what();
      return true;
    }
  });
  if (dropped > 0)
    warnings.push_back(std::to_string(dropped) +
                       " invalid stored links are skipped; first: " + first);
}

std::vector<GraphLink> odometry_links(const PoseGraph& graph) {
  std::vector<GraphLink> links;
  const GraphNode* last = nullptr;
  for (const GraphNode& node : graph.nodes) {
    if (!node.odometry_from_base || node.weight == GraphNode::invalid_weight) continue;
    if (last != nullptr && last->session == node.session) {
      PoseLink link{last->id,
                    node.id,
                    LinkType::neighbor,
                    last->odometry_from_base->inverse() * *node.odometry_from_base,
                    {}};
      const double shift = 0.002 + 0.02 * link.from_from_to.translation().norm();
      const double turn = 0.01;
      Vector6d weights;
      weights << Eigen::Vector3d::Constant(1.0 / (shift * shift)),
          Eigen::Vector3d::Constant(1.0 / (turn * turn));
      link.information = weights.asDiagonal();
      links.push_back({link, "odometry", false});
    }
    last = &node;
  }
  return links;
}

Vector6d link_residual(const PoseLink& link, const Pose& from, const Pose& to) {
  if (link.type == LinkType::pose_prior) return step_between(link.from_from_to, from);
  if (link.type != LinkType::gravity) return step_between(link.from_from_to, from.inverse() * to);
  Vector6d residual = Vector6d::Zero();
  residual.tail<3>() = up_in(link.from_from_to).cross(up_in(from));
  return residual;
}

LinkJacobian link_jacobian(const PoseLink& link, const Pose& from, const Pose& to) {
  LinkJacobian jacobian;
  if (link.type == LinkType::gravity) {
    jacobian.by_from.bottomRightCorner<3, 3>() =
        cross_matrix(up_in(link.from_from_to)) * cross_matrix(up_in(from));
  } else if (link.type == LinkType::pose_prior) {
    jacobian.by_from = step_derivative(link.from_from_to, from);
  } else {
    const Pose from_from_to = from.inverse() * to;
    jacobian.by_to = step_derivative(link.from_from_to, from_from_to);
    jacobian.by_from = jacobian.by_to * relative_jacobian(from_from_to).by_a;
  }
  return jacobian;
}

Matrix6d link_information(const PoseLink& link) {
  if (link.type != LinkType::gravity) return link.information;
  Matrix6d information = Matrix6d::Zero();
  information.diagonal().tail<3>().setConstant(link.information(3, 3));
  return information;
}

double link_cost(const std::map<int, Pose>& map_from_base,
                 const std::vector<GraphLinkResult>& links) {
  double cost = 0.0;
  visit_links(map_from_base, links,
              [&](const PoseLink& link, std::size_t, const Pose& from, std::size_t, const Pose& to,
                  double weight) {
                const Vector6d residual = link_residual(link, from, to);
                cost += 0.5 * weight * residual.dot(link_information(link) * residual);
              });
  return cost;
}

BlockSystem link_system(const std::map<int, Pose>& map_from_base,
                        const std::vector<GraphLinkResult>& links) {
  return system_of(map_from_base, links, false);
}

BlockSystem all_link_system(const std::map<int, Pose>& map_from_base,
                            const std::vector<GraphLinkResult>& links) {
  return system_of(map_from_base, links, true);
}

}  // namespace libmap
