// Slope and surface area of the ground at each voxel of a map.
#pragma once

#include <cstddef>
#include <vector>

#include "libgtd/evaluate/voxel_map.h"
#include "libmap/core/parameters.h"

namespace libgtd {

struct MapSurfaceOptions {
  // Radius of the normal fits and of the estimates of the voxel density, m; 0: six voxel edges.
  double surface_radius_m = 0.0;
};
void bind(libmap::ParameterTable& table, MapSurfaceOptions& options);

// Surface of a map, one entry per voxel.
struct MapSurface {
  double radius_m = 0.0;         // the radius that was used
  std::vector<float> slope_deg;  // angle of the surface to the horizontal, 0..90; NaN: unknown
  std::vector<float> area_m2;    // surface area of the voxel

  // Returns the area projected to the horizontal plane; the whole area if the slope is unknown.
  double plan_area_m2(std::size_t n) const;
};

// Measures slope and area. Normals are from quadrics fitted to the voxel centers (curvature.h). The
// area of a voxel is the inverse of the density of surface voxels: the sum of 1 - d^2 / r^2 over
// the voxels at distances d < r (Epanechnikov kernel), divided by the mass of the kernel pi r^2 /
// 2. The area is independent of the larger number of voxels on slopes, and of gaps in clouds with
// fewer points than voxels. At a border, the mean of the weights is off-center. The surface is then
// assumed to end at a straight edge at the distance that explains this mean, and the kernel is
// integrated over the remaining part of the disc; areas at corners are up to a fifth too large.
// Distances across the surface are reduced by half a voxel. A voxel with too few neighbors for a
// normal counts as one horizontal face. Throws Error for a negative radius.
MapSurface measure_surface(const VoxelMap& map, const MapSurfaceOptions& options = {});

}  // namespace libgtd
