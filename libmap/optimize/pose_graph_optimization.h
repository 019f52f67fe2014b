// The poses that agree best with all links of a graph (Lu and Milios 1997), in least squares with
// residuals whitened by L^T (information = L L^T), by Ceres.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/pose_graph.h"
#include "libmap/geometry/rigid_motion.h"
#include "libmap/optimize/graph_links.h"

namespace libmap {

struct PoseGraphOptions {
  // The information matrices of each type of links are scaled, rotation and translation apart,
  // until the residuals of that type agree with them (Foerstner 1979, variance components).
  bool recalibrate = true;
  int recalibrations = 6;     // >= 1: rounds of that, at most
  double robust_scale = 4.1;  // >= 0: of Cauchy's loss, in deviations of a link; 0: plain squares
  double max_chi_square = 40.0;  // > 0: of a closure's six residuals; with more it is rejected
  int gauge_node = 0;            // stays where it is; 0: the first of each component
};
void bind(ParameterTable& table, PoseGraphOptions& options);

struct LinkGroupResult {
  std::size_t links = 0;
  std::size_t rejected = 0;
  double translation_scale = 1.0;  // by which its standard deviations were multiplied
  double rotation_scale = 1.0;
  double redundancy = 0.0;                // how many of its residuals the other links check
  double translation_rms_before_m = 0.0;  // residuals of those kept, at the poses of the input
  double rotation_rms_before_deg = 0.0;
  double translation_rms_m = 0.0;  // ... and at the end
  double rotation_rms_deg = 0.0;
};

// Nodes that links bind together. Its gauge node stays where it is, but for what gravity and priors
// say.
struct GraphComponent {
  std::vector<int> nodes;
  int gauge_node = 0;
};

struct PoseGraphResult {
  std::map<int, Pose> map_from_base;   // nodes and, below 0, landmarks
  std::vector<GraphLinkResult> links;  // in the order of the input
  std::map<std::string, LinkGroupResult> groups;
  std::vector<GraphComponent> components;  // the largest first; a node without links is its own
  std::vector<int> without_links;
  double initial_cost = 0.0;  // half the sum of squares, robust, at the last recalibration
  double final_cost = 0.0;
  int iterations = 0;
  bool converged = true;
};

// Poses of nodes are `map_from_base`; links to nodes that have none are left out. Priors bind a
// node to the map's frame, gravity binds its up direction to the map's z, landmarks are points or
// poses that several nodes have seen. Throws Error: information that is not finite or not
// positive, options out of their ranges.
PoseGraphResult optimize_pose_graph(const std::map<int, Pose>& map_from_base,
                                    const std::vector<GraphLink>& links,
                                    const PoseGraphOptions& options = {});

}  // namespace libmap
