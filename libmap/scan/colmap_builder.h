// Converts a scan to a COLMAP model; the points are from the scan's depth images.
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
  int point_spacing_px = 16;      // > 0, spacing of an image's points in both directions
  double depth_tolerance = 0.02;  // > 0, share of the depth within which points are identical
};
void bind(ParameterTable& table, ColmapBuilderOptions& options);

// Each image adds points on a pixel grid, in cells with smooth depth that observe no earlier point.
// Later images observe a point at its projection if their depth agrees, so that reprojection errors
// are 0 by construction (ERROR is -1: unknown). Images with equal cameras share a camera.
class ColmapBuilder {
 public:
  explicit ColmapBuilder(const ColmapBuilderOptions& options = {});  // an empty model

  // Adds an image; ids start at 1 in the order of calls. An image without depth gets no points and
  // no features. Throws Error if COLMAP has no equivalent camera model.
  void add_image(const std::string& name, const CameraView& view, const Pose& world_from_camera);

  const ColmapModel& model() const { return model_; }

 private:
  int add_camera(const ColmapCamera& camera);
  void add_observation(int id, std::int64_t point, const Eigen::Vector2d& pixel);
  // Sets the pixels of `taken` (one per cell of the grid) to non-zero for cells with an
  // observation.
  void observe_points(int id, const CameraView& view, GrayImage& taken);
  void add_points(int id, const CameraView& view, const Pose& world_from_camera,
                  const GrayImage& taken);

  ColmapBuilderOptions options_;
  ColmapModel model_;
  std::map<std::string, int> camera_of_text_;
};

}  // namespace libmap
