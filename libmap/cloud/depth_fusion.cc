#include "libmap/cloud/depth_fusion.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <numbers>
#include <span>

#include "libmap/cloud/frame_registration.h"
#include "libmap/cloud/surface_points.h"
#include "libmap/cloud/surface_refinement.h"
#include "libmap/cloud/surface_voxels.h"
#include "libmap/core/error.h"
#include "libmap/core/memory_budget.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"
#include "libmap/scan/frame_batch.h"
#include "libmap/scan/stereo_depth.h"

namespace libmap {

namespace {

// Frames whose coarse surfaces are made side by side.
constexpr std::size_t frames_in_flight = 8;
// What one pixel takes while its frame is made into a coarse surface.
constexpr std::uint64_t coarse_pixel_bytes = 60;
// Elements, about, by which frames are registered.
constexpr std::size_t registration_elements = 20000;
// By which frames may lie off the coarse surface when they are first registered.
constexpr double first_search_voxels = 3.0;
// Corrections of heights, root mean square, that are not worth another coarse surface.
constexpr double least_correction_voxels = 0.05;

void require(double value, const Range& range, const char* field) {
  const bool low = range.min_open ? value > range.min : value >= range.min;
  const bool high = range.max_open ? value < range.max : value <= range.max;
  if (low && high && std::isfinite(value)) return;
  throw Error("depth cannot be fused so",
              {.file = {}, .field = field, .value = to_text(value), .bound = describe(range)});
}

constexpr Range radius_range{1, 7};
constexpr Range rounds_range{0, 20};
constexpr Range incidence_range{0, 89.5, true, false};

void check(const DepthFusionOptions& options) {
  require(options.voxel_size_m, positive, "voxel_size_m");
  require(options.planes.min_depth_m, positive, "min_depth_m");
  require(options.planes.max_depth_m, positive, "max_depth_m");
  require(options.planes.max_depth_m,
          {options.planes.min_depth_m, std::numeric_limits<double>::infinity(), true, false},
          "max_depth_m");
  require(options.planes.noise.axial_m, positive, "axial_noise_m");
  require(options.planes.noise.axial_of_range, not_negative, "range_noise");
  require(options.planes.noise.lateral_px, not_negative, "lateral_noise_px");
  require(options.planes.radius_px, radius_range, "plane_radius_px");
  require(options.planes.min_pair_share, zero_to_one, "min_pair_share");
  require(options.planes.max_incidence_deg, incidence_range, "max_incidence_deg");
  require(options.disc_radius_voxels, positive, "disc_radius_voxels");
  require(options.pose_error_m, not_negative, "pose_error_m");
  require(options.registration_rounds, rounds_range, "registration_rounds");
  require(options.min_views, {1}, "min_views");
  require(options.max_seen_through, not_negative, "max_seen_through");
}

struct FusedFrame {
  int node = 0;
  Pose grid_from_base = Pose::Identity();
};

// What the first pass makes of one frame.
struct CoarseFrame {
  SurfaceVoxels voxels;
  DepthPixelCounts pixels;
  std::size_t image_pixels = 0;
  std::string fault;  // empty: it can be used
};

class Fusion {
 public:
  Fusion(const ScanSource& scan, const DepthFusionOptions& options, Progress& progress)
      : scan_(scan), options_(options), progress_(progress) {}

  DepthFusionResult run(const Trajectory& world_from_base) {
    take_poses(world_from_base);
    timed("coarse surface", [&] { find_surface(); });
    timed("registration", [&] { register_poses(world_from_base); });
    if (used_.empty()) throw no_frames(world_from_base.size());
    result_.frames = used_.size();
    result_.occupied_voxels = voxels_.size();
    RefinedSurface surface;
    timed("refinement", [&] { surface = refine(); });
    timed("cloud", [&] { make_cloud(surface); });
    return std::move(result_);
  }

 private:
  template <typename Step>
  void timed(const char* name, const Step& step) {
    libmap::timed(result_.timings_s, name, step);
  }

  Error no_frames(std::size_t poses) const {
    if (result_.skipped.empty())
      return Error(poses == 0 ? "no poses to fuse by" : "no frame has depth");
    return Error("none of " + std::to_string(poses) + " frames can be used, the first because " +
                 result_.skipped.front().second);
  }

  void skip(int node, const std::string& fault) {
    if (options_.strict) throw Error(fault);
    result_.skipped.emplace_back(node, fault);
  }

  void take_poses(const Trajectory& world_from_base);
  RgbdFrame read_frame(int node, bool color) const;
  CoarseFrame coarse_frame(const FusedFrame& frame) const;
  void merge_coarse(std::span<const FusedFrame> frames, std::span<const CoarseFrame> coarse);
  void find_surface();
  // use(views) of some frames at a time, in their order.
  template <typename Use>
  void each_view_group(bool color, const Use& use) const {
    const std::size_t group = frames_in_batch(most_image_pixels_);
    for (std::size_t first = 0; first < used_.size(); first += group) {
      const std::size_t count = std::min(group, used_.size() - first);
      std::vector<std::vector<RefinementView>> frames(count);
      parallel_for(count, 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n)
          frames[n] = views_of(used_[first + n], static_cast<std::uint32_t>(first + n), color);
      });
      std::vector<RefinementView> views;
      for (std::vector<RefinementView>& frame : frames)
        std::move(frame.begin(), frame.end(), std::back_inserter(views));
      use(std::span<const RefinementView>(views), count);
    }
  }
  FrameRegistration registration(int round);
  void register_poses(const Trajectory& world_from_base);
  void note_poses(const Trajectory& world_from_base);
  SurfaceRefinementOptions refinement_options() const;
  std::vector<RefinementView> views_of(const FusedFrame& frame, std::uint32_t number,
                                       bool color) const;
  RefinedSurface refine();
  void make_cloud(const RefinedSurface& surface);

  const ScanSource& scan_;
  const DepthFusionOptions& options_;
  Progress& progress_;
  mutable PixelRayCache rays_;
  mutable MemoryBudget memory_;
  std::size_t most_image_pixels_ = 0;  // of the frames used
  // The grid's origin is a corner of the world's own voxels near the first camera: single precision
  // is enough about it, wherever the scan lies.
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  std::vector<FusedFrame> frames_;
  std::vector<FusedFrame> used_;
  SurfaceVoxels voxels_;
  DepthFusionResult result_;
};

void Fusion::take_poses(const Trajectory& world_from_base) {
  bool has_origin = false;
  for (const TrajectoryPose& pose : world_from_base) {
    if (!pose.world_from_base.matrix().allFinite()) {
      skip(pose.node, "node " + std::to_string(pose.node) + ": its pose is not finite");
      continue;
    }
    FusedFrame frame{pose.node, pose.world_from_base};
    if (!has_origin)
      origin_ = (frame.grid_from_base.translation() / options_.voxel_size_m).array().floor() *
                options_.voxel_size_m;
    has_origin = true;
    frame.grid_from_base.translation() -= origin_;
    const double reach = frame.grid_from_base.translation().cwiseAbs().maxCoeff();
    const double bound = 0.9 * voxel_cell_limit * options_.voxel_size_m;
    const double needed = reach + options_.planes.max_depth_m;
    if (needed > bound && reach <= options_.planes.max_depth_m)
      throw Error(
          "voxels too small for the reach of the depth images",
          {.file = {},
           .field = "voxel_size_m",
           .value = to_text(options_.voxel_size_m),
           .bound = "> " + to_text(static_cast<float>(options_.voxel_size_m * needed / bound))});
    if (needed > bound)
      throw Error("poses lie too far apart for the voxel size",
                  {.file = {},
                   .field = "node " + std::to_string(pose.node),
                   .value = to_text(static_cast<float>(reach)) + " m from the first",
                   .bound = "< " + to_text(static_cast<float>(bound)) + " m"});
    frames_.push_back(frame);
  }
  std::stable_sort(frames_.begin(), frames_.end(),
                   [](const FusedFrame& a, const FusedFrame& b) { return a.node < b.node; });
}

void add_planes(const DepthPlanes& planes, const PixelRays& rays, const Pose& grid_from_camera,
                const DepthFusionOptions& options, SurfaceVoxels& voxels) {
  const auto scale = static_cast<float>(1.0 / options.voxel_size_m);
  const Eigen::Matrix3f rotation = grid_from_camera.linear().cast<float>();
  const Eigen::Vector3f translation = grid_from_camera.translation().cast<float>() * scale;
  const auto axial = static_cast<float>(options.planes.noise.axial_m);
  const auto of_range = static_cast<float>(options.planes.noise.axial_of_range);
  for (std::size_t n = 0; n < planes.support.size(); ++n) {
    if (planes.support[n] == 0) continue;
    const float z = planes.depth_m[n];
    const Eigen::Vector3f ray(rays.x[n], rays.y[n], 1.0F);
    const float sigma = axial + of_range * z;
    // Front views know lateral places and normals better.
    const float weight =
        planes.cos_incidence[n] * static_cast<float>(planes.support[n]) / (sigma * sigma);
    voxels.add(rotation * (ray * (z * scale)) + translation, rotation * planes.normals[n], weight);
  }
}

RgbdFrame Fusion::read_frame(int node, bool color) const {
  RgbdFrame frame = scan_.read_frame(node, {.color = color, .depth = true});
  if (!frame.depth.empty()) return frame;
  const std::string name = "node " + std::to_string(node);
  if (frame.right.empty()) throw Error(name + ": it has no depth image");
  if (!options_.stereo)
    throw Error(name + ": it has a stereo pair and no depth, which stereo matching would compute");
  if (!color) frame = scan_.read_frame(node);
  frame.depth = stereo_depth(frame);
  return frame;
}

CoarseFrame Fusion::coarse_frame(const FusedFrame& frame) const {
  CoarseFrame coarse;
  try {
    const RgbdFrame images = read_frame(frame.node, false);
    if (images.cameras.empty())
      throw Error("node " + std::to_string(frame.node) + ": it has no calibration");
    coarse.image_pixels = image_pixels(images);
    const MemoryBudget::Share share = memory_.take(coarse_pixel_bytes * images.depth.pixels.size());
    for (const CameraView& view : camera_views(images)) {
      view.depth_camera.check();
      const auto rays = rays_.rays_of(view.depth_camera);
      const DepthPlanes planes = fit_depth_planes(view.depth, *rays, options_.planes);
      coarse.pixels += planes.counts;
      add_planes(planes, *rays, frame.grid_from_base * view.depth_camera.base_from_camera, options_,
                 coarse.voxels);
    }
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::bad_input) throw;
    coarse.fault = error.what();
  }
  return coarse;
}

void Fusion::merge_coarse(std::span<const FusedFrame> frames, std::span<const CoarseFrame> coarse) {
  for (std::size_t n = 0; n < coarse.size(); ++n) {
    if (!coarse[n].fault.empty()) {
      skip(frames[n].node, coarse[n].fault);
      continue;
    }
    voxels_.merge_frame(coarse[n].voxels);
    result_.pixels += coarse[n].pixels;
    most_image_pixels_ = std::max(most_image_pixels_, coarse[n].image_pixels);
    used_.push_back(frames[n]);
  }
}

void Fusion::find_surface() {
  progress_.begin("coarse surface", frames_.size());
  const std::span<const FusedFrame> frames = frames_;
  std::span<const FusedFrame> before;
  std::vector<CoarseFrame> coarse_before;
  for (std::size_t first = 0; first < frames.size(); first += frames_in_flight) {
    const auto now = frames.subspan(first, std::min(frames_in_flight, frames.size() - first));
    std::vector<CoarseFrame> coarse(now.size());
    // One thread merges the frames before, in their order, while others make these.
    parallel_for(now.size() + 1, 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t task = begin; task < end; ++task) {
        if (task == 0) {
          merge_coarse(before, coarse_before);
        } else {
          coarse[task - 1] = coarse_frame(now[task - 1]);
          progress_.advance(1);
        }
      }
    });
    before = now;
    coarse_before = std::move(coarse);
  }
  merge_coarse(before, coarse_before);
}

std::vector<RefinementView> Fusion::views_of(const FusedFrame& frame, std::uint32_t number,
                                             bool color) const {
  std::vector<RefinementView> views;
  RgbdFrame images;
  try {
    images = read_frame(frame.node, color);
  } catch (const Error&) {
    // Its depth was read before: only the colours are broken.
    if (!color || options_.strict) throw;
    images = read_frame(frame.node, false);
  }
  for (CameraView& view : camera_views(images)) {
    auto rays = rays_.rays_of(view.depth_camera);
    const Pose camera_from_grid =
        (frame.grid_from_base * view.depth_camera.base_from_camera).inverse();
    views.push_back(
        make_refinement_view(std::move(view), std::move(rays), camera_from_grid, number));
  }
  return views;
}

SurfaceRefinementOptions Fusion::refinement_options() const {
  SurfaceRefinementOptions options;
  options.disc_radius_m = options_.disc_radius_voxels * options_.voxel_size_m;
  options.search_m = options_.voxel_size_m;
  options.min_depth_m = options_.planes.min_depth_m;
  options.max_depth_m = options_.planes.max_depth_m;
  options.max_incidence_deg = options_.planes.max_incidence_deg;
  options.noise = options_.planes.noise;
  options.pose_error_m = options_.pose_error_m;
  return options;
}

// By what the frames measured of some of the coarse surface.
FrameRegistration Fusion::registration(int round) {
  std::vector<SurfaceElement> elements = surface_elements(voxels_, false);
  const std::size_t step = std::max<std::size_t>(1, elements.size() / registration_elements);
  for (std::size_t n = 0; n * step < elements.size(); ++n) {
    elements[n] = elements[n * step];
    elements[n].position *= static_cast<float>(options_.voxel_size_m);
  }
  elements.resize((elements.size() + step - 1) / step);
  SurfaceRefinementOptions options = refinement_options();
  options.search_m = first_search_voxels * options_.voxel_size_m / round;
  std::vector<SurfaceObservation> observations;
  each_view_group(false, [&](std::span<const RefinementView> views, std::size_t) {
    const auto more = observe_surface(elements, views, options);
    observations.insert(observations.end(), more.begin(), more.end());
  });
  std::stable_sort(observations.begin(), observations.end(),
                   [](const auto& a, const auto& b) { return a.element < b.element; });
  std::vector<Eigen::Vector3d> centres;
  for (const FusedFrame& frame : used_) centres.push_back(frame.grid_from_base.translation());
  return register_frames(elements, observations, centres);
}

void Fusion::register_poses(const Trajectory& world_from_base) {
  for (int round = 1; round <= options_.registration_rounds && used_.size() > 1; ++round) {
    const FrameRegistration found = registration(round);
    if (round == 1) result_.disagreement_before_m = found.disagreement_before_m;
    result_.disagreement_after_m = found.disagreement_before_m;
    // Poses that are right stay as they are, and with them the coarse surface.
    if (!(found.correction_m > least_correction_voxels * options_.voxel_size_m)) break;
    frames_ = std::move(used_);
    for (std::size_t n = 0; n < frames_.size(); ++n)
      frames_[n].grid_from_base = found.corrected_from_given[n] * frames_[n].grid_from_base;
    result_.disagreement_after_m = found.disagreement_after_m;
    ++result_.registration_rounds;
    voxels_ = {};
    used_.clear();
    result_.pixels = {};
    find_surface();
  }
  note_poses(world_from_base);
}

void Fusion::note_poses(const Trajectory& world_from_base) {
  double turns = 0.0;
  double shifts = 0.0;
  for (const FusedFrame& frame : used_) {
    const auto given =
        std::find_if(world_from_base.begin(), world_from_base.end(),
                     [&](const TrajectoryPose& pose) { return pose.node == frame.node; });
    TrajectoryPose pose = *given;
    if (result_.registration_rounds > 0) {
      pose.world_from_base = Eigen::Translation3d(origin_) * frame.grid_from_base;
      const Pose given_from_used = given->world_from_base.inverse() * pose.world_from_base;
      const double turn = Eigen::AngleAxisd(given_from_used.linear()).angle();
      turns += turn * turn;
      shifts += given_from_used.translation().squaredNorm();
    }
    result_.poses.push_back(pose);
  }
  const auto count = static_cast<double>(used_.size());
  result_.registration_turn_deg = std::sqrt(turns / count) * 180.0 / std::numbers::pi;
  result_.registration_shift_m = std::sqrt(shifts / count);
}

RefinedSurface Fusion::refine() {
  std::vector<SurfaceElement> elements = surface_elements(voxels_, options_.extend_edges);
  voxels_ = {};
  const auto voxel = static_cast<float>(options_.voxel_size_m);
  for (SurfaceElement& element : elements) element.position *= voxel;
  result_.elements = elements.size();
  SurfaceRefinement refinement(std::move(elements), refinement_options());
  progress_.begin("refinement", used_.size());
  each_view_group(options_.color, [&](std::span<const RefinementView> views, std::size_t frames) {
    refinement.add(views);
    progress_.advance(frames);
  });
  return std::move(refinement).finish();
}

void Fusion::make_cloud(const RefinedSurface& surface) {
  SurfacePointOptions options;
  options.voxel_size_m = options_.voxel_size_m;
  options.min_views = options_.min_views;
  options.max_seen_through = options_.max_seen_through;
  SurfacePoints points = make_surface_points(surface, options);
  result_.cloud = std::move(points.cloud);
  for (Eigen::Vector3d& position : result_.cloud.positions) position += origin_;
  result_.points = points.counts;
}

}  // namespace

void bind(ParameterTable& table, DepthFusionOptions& options) {
  DepthPlaneOptions& planes = options.planes;
  table.add("voxel_size_m", options.voxel_size_m, positive, "one point a voxel of this size");
  table.add("min_depth_m", planes.min_depth_m, positive, "nearer measurements are dropped");
  table.add("max_depth_m", planes.max_depth_m, positive, "farther measurements are dropped");
  table.add("max_incidence_deg", planes.max_incidence_deg, incidence_range,
            "measurements more oblique than this to their surface are dropped");
  table.add("axial_noise_m", planes.noise.axial_m, positive,
            "standard deviation of depth at range 0");
  table.add("range_noise", planes.noise.axial_of_range, not_negative,
            "standard deviation of depth added by each metre of range, m/m");
  table.add("lateral_noise_px", planes.noise.lateral_px, not_negative,
            "standard deviation across the line of sight");
  table.add("plane_radius_px", planes.radius_px, radius_range,
            "disc of pixels that a plane is fitted to");
  table.add("min_pair_share", planes.min_pair_share, zero_to_one,
            "share of the pairs of opposite pixels around a pixel that must agree with it");
  table.add("disc_radius_voxels", options.disc_radius_voxels, positive,
            "disc of the surface whose measurements make a point");
  table.add("pose_error_m", options.pose_error_m, not_negative,
            "standard deviation of a whole frame, along a normal");
  table.add("registration_rounds", options.registration_rounds, rounds_range,
            "times, at most, that poses are corrected so that frames agree; 0: not at all");
  table.add("min_views", options.min_views, {1}, "points that fewer frames measured are dropped");
  table.add("max_seen_through", options.max_seen_through, not_negative,
            "points are dropped that are seen through more often, against being seen");
  table.add("extend_edges", options.extend_edges,
            "also points one voxel beyond the edges of what was measured");
  table.add("color", options.color, "colours, blended with the nearest front views ahead");
  table.add("stereo", options.stereo, "compute the depth of stereo pairs by semi-global matching");
  table.add("strict", options.strict, "end with an error if a frame cannot be used");
}

DepthFusionResult fuse_depth(const ScanSource& scan, const Trajectory& world_from_base,
                             const DepthFusionOptions& options, Progress& progress) {
  check(options);
  return Fusion(scan, options, progress).run(world_from_base);
}

}  // namespace libmap
