// Makes a COLMAP model from the images of a scan, with 3-D points from the depth images.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "libmap/camera/rgbd_frame.h"
#include "libmap/core/parameters.h"
#include "libmap/core/pose.h"
#include "libmap/poses/colmap_io.h"

namespace libmap {

struct ColmapBuilderOptions {
  int point_spacing_px = 16;      // 1 to 10000: spacing of an image's points in x and in y
  double depth_tolerance = 0.02;  // > 0: maximum relative depth difference between image and point
};
void bind(ParameterTable& table, ColmapBuilderOptions& options);

// An image observes each earlier point that agrees with its depth at the projection, so that
// reprojection errors are 0 by construction (stored as -1, unknown). It adds a point at the center
// of each grid cell in which it observes no point, if it has depth there and no depth edge. Images
// of cameras with equal intrinsics share a COLMAP camera.
class ColmapBuilder {
 public:
  explicit ColmapBuilder(const ColmapBuilderOptions& options = {});  // an empty model

  // Adds an image; image ids start at 1 in the order of calls. An image without depth has no points
  // or observations. Throws Error if COLMAP has no model that is equivalent to the color camera.
  void add_image(const std::string& name, const CameraView& view, const Pose& world_from_camera);

  const ColmapModel& model() const { return model_; }

 private:
  int add_camera(const ColmapCamera& camera);
  void add_observation(int id, std::int64_t point, const Eigen::Vector2d& pixel);
  // Sets the pixels of `taken` (one per cell of the grid) to 1 for cells with an observation.
  void observe_points(int id, const CameraView& view, GrayImage& taken);
  void add_points(int id, const CameraView& view, const Pose& world_from_camera,
                  const GrayImage& taken);

  ColmapBuilderOptions options_;
  ColmapModel model_;
  std::map<std::string, int> camera_of_text_;
};

}  // namespace libmap
