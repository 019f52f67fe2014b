// Provides links of a pose graph and their residuals, for optimizations of poses and covariances.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "libmap/core/pose_graph.h"
#include "libmap/optimize/block_system.h"

namespace libmap {

// A link with its group. PoseGraphOptions::recalibrate scales the covariances of a group together.
struct GraphLink {
  PoseLink link{};
  std::string group{};
  bool may_be_rejected = false;  // true for closures; odometry is only down-weighted
};

struct GraphLinkResult {
  PoseLink link{};  // with the final, recalibrated information
  bool rejected = false;
  double weight = 1.0;      // weight by the robust loss, 0 to 1; 0 if rejected
  double chi_square = 0.0;  // squared residual at the optimum, in standard deviations
};

// Throws Error if the motion or the information matrix is not finite, or if the information matrix
// is not positive semidefinite or is zero.
void require_usable(const PoseLink& link);

// Returns the links of a stored graph, grouped by type.
std::vector<GraphLink> stored_links(const PoseGraph& graph);

// Drops links that require_usable rejects and appends one warning about them.
void drop_invalid(std::vector<GraphLink>& links, std::vector<std::string>& warnings);

// Returns links between consecutive odometry poses of each session, for scans without links, such
// as folders of images. Recalibration estimates standard deviations of these links.
std::vector<GraphLink> odometry_links(const PoseGraph& graph);

// Returns the step (rigid_motion.h) from the measured to the actual relative pose; for a pose
// prior, from the measured to the actual pose. For gravity, the rotation part is the cross product
// of the measured and the actual up direction. Absolute links (prior, gravity) ignore `to`.
Vector6d link_residual(const PoseLink& link, const Pose& from, const Pose& to);

// Derivatives of link_residual by steps of both poses.
struct LinkJacobian {
  Matrix6d by_from = Matrix6d::Zero();
  Matrix6d by_to = Matrix6d::Zero();
};
LinkJacobian link_jacobian(const PoseLink& link, const Pose& from, const Pose& to);

// Returns the inverse covariance of the residual; isotropic for gravity.
Matrix6d link_information(const PoseLink& link);

// Returns half the sum of weighted chi-squares of the links in use (not rejected, all poses known).
double link_cost(const std::map<int, Pose>& map_from_base,
                 const std::vector<GraphLinkResult>& links);

// Returns the normal equations of the links in use, with one block per node of `map_from_base`.
// link_system contains only links between two nodes, all_link_system also absolute links.
BlockSystem link_system(const std::map<int, Pose>& map_from_base,
                        const std::vector<GraphLinkResult>& links);
BlockSystem all_link_system(const std::map<int, Pose>& map_from_base,
                            const std::vector<GraphLinkResult>& links);

}  // namespace libmap
