// The frames of a scan as fusion needs them, decoded as seldom as memory allows. Inner part of
// depth_fusion.
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
  Pose grid_from_base = Pose::Identity();
  std::size_t image_pixels = 0;
  // In the grid, m: the cameras, and what their rays pass up to the surface or the greatest depth.
  Eigen::AlignedBox3d reach;
  double max_ray_length = 1.0;   // in depths
  double max_pixel_pitch = 0.0;  // the same
};

// The frame at its pose, without a reach. Throws Error where that lies too far from the grid's
// origin for the voxel size.
FusionFrame frame_at(const TrajectoryPose& pose, const Eigen::Vector3d& grid_origin,
                     double voxel_size_m, double max_depth_m);

// The frame where its pose is moved to, with its reach.
void move(FusionFrame& frame, const Pose& moved_from_grid);

class FusionFrames {
 public:
  struct Options {
    bool stereo = false;
    bool strict = false;  // color that cannot be decoded is an Error
  };
  FusionFrames(const ScanSource& scan, const Options& options) : scan_(scan), options_(options) {}

  // The frame's depth alone, with its cameras; kept for later calls while there is room. Throws
  // Error: it has no depth or no calibration, or cannot be decoded. May be called from several
  // threads.
  std::shared_ptr<const RgbdFrame> depth_of(int node);
  // Makes room: forgets the depth of all other frames.
  void keep_only(std::span<const FusionFrame> frames);

  // Whether the first of these frames has a color image.
  bool has_color(std::span<const FusionFrame> frames);

  std::shared_ptr<const PixelRays> rays_of(const Camera& camera) { return rays_.rays_of(camera); }

  // Sets all of `frame` that follows from its depth image and its pose. Throws Error: a camera that
  // cannot be. May be called from several threads.
  void measure_reach(const RgbdFrame& depth, double max_depth_m, FusionFrame& frame);

  // use(views, frames) for some frames at a time, in their order; views are numbered by frame.
  using UseViews = std::function<void(std::span<const RefinementView> views, std::size_t frames)>;
  void each_view_group(std::span<const FusionFrame> frames, bool color, const UseViews& use);

  // The frame's cameras, made ready. May be called from several threads.
  std::vector<RefinementView> views_of(const FusionFrame& frame, std::uint32_t number, bool color);

 private:
  const ScanSource& scan_;
  Options options_;
  PixelRayCache rays_;
  std::mutex mutex_;  // of these two
  std::map<int, std::shared_ptr<const RgbdFrame>> kept_;
  std::size_t kept_bytes_ = 0;
};

}  // namespace libmap
