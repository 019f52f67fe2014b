// Combines the depth images of a robot's cameras into one cloud in the robot's frame.
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

// Depth image of one camera.
struct PanoramaView {
  std::string name{};  // for error messages
  int index = 0;       // value of the field `camera`
  Camera camera{};     // same size as `depth`; base_from_camera is robot_from_camera
  DepthImage depth{};
  double near_m = 0.0;  // pixels with z outside near_m to far_m are dropped
  double far_m = std::numeric_limits<double>::infinity();
};

struct PanoramaOptions {
  int stride_px = 1;  // >= 1: uses every n-th row and column
  // >= 0: drops flying pixels, i.e. pixels whose depth differs by more than this from both
  // neighbors in the row or column; 0: keeps all pixels.
  double flying_pixel_jump_m = 0.0;
  // Adds unit normals of the surface through a pixel and its four neighbors, towards the camera;
  // zero if neighbors are missing or neighboring depths differ by more than normal_jump_m.
  bool normals = false;
  double normal_jump_m = 0.05;  // > 0: maximum depth difference of neighbors
};
void bind(ParameterTable& table, PanoramaOptions& options);

struct PanoramaCounts {
  std::size_t pixels = 0;      // examined pixels: every stride_px-th row and column
  std::size_t unmeasured = 0;  // no depth
  std::size_t too_near = 0;
  std::size_t too_far = 0;
  std::size_t flying = 0;       // flying_pixel_jump_m
  std::size_t without_ray = 0;  // lens distortion cannot be inverted
  std::size_t points = 0;
};
void describe(ResultTable& table, const PanoramaCounts& counts);

struct PanoramaResult {
  PointCloud cloud;                   // robot's frame, by view, row and column; field `camera`
  std::vector<PanoramaCounts> views;  // one per input view
};

// Back-projects each pixel (u, v) with depth d: x = (u - cx) d / fx, y = (v - cy) d / fy, z = d,
// after removal of lens distortion (eq. 2-12 of the thesis, see README). Then applies
// robot_from_camera (eq. 3-1 to 3-4). Throws Error if an option is out of range.
PanoramaResult make_panorama(const std::vector<PanoramaView>& views,
                             const PanoramaOptions& options = {});

}  // namespace libmap
