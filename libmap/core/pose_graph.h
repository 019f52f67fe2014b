// Pose graph of a scan: nodes, links between poses, and trajectories.
#pragma once

#include <Eigen/Core>
#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "libmap/core/pose.h"

namespace libmap {

// Types of links, with RTAB-Map's numbers.
enum class LinkType {
  neighbor = 0,
  global_closure = 1,
  local_space_closure = 2,
  local_time_closure = 3,
  user_closure = 4,
  virtual_closure = 5,
  neighbor_merged = 6,
  pose_prior = 7,  // of one node: PoseLink::from = to
  landmark = 8,    // from a node to a landmark: PoseLink::to < 0
  gravity = 9      // of one node: PoseLink::from = to
};
// Returns "neighbor", "global closure", ...; "type N" for an unknown number.
std::string to_text(LinkType type);

using Matrix6d = Eigen::Matrix<double, 6, 6>;

// Relative pose between two nodes, given by their ids: pose_to = pose_from * from_from_to.
struct PoseLink {
  int from = 0;  // node id
  int to = 0;    // node id; of a landmark: < 0
  LinkType type = LinkType::neighbor;
  Pose from_from_to = Pose::Identity();
  // Inverse covariance in the order x y z roll pitch yaw, m and rad.
  Matrix6d information = Matrix6d::Identity();
};
// True for links that concern one node (from = to): pose priors and gravity.
bool is_absolute(const PoseLink& link);

// Readers accept poses and information matrices with absolute values up to these bounds, so that
// values remain in range in all file formats (some multiply information entries by 4).
inline constexpr double max_position_m = 1e8;
inline constexpr double max_information = 1e300;

struct GpsFix {
  double stamp_s = 0.0;
  double longitude_deg = 0.0;
  double latitude_deg = 0.0;
  double altitude_m = 0.0;
  double error_m = 0.0;      // accuracy that the receiver reports
  double bearing_deg = 0.0;  // clockwise from north
};

// Node of the pose graph: one frame of the scan.
struct GraphNode {
  static constexpr int invalid_weight = -9;  // RTAB-Map's weight of nodes without usable data

  int id = 0;       // > 0, unique
  int session = 0;  // recording session; odometry does not connect nodes of different sessions
  int weight = 0;   // RTAB-Map's: >= 0 normal, -1 intermediate, -9 invalid
  double stamp_s = 0.0;
  std::string label{};                              // name by the user; mostly empty
  std::optional<Pose> odometry_from_base{};         // pose by odometry
  std::optional<Pose> truth_from_base{};            // true pose, in the frame of the ground truth
  std::optional<std::array<double, 6>> velocity{};  // by RTAB-Map: x y z roll pitch yaw, m/s, rad/s
  std::optional<GpsFix> gps{};
};

struct PoseGraph {
  std::vector<GraphNode> nodes;                 // by ascending id
  std::vector<PoseLink> links;                  // each link once, in one of its directions
  std::map<int, Pose> optimized_map_from_base;  // by node id, stored with the scan; can be empty

  // Returns the node with this id, or nullptr.
  const GraphNode* find_node(int id) const;
};

// Pose of a trajectory. The node id `node` is 0 if only the time is known.
struct TrajectoryPose {
  int node = 0;
  double stamp_s = 0.0;
  Pose world_from_base = Pose::Identity();
};
using Trajectory = std::vector<TrajectoryPose>;

// Source of a scan's stored poses: odometry, optimized by the recording program, or ground truth.
enum class PoseSource { odometry, optimized, ground_truth };
std::string to_text(PoseSource source);  // "odometry", "optimized", "ground-truth"

// Returns the poses of a source in ascending order of node ids, without invalid nodes and nodes
// that have no pose of this source.
Trajectory trajectory_of(const PoseGraph& graph, PoseSource source);

// Returns the sum of the distances between consecutive poses, m.
double path_length(const Trajectory& trajectory);

// Camera pose of an image.
struct ImagePose {
  std::string image{};                        // file name, as in the pose file
  Pose world_from_camera = Pose::Identity();  // optical frame: z forward, x right, y down
};

}  // namespace libmap
