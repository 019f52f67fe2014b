// Normals of a cloud that has none: planes through each point's neighbors, turned to the side from
// which the surface was seen.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string_view>
#include <utility>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"

namespace libmap {

struct NormalEstimationOptions {
  int neighbors = 16;  // 3 to 1000: nearest points that a plane is fitted to, the point's own too
};
void bind(ParameterTable& table, NormalEstimationOptions& options);

// By what the sides of normals were chosen.
enum class NormalOrientation {
  view_fields,   // fields vp_x, vp_y, vp_z: where each point was seen from, as PCL names them
  viewpoint,     // the cloud's viewpoint, where it is not the identity
  spanning_tree  // neighbors look the same way; most of each part outwards or up
};
std::string_view to_text(NormalOrientation orientation);

struct NormalEstimationResult {
  // Unit; zero where the neighbors lie on a line or in one place.
  std::vector<Eigen::Vector3f> normals;
  std::size_t undefined = 0;  // normals that are zero
  NormalOrientation orientation = NormalOrientation::spanning_tree;
  std::size_t parts = 0;  // of the graph of neighbors, each with sides of its own
};

// Planes of total least squares (Hoppe et al. 1992, section 3.2). Without views, sides go along the
// minimum spanning tree of the graph of neighbors, by which the least turning neighbor decides
// (section 3.3); of each part they are such that it looks away from its middle or, where it rather
// has an up than an outside, up. The same for any number of threads. Throws Error: an option out of
// its range.
NormalEstimationResult estimate_normals(const PointCloud& cloud,
                                        const NormalEstimationOptions& options = {});

// The cloud's own normals as unit vectors, with sides chosen in the same way; NaN becomes zero.
NormalEstimationResult orient_normals(const PointCloud& cloud);

}  // namespace libmap
