// Colors and fields of a cloud given to the vertices of a mesh near it.
#pragma once

#include "libmap/core/point_cloud.h"
#include "libmap/core/point_tree.h"
#include "libmap/core/triangle_mesh.h"

namespace libmap {

// Each vertex takes the mean of the 4 nearest points, weighted by 1 / (d^2 + radius^2); fields of
// whole numbers the nearest point's value. A NaN of one point counts for nothing. Replaces colors
// and fields; `tree` holds the cloud's positions.
void carry_values(const PointCloud& cloud, const PointTree& tree, double radius_m,
                  TriangleMesh& mesh);

}  // namespace libmap
