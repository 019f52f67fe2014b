// Graspability map: all scored voxels of a terrain.
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
  double score = 0.0;      // 0..1; can be negative with thesis, envelope
  bool convex = false;     // a convex point is near the center of the voxel
  bool graspable = false;  // by score, zero plane and (if evaluated) convexity
  bool border = false;     // the window of the mask extends beyond the scanned area
  Obstacle obstacle = Obstacle::none;
  ForceEstimate force{};  // calibrated only
  // Fraction of 16 azimuths in which the ground falls outward by more than GripperMask::min_fall_m;
  // only for upright masks of method corrected.
  double outward_fall_fraction = 1.0;
  float slope_deg = 0.0F;                             // SurfaceNormal::slope_deg
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();  // axis of the mask, in the terrain frame
};

// Optional content of a map: true if it was computed.
struct MapContent {
  bool normals = false;                 // axes of the mask, which was tilted
  bool slopes = false;                  // slope_deg, fitted for obstacles
  bool forces = false;                  // ForceEstimate of method calibrated
  bool outward_fall_fractions = false;  // MapVoxel::outward_fall_fraction
  bool obstacles = false;               // MapVoxel::obstacle, requires the whole map
};

struct GraspabilityMap {
  VoxelLattice lattice;  // in the terrain frame
  libmap::Pose terrain_from_input = libmap::Pose::Identity();
  double zero_plane_m = 0.0;  // in the terrain frame
  MapContent content;
  std::vector<MapVoxel> voxels;  // ascending
};

// Frame of a map's points. terrain: that of the regression plane. input: that of the scored cloud.
enum class MapFrame { terrain, input };
const std::vector<std::pair<std::string, MapFrame>>& map_frame_names();

// Returns one point per voxel at its center, colored by score (white below the zero plane), with
// the fields score, ssv, gsv, convex, graspable, border and the voxel index i, j, k. Depending on
// the content of the map also:
// - the axis of the mask as normal, which points to the gripper; slope_deg; obstacle (Obstacle),
// - falling_share: outward_fall_fraction, a factor of the score of method corrected,
// - the ForceEstimate: hold_probability (equal to the score), holding_force_n (median),
//   holding_force_low_n, holding_force_high_n, trial_spread, parameter_spread.
libmap::PointCloud to_cloud(const GraspabilityMap& map, MapFrame frame);

// Merges clouds that to_cloud made from parts of one map, ascending by i, j, k as in to_cloud of
// the whole map. Throws Error for a cloud without the fields i, j, k, clouds with different fields,
// colors or normals, and two points of one voxel.
libmap::PointCloud merge_map_clouds(const std::vector<libmap::PointCloud>& parts);

}  // namespace libgtd
