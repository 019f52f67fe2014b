// The result of a detection: every scored voxel of a terrain.
#pragma once

#include <vector>

#include "libgtd/score/obstacles.h"
#include "libgtd/score/tiling.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/pose.h"

namespace libgtd {

struct MapVoxel {
  Voxel voxel;
  VoxelCounts counts;
  double score = 0.0;      // 0..1; `thesis` can go below
  bool convex = false;     // a convex point lies close to its center
  bool graspable = false;  // score, zero plane and, if it was evaluated, convexity say yes
  bool border = false;     // the mask's window leaves the scanned area
  Obstacle obstacle = Obstacle::none;
  ForceEstimate force{};                              // of method calibrated
  double falling_share = 1.0;                         // of method corrected, upright masks
  float slope_deg = 0.0F;                             // of the surface, as SurfaceNormal
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();  // in the terrain frame: the mask's axis
};

// What a map says beside its scores.
struct MapContent {
  bool normals = false;         // the mask was tilted
  bool slopes = false;          // obstacles are evaluated
  bool forces = false;          // the method is calibrated
  bool falling_shares = false;  // the method is corrected, its masks upright
  bool obstacles = false;       // and the whole map is there to evaluate them
};

struct GraspabilityMap {
  VoxelLattice lattice;  // in the terrain frame
  libmap::Pose terrain_from_input = libmap::Pose::Identity();
  double zero_plane_m = 0.0;  // in the terrain frame
  MapContent content;
  std::vector<MapVoxel> voxels;  // ascending
};

// terrain: the frame of the regression plane. input: the frame of the cloud that was scored.
enum class MapFrame { terrain, input };
const std::vector<std::pair<std::string, MapFrame>>& map_frame_names();

// A point for each voxel, at its center, colored by score and white below the zero plane, with the
// fields score, ssv, gsv, convex, graspable, border and the voxel's i, j, k on the lattice. As the
// content says: the mask's axis as the point's normal, from which the gripper comes; the fields
// slope_deg and obstacle (the number of an Obstacle); falling_share, by which a score of method
// `corrected` is multiplied; the ForceEstimate as hold_probability (the score again),
// holding_force_n (median), holding_force_low_n, holding_force_high_n, trial_spread and
// parameter_spread.
libmap::PointCloud to_cloud(const GraspabilityMap& map, MapFrame frame);

// Evaluates the obstacles of a map that has slopes, once all of it is there: sets each point's
// field obstacle. Throws Error: a map without the fields i, j, k, slope_deg, or not ascending by
// them.
std::size_t add_obstacles(libmap::PointCloud& map, double voxel_size_m,
                          const ObstacleOptions& options);

// The points of several clouds made by to_cloud of one map, ascending by i, j, k, as to_cloud of
// the whole map orders them. Throws Error: a cloud without the fields i, j, k, clouds of different
// fields, or two points of one voxel.
libmap::PointCloud merge_map_clouds(const std::vector<libmap::PointCloud>& parts);

}  // namespace libgtd
