// The links of a pose graph, and their residuals for the pose graph, the bundle adjustment and
// covariances.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "libmap/core/pose_graph.h"
#include "libmap/optimize/block_system.h"

namespace libmap {

// Links of one group share the scales of their covariances.
struct GraphLink {
  PoseLink link{};
  std::string group{};
  bool may_be_rejected = false;  // a closure; odometry is down-weighted only
};

struct GraphLinkResult {
  PoseLink link{};  // with the information that was used at the end
  bool rejected = false;
  double weight = 1.0;      // of the robust loss
  double chi_square = 0.0;  // at the end
};

// Throws Error: a motion or an information matrix that is not finite, or one that is not positive.
void require_usable(const PoseLink& link);

// The links as stored, grouped by their type.
std::vector<GraphLink> stored_links(const PoseGraph& graph);

// Drops invalid links and appends a warning.
void drop_unusable(std::vector<GraphLink>& links, std::vector<std::string>& warnings);

// Links from pose to pose within each session, of a scan that has poses and no links, such as a
// folder of images. Recalibration estimates their standard deviations.
std::vector<GraphLink> odometry_links(const PoseGraph& graph);

// The step (rigid_motion.h) from what the link measured to what the poses of its nodes say. Of
// gravity, the cross product of both up directions, in the rotation's place. Absolute links have no
// `to`.
Vector6d link_residual(const PoseLink& link, const Pose& from, const Pose& to);

// Derivatives of link_residual by steps of both poses.
struct LinkJacobian {
  Matrix6d by_from = Matrix6d::Zero();  // by a step of the pose
  Matrix6d by_to = Matrix6d::Zero();
};
LinkJacobian link_jacobian(const PoseLink& link, const Pose& from, const Pose& to);

// Inverse covariance of the residual; of gravity, the same about all axes.
Matrix6d link_information(const PoseLink& link);

// Half the weighted squares of links that are not rejected and whose nodes have poses.
double link_cost(const std::map<int, Pose>& map_from_base,
                 const std::vector<GraphLinkResult>& links);

// Their normal equations over the nodes of `map_from_base`, in their order: of links between two
// nodes; with absolute links, too.
BlockSystem link_system(const std::map<int, Pose>& map_from_base,
                        const std::vector<GraphLinkResult>& links);
BlockSystem all_link_system(const std::map<int, Pose>& map_from_base,
                            const std::vector<GraphLinkResult>& links);

}  // namespace libmap
