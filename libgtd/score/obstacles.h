// Places of a map that are too high and too steep to be reached, for a planner (slope and step
// height as measures of traversability: Wermelinger et al., "Navigation Planning for Legged Robots
// in Challenging Terrain", 2016).
#pragma once

#include <cstdint>
#include <vector>

#include "libgtd/terrain/voxel_lattice.h"

namespace libgtd {

// face: part of a steep face that is too high. unreachable: ground on top of such faces, to which
// no way leads from the largest ground.
enum class Obstacle : std::uint8_t { none = 0, face = 1, unreachable = 2 };

struct ObstacleOptions {
  double slope_deg = 60.0;  // beyond it a voxel is steep
  double height_m = 0.3;    // beyond it a face is too high
  // Within which the slopes were fitted: a fit mixes a face with the ground at its foot and on its
  // top, so that a face's rise is measured that far beyond its steep voxels.
  double normal_radius_m = 0.07;
};

// Voxels belong together if they are at most this many apart along each axis: a cloud leaves gaps.
inline constexpr int obstacle_link_voxels = 2;

// Of each of `voxels`, which ascend; all of a map, since a face may cross any number of tiles.
// - Steep voxels that belong together are a face. Its foot and its top are the lowest and the
//   highest voxel within the normals' radius of its voxels. It is an obstacle if its top lies more
//   than height_m above its foot.
// - All other voxels that belong together are a region; the one with the most voxels is the ground
//   (of equals, that of the first voxel). Another region is unreachable if it meets a face that is
//   an obstacle in the upper half of its rise, or more than height_m above its foot. One that meets
//   faces at their feet alone is not: behind what hid it from the sensor the way may go on.
// Slopes that are NaN are not steep. Throws Error for slopes not as many as voxels, voxels that do
// not ascend.
std::vector<Obstacle> find_obstacles(const std::vector<Voxel>& voxels,
                                     const std::vector<float>& slopes_deg, double voxel_size_m,
                                     const ObstacleOptions& options);

}  // namespace libgtd
