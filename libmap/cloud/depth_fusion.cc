#include "libmap/cloud/depth_fusion.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <memory>
#include <mutex>
#include <numbers>
#include <optional>
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
constexpr double min_correction_voxels = 0.05;

// Decoded frames and their planes are kept for later passes as far as this reaches.
constexpr std::size_t max_kept_bytes = std::size_t{64} << 20;
constexpr std::size_t kept_pixel_bytes = 25;

void check(const DepthFusionOptions& options) {
  check_parameters(options);
  if (!(options.planes.max_depth_m > options.planes.min_depth_m))
    throw Error("out of range", {.field = "max_depth_m",
                                 .value = to_text(options.planes.max_depth_m),
                                 .bound = "> " + to_text(options.planes.min_depth_m)});
}

std::string node_name(int node) { return "node " + std::to_string(node); }

struct FusedFrame {
  int node = 0;
  Pose grid_from_base = Pose::Identity();
};

// What every pass needs of a frame: decoded and fitted once where memory allows.
struct DepthFrame {
  RgbdFrame images;                 // depth alone
  std::vector<DepthPlanes> planes;  // one per camera; none: not fitted yet
};

// What one frame gives to the coarse surface.
struct CoarseFrame {
  SurfaceVoxels voxels;
  DepthPixelCounts pixels;
  std::size_t image_pixels = 0;
  std::optional<Error> fault;  // none: it can be used
};

struct CoarseSurface {
  std::vector<FusedFrame> frames;  // those that can be used
  SurfaceVoxels voxels;
  DepthPixelCounts pixels;
  std::size_t max_image_pixels = 0;
};

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

class Fusion {
 public:
  Fusion(const ScanSource& scan, const DepthFusionOptions& options, Progress& progress)
      : scan_(scan), options_(options), progress_(progress) {}

  DepthFusionResult run(const Trajectory& world_from_base) {
    const std::vector<FusedFrame> frames = place_frames(world_from_base);
    CoarseSurface coarse;
    timed("coarse surface", [&] { coarse = coarse_surface(frames); });
    timed("registration", [&] { register_frames(coarse); });
    if (coarse.frames.empty()) throw no_frames(world_from_base.size());
    note_frames(coarse, world_from_base);
    RefinedSurface surface;
    timed("refinement", [&] { surface = refine(std::move(coarse)); });
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
                 result_.skipped.front().second.what());
  }

  void skip(int node, const Error& fault) {
    if (options_.strict) throw fault;
    result_.skipped.emplace_back(node, fault);
  }

  std::vector<FusedFrame> place_frames(const Trajectory& world_from_base) {
    std::vector<FusedFrame> frames;
    bool has_origin = false;
    for (const TrajectoryPose& pose : world_from_base) {
      if (!pose.world_from_base.matrix().allFinite()) {
        skip(pose.node, Error("its pose is not finite", {.field = node_name(pose.node)}));
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
            {.field = "voxel_size_m",
             .value = to_text(options_.voxel_size_m),
             .bound = "> " + to_text(static_cast<float>(options_.voxel_size_m * needed / bound))});
      if (needed > bound)
        throw Error("poses are too far apart for the voxel size",
                    {.field = node_name(pose.node),
                     .value = to_text(static_cast<float>(reach)) + " m from the first",
                     .bound = "< " + to_text(static_cast<float>(bound)) + " m"});
      frames.push_back(frame);
    }
    std::stable_sort(frames.begin(), frames.end(),
                     [](const FusedFrame& a, const FusedFrame& b) { return a.node < b.node; });
    return frames;
  }

  std::shared_ptr<DepthFrame> depth_of(int node) const {
    {
      const std::scoped_lock lock(mutex_);
      if (const auto kept = kept_.find(node); kept != kept_.end()) return kept->second;
    }
    const auto frame = std::make_shared<DepthFrame>();
    RgbdFrame& images = frame->images;
    images = scan_.read_frame(node, {.color = false, .depth = true});
    if (images.depth.empty()) {
      const std::string name = node_name(node);
      if (images.right.empty()) throw Error("it has no depth image", {.field = name});
      if (!options_.stereo)
        throw Error("it has a stereo pair and no depth, which stereo matching would compute",
                    {.field = name});
      images = scan_.read_frame(node);
      images.depth = stereo_depth(images);
    }
    if (images.cameras.empty()) throw Error("it has no calibration", {.field = node_name(node)});
    images.color = {};
    images.right = {};
    return frame;
  }

  // All passes go through the frames in one order: those that came first stay.
  void keep(int node, const std::shared_ptr<DepthFrame>& frame) const {
    const std::size_t bytes = kept_pixel_bytes * frame->images.depth.pixels.size();
    const std::scoped_lock lock(mutex_);
    if (kept_bytes_ + bytes <= max_kept_bytes && kept_.emplace(node, frame).second)
      kept_bytes_ += bytes;
  }

  CoarseFrame coarse_frame(const FusedFrame& frame) const {
    CoarseFrame coarse;
    try {
      const std::shared_ptr<DepthFrame> depth = depth_of(frame.node);
      coarse.image_pixels = image_pixels(depth->images);
      const MemoryBudget::Share share =
          memory_.take(coarse_pixel_bytes * depth->images.depth.pixels.size());
      const std::vector<CameraView> views = camera_views(depth->images);
      const bool is_new = depth->planes.empty();
      for (std::size_t n = 0; n < views.size(); ++n) {
        const Camera& camera = views[n].depth_camera;
        camera.check();
        const auto rays = rays_.rays_of(camera);
        if (is_new)
          depth->planes.push_back(fit_depth_planes(views[n].depth, *rays, options_.planes));
        coarse.pixels += depth->planes[n].counts;
        add_planes(depth->planes[n], *rays, frame.grid_from_base * camera.base_from_camera,
                   options_, coarse.voxels);
      }
      if (is_new) keep(frame.node, depth);
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::bad_input) throw;
      coarse.fault = error;
    }
    return coarse;
  }

  void merge(std::span<const FusedFrame> frames, std::span<const CoarseFrame> parts,
             CoarseSurface& coarse) {
    for (std::size_t n = 0; n < parts.size(); ++n) {
      if (parts[n].fault) {
        skip(frames[n].node, *parts[n].fault);
        continue;
      }
      coarse.frames.push_back(frames[n]);
      coarse.voxels.merge_frame(parts[n].voxels);
      coarse.pixels += parts[n].pixels;
      coarse.max_image_pixels = std::max(coarse.max_image_pixels, parts[n].image_pixels);
    }
  }

  CoarseSurface coarse_surface(std::span<const FusedFrame> frames) {
    progress_.begin("coarse surface", frames.size());
    CoarseSurface coarse;
    std::span<const FusedFrame> before;
    std::vector<CoarseFrame> parts_before;
    for (std::size_t first = 0; first < frames.size(); first += frames_in_flight) {
      const auto now = frames.subspan(first, std::min(frames_in_flight, frames.size() - first));
      std::vector<CoarseFrame> parts(now.size());
      // One thread merges the frames before, in their order, while others make these.
      parallel_for(now.size() + 1, 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t task = begin; task < end; ++task) {
          if (task == 0) {
            merge(before, parts_before, coarse);
          } else {
            parts[task - 1] = coarse_frame(now[task - 1]);
            progress_.advance(1);
          }
        }
      });
      before = now;
      parts_before = std::move(parts);
    }
    merge(before, parts_before, coarse);
    return coarse;
  }

  std::vector<RefinementView> views_of(const FusedFrame& frame, std::uint32_t number,
                                       bool color) const {
    RgbdFrame images = depth_of(frame.node)->images;
    try {
      if (color) images.color = scan_.read_frame(frame.node, {.color = true, .depth = false}).color;
    } catch (const Error&) {
      if (options_.strict) throw;  // else the frame's depth is used alone
    }
    std::vector<RefinementView> views;
    for (CameraView& view : camera_views(images)) {
      auto rays = rays_.rays_of(view.depth_camera);
      const Pose camera_from_grid =
          (frame.grid_from_base * view.depth_camera.base_from_camera).inverse();
      views.push_back(
          make_refinement_view(std::move(view), std::move(rays), camera_from_grid, number));
    }
    return views;
  }

  // use(views, frames) of some frames at a time, in their order.
  template <typename Use>
  void each_view_group(const CoarseSurface& coarse, bool color, const Use& use) const {
    const std::size_t group = frames_in_batch(coarse.max_image_pixels);
    for (std::size_t first = 0; first < coarse.frames.size(); first += group) {
      const std::size_t count = std::min(group, coarse.frames.size() - first);
      std::vector<std::vector<RefinementView>> frames(count);
      parallel_for(count, 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n)
          frames[n] =
              views_of(coarse.frames[first + n], static_cast<std::uint32_t>(first + n), color);
      });
      std::vector<RefinementView> views;
      for (std::vector<RefinementView>& frame : frames)
        std::move(frame.begin(), frame.end(), std::back_inserter(views));
      use(std::span<const RefinementView>(views), count);
    }
  }

  SurfaceRefinementOptions refinement_options() const {
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
  FrameRegistration registration(const CoarseSurface& coarse, int round) const {
    std::vector<SurfaceElement> elements = surface_elements(coarse.voxels, false);
    const std::size_t step = std::max<std::size_t>(1, elements.size() / registration_elements);
    for (std::size_t n = 0; n * step < elements.size(); ++n) {
      elements[n] = elements[n * step];
      elements[n].position *= static_cast<float>(options_.voxel_size_m);
    }
    elements.resize((elements.size() + step - 1) / step);
    SurfaceRefinementOptions options = refinement_options();
    options.search_m = first_search_voxels * options_.voxel_size_m / round;
    std::vector<SurfaceObservation> observations;
    each_view_group(coarse, false, [&](std::span<const RefinementView> views, std::size_t) {
      const auto more = observe_surface(elements, views, options);
      observations.insert(observations.end(), more.begin(), more.end());
    });
    std::stable_sort(observations.begin(), observations.end(),
                     [](const auto& a, const auto& b) { return a.element < b.element; });
    std::vector<Eigen::Vector3d> centers;
    for (const FusedFrame& frame : coarse.frames)
      centers.push_back(frame.grid_from_base.translation());
    return libmap::register_frames(elements, observations, centers);
  }

  void register_frames(CoarseSurface& coarse) {
    for (int round = 1; round <= options_.registration_rounds && coarse.frames.size() > 1;
         ++round) {
      const FrameRegistration found = registration(coarse, round);
      if (round == 1) result_.disagreement_before_m = found.disagreement_before_m;
      result_.disagreement_after_m = found.disagreement_before_m;
      // Poses that are right stay as they are, and with them the coarse surface.
      if (!(found.correction_m > min_correction_voxels * options_.voxel_size_m)) break;
      std::vector<FusedFrame> frames = std::move(coarse.frames);
      for (std::size_t n = 0; n < frames.size(); ++n)
        frames[n].grid_from_base = found.corrected_from_given[n] * frames[n].grid_from_base;
      result_.disagreement_after_m = found.disagreement_after_m;
      ++result_.registration_rounds;
      coarse = {};  // before the next one takes memory
      coarse = coarse_surface(frames);
    }
  }

  void note_frames(const CoarseSurface& coarse, const Trajectory& world_from_base) {
    double turns = 0.0;
    double shifts = 0.0;
    for (const FusedFrame& frame : coarse.frames) {
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
    const auto count = static_cast<double>(coarse.frames.size());
    result_.registration_turn_deg = std::sqrt(turns / count) * 180.0 / std::numbers::pi;
    result_.registration_shift_m = std::sqrt(shifts / count);
    result_.frames = coarse.frames.size();
    result_.pixels = coarse.pixels;
    result_.occupied_voxels = coarse.voxels.size();
  }

  RefinedSurface refine(CoarseSurface coarse) {
    std::vector<SurfaceElement> elements = surface_elements(coarse.voxels, options_.extend_edges);
    coarse.voxels = {};
    const auto voxel = static_cast<float>(options_.voxel_size_m);
    for (SurfaceElement& element : elements) element.position *= voxel;
    result_.elements = elements.size();
    progress_.begin("refinement", coarse.frames.size());
    return refine_surface(std::move(elements), refinement_options(), [&](const AddViews& add) {
      each_view_group(coarse, options_.color,
                      [&](std::span<const RefinementView> views, std::size_t frames) {
                        add(views);
                        progress_.advance(frames);
                      });
    });
  }

  void make_cloud(const RefinedSurface& surface) {
    SurfacePointOptions options;
    options.voxel_size_m = options_.voxel_size_m;
    options.min_views = options_.min_views;
    options.max_seen_through = options_.max_seen_through;
    SurfacePoints points = make_surface_points(surface, options);
    result_.cloud = std::move(points.cloud);
    for (Eigen::Vector3d& position : result_.cloud.positions) position += origin_;
    result_.points = points.counts;
  }

  const ScanSource& scan_;
  const DepthFusionOptions& options_;
  Progress& progress_;
  mutable PixelRayCache rays_;
  mutable MemoryBudget memory_;
  mutable std::mutex mutex_;  // of these two
  mutable std::map<int, std::shared_ptr<DepthFrame>> kept_;
  mutable std::size_t kept_bytes_ = 0;
  // The grid's origin is a corner of the world's own voxels near the first camera: single precision
  // is enough about it, wherever the scan lies.
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  DepthFusionResult result_;
};

}  // namespace

void bind(ParameterTable& table, DepthFusionOptions& options) {
  DepthPlaneOptions& planes = options.planes;
  table.add("voxel_size_m", options.voxel_size_m, positive, "one point per voxel of this size");
  table.add("min_depth_m", planes.min_depth_m, positive, "nearer measurements are dropped");
  table.add("max_depth_m", planes.max_depth_m, positive, "farther measurements are dropped");
  table.add("max_incidence_deg", planes.max_incidence_deg, {0, 89.5, true, false},
            "measurements more oblique than this to their surface are dropped");
  table.add("axial_noise_m", planes.noise.axial_m, positive,
            "standard deviation of depth at range 0");
  table.add("range_noise", planes.noise.axial_of_range, not_negative,
            "standard deviation of depth added by each meter of range, m/m");
  table.add("lateral_noise_px", planes.noise.lateral_px, not_negative,
            "standard deviation across the line of sight");
  table.add("plane_radius_px", planes.radius_px, {1, 7},
            "disc of pixels that a plane is fitted to");
  table.add("min_pair_share", planes.min_pair_share, zero_to_one,
            "share of the pairs of opposite pixels around a pixel that must agree with it");
  table.add("disc_radius_voxels", options.disc_radius_voxels, positive,
            "disc of the surface whose measurements make a point");
  table.add("pose_error_m", options.pose_error_m, not_negative,
            "standard deviation of a whole frame, along a normal");
  table.add("registration_rounds", options.registration_rounds, {0, 20},
            "times, at most, that poses are corrected so that frames agree; 0: not at all");
  table.add("min_views", options.min_views, {1}, "points that fewer frames measured are dropped");
  table.add("max_seen_through", options.max_seen_through, not_negative,
            "points are dropped that are seen through more often, against being seen");
  table.add("extend_edges", options.extend_edges,
            "also points one voxel beyond the edges of what was measured");
  table.add("color", options.color, "colors, blended with the nearest front views ahead");
  table.add("stereo", options.stereo, "compute the depth of stereo pairs by semi-global matching");
  table.add("strict", options.strict, "end with an error if a frame cannot be used");
}

DepthFusionResult fuse_depth(const ScanSource& scan, const Trajectory& world_from_base,
                             const DepthFusionOptions& options, Progress& progress) {
  check(options);
  return Fusion(scan, options, progress).run(world_from_base);
}

}  // namespace libmap
