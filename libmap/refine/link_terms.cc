#include "libmap/refine/link_terms.h"

#include <cmath>
#include <iterator>

#include "libmap/refine/graph_covariance.h"
#include "libmap/refine/rigid_motion.h"

namespace libmap {

namespace {

// Of a link that places a node by itself, at a pose.
struct AbsoluteTerm {
  Vector6d residual = Vector6d::Zero();
  Matrix6d by_step = Matrix6d::Zero();
  Matrix6d information = Matrix6d::Zero();

  // Gravity says where up is, as the node has felt it; a prior where the node is.
  AbsoluteTerm(const PoseLink& link, const Pose& pose) {
    if (link.type == LinkType::gravity) {
      const Eigen::Vector3d felt = link.from_from_to.linear().transpose().col(2);
      const Eigen::Vector3d up = pose.linear().transpose().col(2);
      residual.head<3>() = felt.cross(up);
      by_step.topRightCorner<3, 3>() = cross_matrix(felt) * cross_matrix(up);
      information.diagonal().head<3>().setConstant(link.information(3, 3));
    } else {
      residual = step_between(link.from_from_to, pose);
      by_step.topLeftCorner<3, 3>() = link.from_from_to.linear().transpose() * pose.linear();
      by_step.bottomRightCorner<3, 3>().setIdentity();
      information = link.information;
    }
  }
};

}  // namespace

double link_cost(const std::map<int, Pose>& map_from_base,
                 const std::vector<GraphLinkResult>& links) {
  double cost = 0.0;
  for (const GraphLinkResult& kept : links) {
    const PoseLink& link = kept.link;
    const auto from = map_from_base.find(link.from);
    if (kept.rejected || from == map_from_base.end()) continue;
    if (is_absolute(link)) {
      const AbsoluteTerm term(link, from->second);
      cost += 0.5 * term.residual.dot(term.information * term.residual);
    } else if (const auto to = map_from_base.find(link.to); to != map_from_base.end()) {
      const Vector6d residual =
          step_between(link.from_from_to, from->second.inverse() * to->second);
      cost += 0.5 * kept.weight * residual.dot(link.information * residual);
    }
  }
  return cost;
}

BlockSystem all_link_system(const std::map<int, Pose>& map_from_base,
                            const std::vector<GraphLinkResult>& links) {
  BlockSystem system = link_system(map_from_base, links);
  for (const GraphLinkResult& kept : links) {
    const auto from = map_from_base.find(kept.link.from);
    if (kept.rejected || !is_absolute(kept.link) || from == map_from_base.end()) continue;
    const AbsoluteTerm term(kept.link, from->second);
    const auto row = static_cast<std::size_t>(std::distance(map_from_base.begin(), from));
    const Matrix6d weighted = term.by_step.transpose() * term.information;
    system.add(row, row, weighted * term.by_step);
    system.add_side(row, -weighted * term.residual);
  }
  return system;
}

}  // namespace libmap
