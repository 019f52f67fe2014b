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

// Measures slope and area. The normal of a voxel is from a quadric fitted to the voxel centers
// (curvature.h). The area is K / sum w, with the weights w = 1 - d^2 / r^2 of the voxels at
// distances d < r (Epanechnikov kernel; the part of d along the normal is reduced by half a voxel)
// and the integral K = pi r^2 / 2 of w over a disc. More voxels on slopes and gaps in sparse clouds
// do not affect the area. Near a border, the weighted mean of the voxels is off-center. The surface
// is assumed to end at the straight edge that explains this mean, and K is integrated over the
// remaining part of the disc; areas at corners are up to a fifth too large. Without a normal (too
// few neighbors), the slope is NaN, the area that of a voxel face. Throws Error for a radius < 0.
MapSurface measure_surface(const VoxelMap& map, const MapSurfaceOptions& options = {});

}  // namespace libgtd
