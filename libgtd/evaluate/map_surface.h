// How a map's ground lies: its slope, and the area of surface that each voxel stands for.
#pragma once

#include <cstddef>
#include <vector>

#include "libgtd/evaluate/voxel_map.h"
#include "libmap/core/parameters.h"

namespace libgtd {

struct MapSurfaceOptions {
  // The surface's normal is fitted, and its voxels are counted, within; 0: six voxels.
  double surface_radius_m = 0.0;
};
void bind(libmap::ParameterTable& table, MapSurfaceOptions& options);

// One entry per voxel of the map.
struct MapSurface {
  double radius_m = 0.0;         // that was used
  std::vector<float> slope_deg;  // between the surface and the level, 0..90; NaN: not known
  std::vector<float> area_m2;    // of the surface

  // The area seen from above; of a surface whose slope is not known, the whole.
  double plan_area_m2(std::size_t n) const;
};

// Normals are those of quadrics fitted to the voxels' centers (curvature.h). The area that a voxel
// stands for is one over the density of voxels on the surface there: the sum of 1 - d^2 / r^2 over
// the voxels at distances d < r (Epanechnikov's kernel), by the kernel's whole mass pi r^2 / 2. So
// it depends neither on how many voxels a slope has more than its plan, nor on a cloud that has
// fewer points than voxels. Where the mean of the weights lies to one side, the ground ends at a
// straight edge on the other, at the distance that makes this mean, and the mass is that of the
// disc's rest: corners come out up to a fifth too large. Of distances across the surface half a
// voxel is left out. A voxel with too few others around it for a normal counts as one level face.
// Throws Error for a negative radius.
MapSurface measure_surface(const VoxelMap& map, const MapSurfaceOptions& options = {});

}  // namespace libgtd
