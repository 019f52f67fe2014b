// Finds redundant frames, which add little information to earlier frames. Private to depth_fusion.
#pragma once

#include <cstdint>
#include <vector>

#include "libmap/core/pose.h"
#include "libmap/fusion/depth_noise.h"
#include "libmap/fusion/depth_projection.h"
#include "libmap/geometry/voxel_key.h"

namespace libmap {

// Information of one frame: inverse variances of sampled pixels, summed per cell of the grid.
struct FrameCoverage {
  VoxelIndex cells;
  std::vector<float> information;     // 1/m^2, one per cell
  std::vector<std::uint32_t> pixels;  // number of pixels, one per cell

  // Adds about 5000 pixels of a depth image, within the sensor's range.
  void add(const DepthImage& depth, const PixelRays& rays, const Pose& grid_from_camera,
           const DepthSensor& sensor, double cell_size_m);
};

class ViewCoverage {  // information of all frames that were added
 public:
  // Returns true if over 5 % of the frame's pixels are in cells that are new, or in which the frame
  // adds more than 1/views of the present information.
  bool is_improved_by(const FrameCoverage& frame, double views) const;
  void add(const FrameCoverage& frame);

 private:
  VoxelIndex cells_;
  std::vector<float> information_;
};

}  // namespace libmap
