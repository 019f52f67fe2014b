// Links of a pose graph and residuals of links, for all optimizations of poses and covariances.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "libmap/core/pose_graph.h"
#include "libmap/optimize/block_system.h"

namespace libmap {

// A link with its group. Links of one group have a common scale of covariances.
struct GraphLink {
  PoseLink link{};
  std::string group{};
  bool may_be_rejected = false;  // true for closures; odometry is only down-weighted
};

struct GraphLinkResult {
  PoseLink link{};  // with the final, recalibrated information
  bool rejected = false;
  double weight = 1.0;      // of the robust loss
  double chi_square = 0.0;  // at the optimum
};

// Throws Error if the motion or the information matrix is not finite, or if the information matrix
// is not positive semidefinite or is zero.
void require_usable(const PoseLink& link);

// Links of a stored graph, grouped by type.
std::vector<GraphLink> stored_links(const PoseGraph& graph);

// Drops invalid links and appends a warning.
void drop_invalid(std::vector<GraphLink>& links, std::vector<std::string>& warnings);

// Links between consecutive odometry poses of each session, for scans with poses but without links,
// such as a folder of images. Recalibration estimates standard deviations of these links.
std::vector<GraphLink> odometry_links(const PoseGraph& graph);

// Step (rigid_motion.h) from the measured to the actual relative pose; for a pose prior, from the
// measured to the actual pose. For gravity, the rotation part is the cross product of both up
// directions. Absolute links ignore `to`.
Vector6d link_residual(const PoseLink& link, const Pose& from, const Pose& to);

// Derivatives of link_residual by steps of both poses.
struct LinkJacobian {
  Matrix6d by_from = Matrix6d::Zero();
  Matrix6d by_to = Matrix6d::Zero();
};
LinkJacobian link_jacobian(const PoseLink& link, const Pose& from, const Pose& to);

// Inverse covariance of the residual; isotropic for gravity.
Matrix6d link_information(const PoseLink& link);

// Half the sum of weighted squares over the links in use: not rejected, and all nodes have a pose.
double link_cost(const std::map<int, Pose>& map_from_base,
                 const std::vector<GraphLinkResult>& links);

// Normal equations of the links in use over the nodes of `map_from_base`, in the same order.
// link_system contains the links between two nodes, all_link_system also the absolute links.
BlockSystem link_system(const std::map<int, Pose>& map_from_base,
                        const std::vector<GraphLinkResult>& links);
BlockSystem all_link_system(const std::map<int, Pose>& map_from_base,
                            const std::vector<GraphLinkResult>& links);

}  // namespace libmap
