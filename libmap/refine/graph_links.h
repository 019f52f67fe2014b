// The links that a pose graph is optimized by.
#pragma once

#include <string>
#include <vector>

#include "libmap/core/pose_graph.h"

namespace libmap {

// Links of one group share the scales of their covariances.
struct GraphLink {
  PoseLink link{};
  std::string group{};
  bool may_be_rejected = false;  // a closure; odometry is down-weighted only
};

// Throws Error: a motion or an information matrix that is not finite, or one that is not positive.
void require_usable(const PoseLink& link);

// The links as stored, grouped by their type.
std::vector<GraphLink> stored_links(const PoseGraph& graph);

// Leaves out those that are not usable, and says so in one more warning.
void drop_unusable(std::vector<GraphLink>& links, std::vector<std::string>& warnings);

// Of a scan that has poses and no links, such as a folder of images: links from pose to pose within
// each session, with deviations that recalibration is to find.
std::vector<GraphLink> odometry_links(const PoseGraph& graph);

}  // namespace libmap
