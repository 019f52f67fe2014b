// Optimizes pose graphs (Lu and Milios 1997) by least squares over all links, with Ceres. Residuals
// are multiplied by L^T, where L L^T is the information matrix of the link.
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
  // Scales the information matrices of each group of links, separately for rotation and
  // translation, to match the residuals of the group (variance components, Foerstner 1979).
  bool recalibrate = true;
  int recalibrations = 6;        // >= 1: maximum number of recalibration rounds
  double robust_scale = 4.1;     // >= 0: width of Cauchy's loss, standard deviations; 0: not robust
  double max_chi_square = 40.0;  // > 0: closures with a larger chi-square are rejected
  int gauge_node = 0;            // fixed node; 0: the first node of each component
};
void bind(ParameterTable& table, PoseGraphOptions& options);

struct LinkGroupResult {
  std::size_t links = 0;
  std::size_t rejected = 0;
  double translation_scale = 1.0;  // factor of the standard deviations
  double rotation_scale = 1.0;
  double redundancy = 0.0;                // degrees of freedom of the group's residuals
  double translation_rms_before_m = 0.0;  // accepted links at the input poses
  double rotation_rms_before_deg = 0.0;
  double translation_rms_m = 0.0;  // accepted links at the optimum
  double rotation_rms_deg = 0.0;
};

// Nodes that are connected by links. The pose of the gauge node is fixed. However, its tilt is free
// if the component has gravity links, and its whole pose is free if the component has priors.
struct GraphComponent {
  std::vector<int> nodes;
  int gauge_node = 0;
};

struct PoseGraphResult {
  std::map<int, Pose> map_from_base;              // nodes, and landmarks with negative numbers
  std::vector<GraphLinkResult> links;             // in the order of the input
  std::map<std::string, LinkGroupResult> groups;  // by GraphLink::group
  std::vector<GraphComponent> components;  // largest first; a node without links is a component
  std::vector<int> without_links;          // nodes without a link
  double initial_cost = 0.0;  // half the robust sum of squares before the last optimization
  double final_cost = 0.0;
  int iterations = 0;
  bool converged = true;
};

// Optimizes the poses from the initial `map_from_base`; links to nodes without a pose are ignored.
// A prior constrains a node's pose in the map frame. Gravity aligns a node's up direction with the
// map's z axis. Landmarks are points or poses observed from several nodes. Throws Error if
// require_usable rejects a link or an option is out of range.
PoseGraphResult optimize_pose_graph(const std::map<int, Pose>& map_from_base,
                                    const std::vector<GraphLink>& links,
                                    const PoseGraphOptions& options = {});

}  // namespace libmap
