// Finds obstacles for a planner: voxels of a map on faces that are too steep and too high to climb,
// and the ground above them (slope and step height as measures of traversability: Wermelinger et
// al., "Navigation Planning for Legged Robots in Challenging Terrain", 2016).
#pragma once

#include <cstdint>
#include <vector>

#include "libgtd/terrain/voxel_lattice.h"

namespace libgtd {

// face: part of a steep face that is too high. unreachable: ground above such faces that is not
// connected to the largest region of ground.
enum class Obstacle : std::uint8_t { none = 0, face = 1, unreachable = 2 };

struct ObstacleOptions {
  double slope_deg = 60.0;  // voxels with a larger slope are steep
  double height_m = 0.3;    // a face with a larger rise is an obstacle
  // Radius of the slope fits. A fit mixes a face with the ground at the foot and top of the face;
  // the rise is therefore measured up to this distance from the steep voxels.
  double normal_radius_m = 0.07;
};

// Maximum difference of i, j and k of connected voxels; 2 bridges small gaps of a cloud.
inline constexpr int obstacle_link_voxels = 2;

// Returns the class of each voxel. The voxels must ascend by i, j, k and form a complete map,
// because a face may cross tiles.
// - Connected steep voxels form a face. The foot and top of a face are the lowest and highest
//   voxels within normal_radius_m of the face. A face is an obstacle if its top is more than
//   height_m above its foot.
// - Connected voxels outside obstacle faces form a region. The region with the most voxels is the
//   ground (of equal ones, the region of the first voxel). Another region is unreachable if one of
//   the voxels is connected to an obstacle face in the upper half of the face, or more than
//   height_m above the foot. A region that is connected only to the lower parts of faces remains
//   reachable, because a path may exist in an area that the sensor did not see.
// Slopes that are NaN are not steep. Throws Error if the numbers of slopes and voxels differ, the
// voxels do not ascend, or an option is out of range.
std::vector<Obstacle> find_obstacles(const std::vector<Voxel>& voxels,
                                     const std::vector<float>& slopes_deg, double voxel_size_m,
                                     const ObstacleOptions& options);

}  // namespace libgtd
