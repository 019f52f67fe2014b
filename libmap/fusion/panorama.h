// One cloud in the robot's frame from the depth images of its cameras.
#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "libmap/core/camera.h"
#include "libmap/core/image.h"
#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/result_table.h"

namespace libmap {

// What one camera measured.
struct PanoramaView {
  std::string name{};  // in errors
  int index = 0;       // in the field `camera`
  Camera camera{};     // of the size of `depth`; base_from_camera is robot_from_camera
  DepthImage depth{};
  double near_m = 0.0;  // z outside near..far is dropped
  double far_m = std::numeric_limits<double>::infinity();
};

struct PanoramaOptions {
  int stride_px = 1;  // >= 1: takes every n-th row and column
  // >= 0; drops pixels further than this in front of or behind both neighbors in their row or
  // column: between the edge of one surface and the next. 0: none are dropped.
  double flying_pixel_jump_m = 0.0;
  // Of the surface through a pixel and its four neighbors, towards the camera, of unit length; 0 0
  // 0 where neighbors are missing or nearer or further by normal_jump_m.
  bool normals = false;
  double normal_jump_m = 0.05;  // > 0
};
void bind(ParameterTable& table, PanoramaOptions& options);

struct PanoramaCounts {
  std::size_t pixels = 0;      // looked at: every stride-th
  std::size_t unmeasured = 0;  // no depth
  std::size_t too_near = 0;
  std::size_t too_far = 0;
  std::size_t flying = 0;
  std::size_t without_ray = 0;  // outside what the lens distortion can undo
  std::size_t points = 0;
};
void describe(ResultTable& table, const PanoramaCounts& counts);

struct PanoramaResult {
  PointCloud cloud;                   // robot's frame, by view, row and column; field `camera`
  std::vector<PanoramaCounts> views;  // as the input's
};

// Back-projection (thesis eq. 2-12: x = (u - cx) d / fx, y = (v - cy) d / fy, z = d, with the lens
// distortion removed first), then robot_from_camera (eq. 3-1 to 3-4). Images are as large as their
// calibrations say.
PanoramaResult make_panorama(const std::vector<PanoramaView>& views,
                             const PanoramaOptions& options = {});

}  // namespace libmap
