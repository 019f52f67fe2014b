// The plane that fits a terrain best, and the terrain frame in it: origin in the points' centroid,
// z out of the ground ("Graspable Target Detection for Hexapod Robots", 2023, eq. 2-13..2-21).
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <string_view>

#include "libmap/core/point_cloud.h"
#include "libmap/core/point_stream.h"
#include "libmap/core/pose.h"

namespace libgtd {

// thesis: the heading is y = (c x n) / |c x n|, which turns with the distance to the input's
// origin. corrected: x is the input frame's x axis laid into the plane, or, where that axis stands
// on the plane, y is the input frame's y axis laid into it. robust: the same with the normal of the
// ground, to which rocks do not tilt it.
enum class PlaneMethod { thesis, corrected, robust };

// What decided which side of the plane is up, in the order in which they are asked.
enum class UpSource {
  direction,      // RegressionPlaneOptions::up
  viewpoint,      // the cloud's viewpoint, if it is not the identity, lies above
  normals,        // the cloud's normals point up, if they agree (normal_sides.h)
  frame_z,        // the input frame's z axis points up; asked if it is within 75 deg of the normal
  camera_origin,  // eq. 2-16: a camera in the input frame's origin lies above; asked if the origin
                  // is farther from the plane than rmse_m
  relief          // bumps point up: the heights' third moment is positive
};

struct RegressionPlaneOptions {
  PlaneMethod method = PlaneMethod::robust;
  std::optional<Eigen::Vector3d> up =
      std::nullopt;            // a direction of any length in the cloud's frame
  double max_tilt_deg = 90.0;  // between `up` and the plane's normal
};

struct RegressionPlane {
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();          // in the input frame, meters
  libmap::Pose terrain_from_input = libmap::Pose::Identity();  // p' = R^T (p - c), R = [x, -y, n]
  double rmse_m = 0;                                           // of the points' heights
  UpSource up_source = UpSource::frame_z;
  double relief_skewness = 0;        // of the heights over the plane; negative hints at upside down
  std::optional<double> normals_up;  // share of the normals that point up, weighted by |cosine|
  double opposing_normals = 0;       // share of neighbors on opposite sides (normal_sides.h)
  std::size_t points = 0;            // finite points that were fitted
  std::size_t skipped = 0;           // points with NaN or infinite coordinates
};

// Fits by the smallest eigenvector of the points' covariance (eq. 2-13..2-15). The origin is the
// points' centroid with each method. Points that are not
// finite are skipped. Throws Error for fewer than 3 points, for points that all lie in one place or
// on one line, for an `up` of no length, within the plane or beyond max_tilt_deg, and with `thesis`
// where c is parallel to n.
RegressionPlane fit_regression_plane(const libmap::PointCloud& cloud,
                                     const RegressionPlaneOptions& options = {});
// The same of points in blocks, in a few passes; equal to the bit.
RegressionPlane fit_regression_plane(const libmap::PointStream& points,
                                     const RegressionPlaneOptions& options = {});

// The cloud in the terrain frame. `thesis` computes the positions in single precision, as the
// author's program does: R^T p - R^T c.
libmap::PointCloud transform_to_terrain(const libmap::PointCloud& cloud,
                                        const RegressionPlane& plane, PlaneMethod method);

// "direction", "viewpoint", ...
std::string_view to_text(UpSource source);

}  // namespace libgtd
