// Estimates normals of a cloud by planes through neighboring points, and orients the normals.
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
  int neighbors = 16;  // 3 to 1000: number of points of a plane fit, including the point itself
};
void bind(ParameterTable& table, NormalEstimationOptions& options);

// Source of the orientation of normals.
enum class NormalOrientation {
  view_fields,   // sensor position per point in the fields vp_x, vp_y, vp_z, as in PCL
  viewpoint,     // the cloud's viewpoint, if it is not the identity
  spanning_tree  // consistent between neighbors; each connected component points outwards or up
};
std::string_view to_text(NormalOrientation orientation);

struct NormalEstimationResult {
  // Unit normals, one per point; zero if the neighbors are collinear or coincide.
  std::vector<Eigen::Vector3f> normals;
  std::size_t undefined = 0;  // number of zero normals
  NormalOrientation orientation = NormalOrientation::spanning_tree;
  std::size_t parts = 0;  // connected components of the graph of neighbors; spanning_tree only
};

// Fits planes by total least squares (Hoppe et al. 1992, section 3.2). If the cloud has no sensor
// position, orientations are propagated along the minimum spanning tree of the graph of neighbors,
// weighted by the angle between normals (section 3.3). Each component is then oriented away from
// its center or up, whichever direction its normals are more parallel to on average. Throws Error
// if an option is out of range or the cloud is inconsistent.
NormalEstimationResult estimate_normals(const PointCloud& cloud,
                                        const NormalEstimationOptions& options = {});

// Normalizes the stored normals of the cloud and orients the normals like estimate_normals; NaN
// becomes zero. Throws Error if the cloud is inconsistent.
NormalEstimationResult orient_normals(const PointCloud& cloud);

}  // namespace libmap
