#include "libmap/fusion/fusion_frames.h"

#include <algorithm>
#include <iterator>
#include <string>
#include <utility>

#include "libmap/camera/rgbd_frame.h"
#include "libmap/camera/stereo_depth.h"
#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"

namespace libmap {

namespace {

// Limit of the cache of decoded depth.
constexpr std::size_t max_kept_bytes = std::size_t{256} << 20;

std::size_t bytes_of(const RgbdFrame& frame) { return sizeof(float) * frame.depth.pixels.size(); }

}  // namespace

FusionFrame frame_at(const TrajectoryPose& pose, const Eigen::Vector3d& grid_origin,
                     double voxel_size_m, double max_depth_m) {
  FusionFrame frame;
  frame.node = pose.node;
  frame.grid_from_base = pose.world_from_base;
  frame.grid_from_base.translation() -= grid_origin;
  const double reach = frame.grid_from_base.translation().cwiseAbs().maxCoeff();
  const double bound = 0.9 * voxel_cell_limit * voxel_size_m;
  const double needed = reach + max_depth_m;
  if (needed > bound && reach <= max_depth_m)
    throw Error("too small for the range of the depth images",
                {.field = "voxel_size_m",
                 .value = to_text(voxel_size_m),
                 .bound = "> " + to_text(static_cast<float>(voxel_size_m * needed / bound))});
  if (needed > bound)
    throw Error("the pose is too far from the first pose for this voxel size",
                {.field = "node " + std::to_string(pose.node),
                 .value = to_text(static_cast<float>(reach)) + " m from the first",
                 .bound = "< " + to_text(static_cast<float>(bound)) + " m"});
  return frame;
}

void move(FusionFrame& frame, const Pose& moved_from_grid) {
  frame.grid_from_base = moved_from_grid * frame.grid_from_base;
  Eigen::AlignedBox3d reach;
  for (int corner = 0; corner < 8; ++corner)
    reach.extend(moved_from_grid *
                 frame.reach.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner)));
  frame.reach = reach;
}

std::shared_ptr<const RgbdFrame> FusionFrames::depth_of(int node) {
  {
    const std::scoped_lock lock(mutex_);
    if (const auto kept = kept_.find(node); kept != kept_.end()) return kept->second;
  }
  const auto frame =
      std::make_shared<RgbdFrame>(scan_.read_frame(node, {.color = false, .depth = true}));
  const std::string name = "node " + std::to_string(node);
  if (frame->depth.empty()) {
    if (frame->right.empty()) throw Error("the frame has no depth image", {.field = name});
    if (!options_.stereo)
      throw Error("the frame has a stereo pair but no depth; use --stereo to compute depth",
                  {.field = name});
    *frame = scan_.read_frame(node);
    frame->depth = stereo_depth(*frame);
  }
  if (frame->cameras.empty()) throw Error("the frame has no calibration", {.field = name});
  frame->color = {};
  frame->right = {};
  // All passes visit the frames in the same order, so the first frames are cached.
  const std::scoped_lock lock(mutex_);
  if (kept_bytes_ + bytes_of(*frame) <= max_kept_bytes && kept_.emplace(node, frame).second)
    kept_bytes_ += bytes_of(*frame);
  return frame;
}

void FusionFrames::evict_others(std::span<const FusionFrame> frames) {
  const std::scoped_lock lock(mutex_);
  auto kept = std::move(kept_);
  kept_.clear();
  kept_bytes_ = 0;
  for (const FusionFrame& frame : frames)
    if (const auto found = kept.find(frame.node); found != kept.end()) {
      kept_bytes_ += bytes_of(*found->second);
      kept_.insert(kept.extract(found));
    }
}

bool FusionFrames::has_color(std::span<const FusionFrame> frames) {
  return !frames.empty() && !views_of(frames.front(), 0, true).front().color.empty();
}

std::vector<RefinementView> FusionFrames::views_of(const FusionFrame& frame, std::uint32_t number,
                                                   bool color) {
  RgbdFrame images = *depth_of(frame.node);
  try {
    if (color) images.color = scan_.read_frame(frame.node, {.color = true, .depth = false}).color;
  } catch (const Error&) {
    if (options_.strict) throw;  // otherwise only the frame's depth is used
  }
  std::vector<RefinementView> views;
  for (CameraView& view : camera_views(images)) {
    auto rays = rays_of(view.depth_camera);
    const Pose camera_from_grid =
        (frame.grid_from_base * view.depth_camera.base_from_camera).inverse();
    views.push_back(
        make_refinement_view(std::move(view), std::move(rays), camera_from_grid, number));
  }
  return views;
}

void FusionFrames::measure_reach(const RgbdFrame& depth, double max_depth_m, FusionFrame& frame) {
  frame.image_pixels = image_pixels(depth);
  for (const CameraView& view : camera_views(depth)) {
    const Camera& camera = view.depth_camera;
    camera.check();
    const auto rays = rays_of(camera);
    frame.max_ray_length =
        std::max(frame.max_ray_length,
                 rays->min.cwiseAbs().cwiseMax(rays->max.cwiseAbs()).homogeneous().norm());
    frame.max_pixel_pitch = std::max(frame.max_pixel_pitch, 1.0 / std::min(camera.fx, camera.fy));
    const Pose grid_from_camera = frame.grid_from_base * camera.base_from_camera;
    frame.reach.extend(grid_from_camera.translation());
    const Eigen::Matrix3f rotation = grid_from_camera.linear().cast<float>();
    const auto max_depth = static_cast<float>(max_depth_m);
    Eigen::AlignedBox3f met;  // measured points relative to the camera
    for (std::size_t n = 0; n < view.depth.pixels.size(); ++n)
      if (const float z = view.depth.pixels[n]; z > 0.0F)
        met.extend(rotation *
                   (Eigen::Vector3f(rays->x[n], rays->y[n], 1.0F) * std::min(z, max_depth)));
    if (!met.isEmpty())
      frame.reach.extend(Eigen::AlignedBox3d(met.min().cast<double>(), met.max().cast<double>())
                             .translate(grid_from_camera.translation()));
  }
}

void FusionFrames::each_view_group(std::span<const FusionFrame> frames, bool color,
                                   const UseViews& use) {
  std::size_t max_image_pixels = 0;
  for (const FusionFrame& frame : frames)
    max_image_pixels = std::max(max_image_pixels, frame.image_pixels);
  const std::size_t group = frames_in_batch(max_image_pixels);
  for (std::size_t first = 0; first < frames.size(); first += group) {
    const std::size_t count = std::min(group, frames.size() - first);
    std::vector<std::vector<RefinementView>> made(count);
    parallel_each(count, [&](std::size_t n) {
      made[n] = views_of(frames[first + n], static_cast<std::uint32_t>(first + n), color);
    });
    std::vector<RefinementView> views;
    for (std::vector<RefinementView>& frame : made)
      std::move(frame.begin(), frame.end(), std::back_inserter(views));
    use(views, count);
  }
}

}  // namespace libmap
