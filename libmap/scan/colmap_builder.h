// A scan as a model of COLMAP, with points that its depth images measured.
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
  int point_spacing_px = 16;      // > 0: of an image's points, in both directions
  double depth_tolerance = 0.02;  // > 0, share of the depth: two measurements of the same point
};
void bind(ParameterTable& table, ColmapBuilderOptions& options);

// Points come from the first image that shows them: one in the middle of each square of the
// spacing, where depth is smooth and no earlier point lies. Later images observe them where their
// depth agrees, at the pixel to which they project, so that reprojection errors are 0 by
// construction (ERROR is -1: not known). Images with equal cameras share one.
class ColmapBuilder {
 public:
  explicit ColmapBuilder(const ColmapBuilderOptions& options = {});  // an empty model

  // Image ids count from 1 in this order. Without depth the image gets neither points nor features.
  // Throws Error: COLMAP has no such camera.
  void add_image(const std::string& name, const CameraView& view, const Pose& world_from_camera);

  const ColmapModel& model() const { return model_; }

 private:
  int add_camera(const ColmapCamera& camera);
  void add_observation(int id, std::int64_t point, const Eigen::Vector2d& pixel);
  // Squares of the spacing that hold an observation are not 0 in `taken`.
  void observe_points(int id, const CameraView& view, GrayImage& taken);
  void add_points(int id, const CameraView& view, const Pose& world_from_camera,
                  const GrayImage& taken);

  ColmapBuilderOptions options_;
  ColmapModel model_;
  std::map<std::string, int> camera_of_text_;
};

}  // namespace libmap
