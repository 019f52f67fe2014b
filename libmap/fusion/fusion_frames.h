// Reads frames of a scan for fusion, with a cache of depth. Private to depth_fusion.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "libmap/camera/rgbd_frame.h"
#include "libmap/core/pose.h"
#include "libmap/core/pose_graph.h"
#include "libmap/fusion/depth_projection.h"
#include "libmap/fusion/surface_refinement.h"
#include "libmap/scan/scan_source.h"

namespace libmap {

struct FusionFrame {
  int node = 0;
  Pose grid_from_base = Pose::Identity();  // grid frame: world frame with origin at grid_origin
  std::size_t image_pixels = 0;            // number of pixels of the frame's images
  // Box in the grid frame, m, around the cameras and all measured points.
  Eigen::AlignedBox3d reach;
  double max_ray_length = 1.0;   // maximum ratio of a ray's length to its depth
  double max_pixel_pitch = 0.0;  // maximum distance between adjacent rays at depth 1
};

// Returns the frame at its pose; fields from image_pixels on are not set. Throws Error if the pose
// or the maximum depth is too far from the grid's origin for the voxel size.
FusionFrame frame_at(const TrajectoryPose& pose, const Eigen::Vector3d& grid_origin,
                     double voxel_size_m, double max_depth_m);

// Transforms the frame's pose and reach in the grid frame.
void move(FusionFrame& frame, const Pose& moved_from_grid);

class FusionFrames {
 public:
  struct Options {
    bool stereo = false;
    bool strict = false;  // throw Error if color cannot be decoded; otherwise it is ignored
  };
  FusionFrames(const ScanSource& scan, const Options& options) : scan_(scan), options_(options) {}

  // Returns the frame's depth and cameras, cached up to a limit. Throws Error if the frame has no
  // depth or calibration or cannot be decoded. Can be called from several threads.
  std::shared_ptr<const RgbdFrame> depth_of(int node);
  // Removes the depth of all other frames from the cache.
  void evict_others(std::span<const FusionFrame> frames);

  // Returns true if the first element of `frames` has a color image.
  bool has_color(std::span<const FusionFrame> frames);

  std::shared_ptr<const PixelRays> rays_of(const Camera& camera) { return rays_.rays_of(camera); }

  // Sets reach, ray length and pixel pitch of `frame` from its depth image and pose. Throws Error
  // for an invalid camera. Can be called from several threads.
  void measure_reach(const RgbdFrame& depth, double max_depth_m, FusionFrame& frame);

  // Calls use(views, n) for successive groups of n frames. RefinementView::frame is the index of
  // the frame in the list `frames`.
  using UseViews = std::function<void(std::span<const RefinementView> views, std::size_t frames)>;
  void each_view_group(std::span<const FusionFrame> frames, bool color, const UseViews& use);

  // Returns one view per camera, with RefinementView::frame = `number`. Thread-safe.
  std::vector<RefinementView> views_of(const FusionFrame& frame, std::uint32_t number, bool color);

 private:
  const ScanSource& scan_;
  Options options_;
  PixelRayCache rays_;
  std::mutex mutex_;  // protects kept_ and kept_bytes_
  std::map<int, std::shared_ptr<const RgbdFrame>> kept_;
  std::size_t kept_bytes_ = 0;
};

}  // namespace libmap
