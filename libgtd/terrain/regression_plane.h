// Fits the regression plane of a terrain and defines the terrain frame: origin at the centroid of
// the points, z out of the ground ("Graspable Target Detection for Hexapod Robots", 2023, eq.
// 2-13..2-21).
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <string_view>

#include "libmap/core/point_cloud.h"
#include "libmap/core/point_stream.h"
#include "libmap/core/pose.h"

namespace libgtd {

// thesis: the y axis is -(c x n) / |c x n|, with the centroid c and the normal n; it depends on the
// input frame's origin. corrected: x is the projection of the input frame's x axis into the plane;
// if that axis is normal to the plane, y is the projection of the input frame's y axis. robust: as
// corrected, with a robust plane fit that rocks do not tilt.
enum class PlaneMethod { thesis, corrected, robust };

// Criterion for the upper side of the plane. The first of these that applies is used.
enum class UpSource {
  direction,      // RegressionPlaneOptions::up was given
  viewpoint,      // the cloud's viewpoint is above, unless it is the identity
  normals,        // the cloud's normals point up, if consistent (normal_sides.h)
  frame_z,        // the input frame's z axis points up, if within 75 deg of the normal
  camera_origin,  // eq. 2-16: a camera at the input frame's origin is above, if the origin is
                  // farther from the plane than rmse_m
  relief          // bumps point up: the third moment of the heights is positive
};

struct RegressionPlaneOptions {
  PlaneMethod method = PlaneMethod::robust;
  std::optional<Eigen::Vector3d> up =
      std::nullopt;            // any length, cloud's frame; nullopt: the next criterion decides
  double max_tilt_deg = 90.0;  // maximum angle between `up` and the plane's normal
};

struct RegressionPlane {
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();          // in the input frame, meters
  libmap::Pose terrain_from_input = libmap::Pose::Identity();  // p' = R^T (p - c), R = terrain axes
  double rmse_m = 0;  // root mean square of the points' heights
  UpSource up_source = UpSource::frame_z;
  double relief_skewness = 0;        // skewness of the heights; negative: may be upside down
  std::optional<double> normals_up;  // share of the normals that point up, weighted by |cosine|
  double opposing_normals = 0;  // share of neighboring normals on opposite sides of the surface
  std::size_t points = 0;       // points with finite coordinates, which are fitted
  std::size_t skipped = 0;      // points with NaN or infinite coordinates
};

// Fits the plane by the smallest eigenvector of the points' covariance (eq. 2-13..2-15); points
// that are not finite are skipped. The origin is the centroid for each method. Throws Error for
// fewer than 3 points, coincident or collinear points, an `up` that is zero, within the plane or
// beyond max_tilt_deg, and with `thesis` if c is parallel to n.
RegressionPlane fit_regression_plane(const libmap::PointCloud& cloud,
                                     const RegressionPlaneOptions& options = {});
// Fits the plane to points that are read in blocks, in a few passes. The result is identical.
RegressionPlane fit_regression_plane(const libmap::PointStream& points,
                                     const RegressionPlaneOptions& options = {});

// Transforms the cloud into the terrain frame. `thesis` computes positions in single precision as
// R^T p - R^T c, as the author's program does.
libmap::PointCloud transform_to_terrain(const libmap::PointCloud& cloud,
                                        const RegressionPlane& plane, PlaneMethod method);

// Returns the name of the criterion: "direction", "viewpoint", ...
std::string_view to_text(UpSource source);

}  // namespace libgtd
