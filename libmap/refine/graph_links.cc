#include "libmap/refine/graph_links.h"

#include <cstddef>
#include <string>

#include "libmap/core/error.h"
#include "libmap/core/symmetric_eigen.h"
#include "libmap/refine/rigid_motion.h"

namespace libmap {

void require_usable(const PoseLink& link) {
  const Matrix6d& information = link.information;
  const std::string field = "link " + std::to_string(link.from) + " -> " + std::to_string(link.to);
  if (!information.allFinite() || !link.from_from_to.matrix().allFinite())
    throw Error("is not finite", {.field = field});
  const Vector6d values = symmetric_eigen(information).values;
  if (values[5] <= 0.0 || values[0] < -1e-9 * values[5])
    throw Error("its information matrix is not positive", {.field = field});
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

void drop_unusable(std::vector<GraphLink>& links, std::vector<std::string>& warnings) {
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
    warnings.push_back(std::to_string(dropped) + " stored links are left out, the first: " + first);
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

}  // namespace libmap
