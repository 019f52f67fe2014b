#include "libmap/fusion/depth_fusion.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <span>

#include "libmap/camera/rgbd_frame.h"
#include "libmap/camera/sensor_model.h"
#include "libmap/core/error.h"
#include "libmap/core/memory_budget.h"
#include "libmap/core/parallel.h"
#include "libmap/core/text.h"
#include "libmap/fusion/frame_registration.h"
#include "libmap/fusion/fusion_frames.h"
#include "libmap/fusion/fusion_tiling.h"
#include "libmap/fusion/registration_check.h"
#include "libmap/fusion/surface_points.h"
#include "libmap/fusion/surface_refinement.h"
#include "libmap/fusion/surface_voxels.h"
#include "libmap/fusion/tile_mask.h"
#include "libmap/fusion/view_coverage.h"

namespace libmap {

namespace {

// Number of frames whose coarse surfaces are made in parallel.
constexpr std::size_t frames_in_flight = 8;
// Memory per pixel while a frame is made into a coarse surface.
constexpr std::uint64_t coarse_pixel_bytes = 60;
// Approximate number of elements for registration: the larger of a total and a number per frame.
constexpr std::size_t registration_elements = 20000;
constexpr std::size_t registration_elements_per_frame = 40;
// Maximum number of voxels per such element: noise spreads a surface over several voxels, and each
// downsampling keeps half of them.
constexpr std::size_t voxels_per_element = 8;
constexpr unsigned max_thinning = 32;
// Maximum distance of frames from the coarse surface in the first round of registration.
constexpr double first_search_voxels = 3.0;
// Smaller corrections of heights (root mean square) are not applied.
constexpr double min_correction_voxels = 0.05;
// Width of the cells in which frames are compared with earlier frames.
constexpr double coverage_voxels = 8.0;

void check(const DepthFusionOptions& options) {
  check_parameters(options);
  if (!(options.planes.max_depth_m > options.planes.min_depth_m))
    throw Error("not above min_depth_m", {.field = "max_depth_m",
                                          .value = to_text(options.planes.max_depth_m),
                                          .bound = "> " + to_text(options.planes.min_depth_m)});
}

std::string node_name(int node) { return "node " + std::to_string(node); }

// Contribution of one frame to a coarse surface and the frame selection.
struct CoarseFrame {
  SurfaceVoxels::Frame voxels;
  DepthPixelCounts pixels;
  std::size_t number = 0;      // index of the frame
  FusionFrame frame;           // selection only
  FrameCoverage coverage;      // selection only
  std::optional<Error> fault;  // selection only; none for a usable frame
};

DepthFusionOptions with_sensor(DepthFusionOptions options) {
  if (options.sensor != "auto") apply(read_sensor_model(options.sensor), options.planes);
  return options;
}

class Fusion {
 public:
  Fusion(const ScanSource& scan, const Trajectory& world_from_base,
         const DepthFusionOptions& options, Progress& progress, const FusionPlan* known)
      : options_(with_sensor(options)),
        progress_(&progress),
        world_from_base_(world_from_base),
        images_(scan, {.stereo = options.stereo, .strict = options.strict}) {
    check(options);
    if (known != nullptr) {
      plan_ = *known;
      options_.planes.noise = plan_.noise;
    } else {
      plan_.noise = options_.planes.noise;
      const std::vector<FusionFrame> given = place_frames();
      timed("frame selection", [&] { select_frames(given); });
      timed("registration", [&] { register_frames(); });
    }
    if (frames().empty()) throw no_frames(world_from_base.size());
  }

  const FusionPlan& plan() const { return plan_; }
  const std::vector<XyTile>& tiles() const { return tiles_; }
  void make_tiles(double tile_m);
  TileFusion::Tile make(std::size_t tile);
  DepthFusionResult report() const;

 private:
  // Indices of the frames that affect a tile, and of the frames that are counted in it.
  struct Members {
    std::vector<std::size_t> frames;
    std::vector<std::size_t> counted;
  };

  template <typename Step>
  void timed(const char* name, const Step& step) {
    libmap::timed(timings_s_, name, step);
  }
  const std::vector<FusionFrame>& frames() const { return plan_.frames; }

  Error no_frames(std::size_t poses) const {
    if (plan_.skipped.empty())
      return poses == 0 ? no_elements("poses") : Error("none has depth", {.field = "frames"});
    return Error("none of " + std::to_string(poses) +
                     " can be used; error of the first: " + plan_.skipped.front().second.what(),
                 {.field = "frames"});
  }

  void skip(int node, const Error& fault) {
    if (options_.strict) throw fault;
    plan_.skipped.emplace_back(node, fault);
  }

  std::vector<FusionFrame> place_frames() {
    std::vector<FusionFrame> frames;
    for (const TrajectoryPose& pose : world_from_base_) {
      if (!pose.world_from_base.matrix().allFinite()) {
        skip(pose.node, Error("the pose is not finite", {.field = node_name(pose.node)}));
        continue;
      }
      if (frames.empty())
        plan_.grid_origin =
            (pose.world_from_base.translation() / options_.voxel_size_m).array().floor() *
            options_.voxel_size_m;
      frames.push_back(
          frame_at(pose, plan_.grid_origin, options_.voxel_size_m, options_.planes.max_depth_m));
    }
    std::stable_sort(frames.begin(), frames.end(),
                     [](const FusionFrame& a, const FusionFrame& b) { return a.node < b.node; });
    return frames;
  }

  // Calls merge(n, make(n, cells)) for each frame in order. One thread merges the previous frames
  // while others make the next ones.
  template <typename Make, typename Merge>
  void each_frame(std::size_t count, const TileMask& cells, const Make& make, const Merge& merge) {
    std::vector<CoarseFrame> before;
    for (std::size_t first = 0; first < count || !before.empty(); first += frames_in_flight) {
      const std::size_t now = first < count ? std::min(frames_in_flight, count - first) : 0;
      std::vector<CoarseFrame> parts(now);
      const TileMask as_they_are = cells;
      parallel_each(now + 1, [&](std::size_t task) {
        if (task > 0) {
          parts[task - 1] = make(first + task - 1, as_they_are);
          progress_->advance(1);
          return;
        }
        for (const CoarseFrame& part : before) merge(part);
      });
      before = std::move(parts);
    }
  }

  // Adds the planes of one frame's pixels that are in `cells`.
  void add_frame(const RgbdFrame& depth, const Pose& grid_from_base, const TileMask& cells,
                 FittedPixels fitted, CoarseFrame& coarse) {
    const MemoryBudget::Reservation reservation =
        memory_.take(coarse_pixel_bytes * depth.depth.pixels.size());
    SurfaceVoxels voxels;
    for (const CameraView& view : camera_views(depth)) {
      const auto rays = images_.rays_of(view.depth_camera);
      const Pose grid_from_camera = grid_from_base * view.depth_camera.base_from_camera;
      merge_into(coarse.pixels,
                 add_depth_planes(view.depth, *rays, grid_from_camera, options_.planes,
                                  options_.voxel_size_m, cells, fitted, voxels));
    }
    coarse.voxels = std::move(voxels).take_frame();
  }

  // Determines the frame's reach and coverage, or the fault that makes it unusable.
  void measure_frame(CoarseFrame& coarse) {
    FusionFrame& frame = coarse.frame;
    const std::shared_ptr<const RgbdFrame> depth = images_.depth_of(frame.node);
    images_.measure_reach(*depth, options_.planes.max_depth_m, frame);
    for (const CameraView& view : camera_views(*depth))
      coarse.coverage.add(view.depth, *images_.rays_of(view.depth_camera),
                          frame.grid_from_base * view.depth_camera.base_from_camera,
                          options_.planes, coverage_voxels * options_.voxel_size_m);
  }

  std::size_t wanted_elements(std::size_t frames) const {
    return std::max(registration_elements, registration_elements_per_frame * frames);
  }

  // Sorts frames into usable, redundant and skipped ones, comparing each with earlier frames.
  void select_frames(const std::vector<FusionFrame>& given) {
    progress_->begin("frame selection", given.size());
    ViewCoverage known;
    for (std::size_t first = 0; first < given.size(); first += frames_in_flight) {
      std::vector<CoarseFrame> parts(std::min(frames_in_flight, given.size() - first));
      parallel_each(parts.size(), [&](std::size_t n) {
        parts[n].frame = given[first + n];
        try {
          measure_frame(parts[n]);
        } catch (const Error& error) {
          if (error.kind() != ErrorKind::bad_input) throw;
          parts[n].fault = error;
        }
      });
      for (const CoarseFrame& part : parts) {
        if (part.fault) {
          skip(part.frame.node, *part.fault);
        } else if (options_.enough_views > 0.0 && plan_.frames.size() > 1 &&
                   !known.is_improved_by(part.coverage, options_.enough_views)) {
          plan_.redundant.push_back(part.frame.node);
        } else {
          plan_.frames.push_back(part.frame);
          known.add(part.coverage);
        }
      }
      if (!plan_.redundant.empty()) images_.evict_others(frames());
      progress_->advance(parts.size());
    }
  }

  // Makes the coarse surface in random squares of the x-y plane, with the present poses.
  void sample_surface() {
    sample_ = {};
    const std::size_t max_voxels = voxels_per_element * wanted_elements(frames().size());
    const auto make = [&](std::size_t n, const TileMask& wanted) {
      CoarseFrame coarse;
      add_frame(*images_.depth_of(frames()[n].node), frames()[n].grid_from_base, wanted,
                FittedPixels::in_cells, coarse);
      return coarse;
    };
    each_frame(frames().size(), sampled_, make, [&](const CoarseFrame& coarse) {
      sample_.merge(coarse.voxels, sampled_);
      while (sample_.size() > max_voxels && sampled_.subsampling_level < max_thinning) {
        ++sampled_.subsampling_level;
        sample_ = sample_.in(sampled_);
      }
    });
  }

  SurfaceSearch search_within(double search_m) const {
    return {options_.disc_radius_voxels * options_.voxel_size_m, search_m};
  }

  // Selects elements for registration from the sampled surface, and frees it.
  std::vector<SurfaceElement> registration_elements_of_sample() {
    std::vector<SurfaceElement> elements = surface_elements(sample_, false);
    sample_ = {};
    std::erase_if(elements, [](const SurfaceElement& element) {
      return TileMask::is_held_out(element.position.head<2>());
    });
    const std::size_t step =
        std::max<std::size_t>(1, elements.size() / wanted_elements(frames().size()));
    for (std::size_t n = 0; n * step < elements.size(); ++n) {
      elements[n] = elements[n * step];
      elements[n].position *= static_cast<float>(options_.voxel_size_m);
    }
    elements.resize((elements.size() + step - 1) / step);
    return elements;
  }

  // Registers the frames by their heights above the selected elements.
  FrameRegistration registration(int round) {
    const std::vector<SurfaceElement> elements = registration_elements_of_sample();
    const SurfaceSearch search = search_within(first_search_voxels * options_.voxel_size_m / round);
    std::vector<SurfaceObservation> observations;
    images_.each_view_group(
        frames(), false, [&](std::span<const RefinementView> views, std::size_t frames) {
          const auto more = observe_surface(elements, views, options_.planes, search);
          observations.insert(observations.end(), more.begin(), more.end());
          progress_->advance(frames);
        });
    std::stable_sort(observations.begin(), observations.end(),
                     [](const auto& a, const auto& b) { return a.element < b.element; });
    std::vector<Eigen::Vector3d> centers;
    for (const FusionFrame& frame : frames()) centers.push_back(frame.grid_from_base.translation());
    return libmap::register_frames(elements, observations, centers);
  }

  void register_frames() {
    if (frames().size() < 2) return;
    // Refined poses already use depth, so only color can confirm a registration.
    plan_.registration_rejected = options_.refined_poses && !images_.has_color(frames());
    for (int round = 1; round <= options_.registration_rounds && !plan_.registration_rejected;
         ++round) {
      progress_->begin("registration", 2 * frames().size());
      sample_surface();
      const FrameRegistration found = registration(round);
      if (round == 1) plan_.disagreement_before_m = found.disagreement_before_m;
      plan_.disagreement_after_m = found.disagreement_before_m;
      // Correct poses remain unchanged.
      if (!(found.correction_m > min_correction_voxels * options_.voxel_size_m)) break;
      std::vector<FusionFrame> moved = frames();
      for (std::size_t n = 0; n < moved.size(); ++n) move(moved[n], found.corrected_from_given[n]);
      const RegistrationCheck check =
          check_registration(images_, frames(), moved, options_.planes, options_.voxel_size_m);
      if (round == 1) plan_.registration_check = check;
      if (!check.is_accepted(options_.refined_poses)) {
        plan_.registration_rejected = round == 1;
        break;
      }
      plan_.frames = std::move(moved);
      plan_.disagreement_after_m = found.disagreement_after_m;
      ++plan_.registration_rounds;
    }
    sample_ = {};
  }

  FusionTiling tiling_of(double tile_m) const {
    // The gate of refinement bounds the distance between a point and its element.
    const SurfaceSearch search = search_within(options_.voxel_size_m);
    const double gate_m = max_gate_m(options_.planes, search);
    double shift_m = 0.0;
    double disc_m = search.disc_radius_m;
    for (const FusionFrame& frame : frames()) {
      shift_m = std::max(shift_m, frame.max_ray_length * gate_m);
      disc_m =
          std::max(disc_m, frame.max_pixel_pitch * min_disc_pixels * options_.planes.max_depth_m);
    }
    const double unit = std::min(tile_m, options_.voxel_size_m);
    if (!(plan_.grid_origin.cwiseAbs().maxCoeff() / unit < 1e15))
      throw Error("the pose is too far from the origin for tiles; move the origin to the scan",
                  {.field = node_name(frames().front().node)});
    return {tile_m, options_.voxel_size_m, plan_.grid_origin, shift_m, disc_m};
  }

  const TrajectoryPose& given_pose(int node) const;
  void add_redundant_poses(Trajectory& poses) const;
  TileFusion::Tile fuse_tile(const TileMask& cells, int element_margin, const Members& members);
  SurfaceVoxels coarse_surface(const Members& members, const TileMask& around,
                               const TileMask& cells, FusionCounts& counts);
  PointCloud make_cloud(const TileMask& cells, const RefinedSurface& surface,
                        FusionCounts& counts) const;

  DepthFusionOptions options_;
  Progress* progress_;  // no output while tiles are made
  Trajectory world_from_base_;
  FusionFrames images_;
  MemoryBudget memory_;
  FusionPlan plan_;
  TileMask sampled_;  // squares of the x-y plane used for registration
  SurfaceVoxels sample_;
  std::optional<FusionTiling> tiling_;
  std::vector<XyTile> tiles_;
  std::vector<Members> members_;  // one per tile
  StageTimings timings_s_;
};

const TrajectoryPose& Fusion::given_pose(int node) const {
  const auto given = std::find_if(world_from_base_.begin(), world_from_base_.end(),
                                  [&](const TrajectoryPose& pose) { return pose.node == node; });
  if (given == world_from_base_.end()) throw Error("no pose", {.field = node_name(node)});
  return *given;
}

// Applies the correction of the used frame with the nearest number to each redundant frame.
void Fusion::add_redundant_poses(Trajectory& poses) const {
  const Trajectory used = poses;
  for (const int node : plan_.redundant) {
    TrajectoryPose pose = given_pose(node);
    if (plan_.registration_rounds > 0) {
      const auto nearest = std::min_element(used.begin(), used.end(), [&](auto& a, auto& b) {
        return std::abs(a.node - node) < std::abs(b.node - node);
      });
      pose.world_from_base = nearest->world_from_base *
                             given_pose(nearest->node).world_from_base.inverse() *
                             pose.world_from_base;
    }
    poses.push_back(pose);
  }
  std::stable_sort(poses.begin(), poses.end(),
                   [](const auto& a, const auto& b) { return a.node < b.node; });
}

// Fills the poses and all metrics of the frames.
DepthFusionResult Fusion::report() const {
  DepthFusionResult result;
  result.redundant_frames = plan_.redundant.size();
  result.frames = frames().size();
  result.registration_rounds = plan_.registration_rounds;
  result.registration_rejected = plan_.registration_rejected;
  result.registration_check = plan_.registration_check;
  result.disagreement_before_m = plan_.disagreement_before_m;
  result.disagreement_after_m = plan_.disagreement_after_m;
  result.noise = plan_.noise;
  result.skipped = plan_.skipped;
  result.timings_s = timings_s_;
  double turns = 0.0;
  double shifts = 0.0;
  for (const FusionFrame& frame : frames()) {
    TrajectoryPose pose = given_pose(frame.node);
    if (plan_.registration_rounds > 0) {
      const Pose used = Eigen::Translation3d(plan_.grid_origin) * frame.grid_from_base;
      const Pose given_from_used = pose.world_from_base.inverse() * used;
      pose.world_from_base = used;
      const double turn = Eigen::AngleAxisd(given_from_used.linear()).angle();
      turns += turn * turn;
      shifts += given_from_used.translation().squaredNorm();
    }
    result.poses.push_back(pose);
  }
  add_redundant_poses(result.poses);
  const auto count = static_cast<double>(frames().size());
  result.registration_turn_deg = std::sqrt(turns / count) * 180.0 / std::numbers::pi;
  result.registration_shift_m = std::sqrt(shifts / count);
  return result;
}

void Fusion::make_tiles(double tile_m) {
  if (tile_m == whole_plan) {
    tiles_.emplace_back();
    Members& all = members_.emplace_back();
    for (std::size_t n = 0; n < frames().size(); ++n) all.frames.push_back(n);
    all.counted = all.frames;
    return;
  }
  progress_ = &no_progress();
  tiling_ = tiling_of(tile_m);
  std::map<XyTile, Members> members;
  for (std::size_t n = 0; n < frames().size(); ++n) {
    std::optional<XyTile> first;
    tiling_->each_tile(frames()[n].reach, [&](const XyTile& tile) {
      members[tile].frames.push_back(n);
      first = std::min(first.value_or(tile), tile);
    });
    if (first) members[*first].counted.push_back(n);
  }
  for (auto& [tile, tile_members] : members) {
    tiles_.push_back(tile);
    members_.push_back(std::move(tile_members));
  }
}

TileFusion::Tile Fusion::make(std::size_t tile) {
  const Members& members = members_[tile];
  progress_->begin("fusion", 2 * members.frames.size());
  if (!tiling_) return fuse_tile({}, 0, members);
  return fuse_tile(tiling_->points(tiles_[tile]), tiling_->element_margin(), members);
}

TileFusion::Tile Fusion::fuse_tile(const TileMask& cells, int element_margin,
                                   const Members& members) {
  TileFusion::Tile tile;
  std::vector<FusionFrame> of_tile;
  for (const std::size_t n : members.frames) of_tile.push_back(frames()[n]);
  images_.evict_others(of_tile);
  const TileMask around = cells.grown(element_margin);
  std::vector<SurfaceElement> elements;
  timed("coarse surface", [&] {
    const SurfaceVoxels voxels =
        coarse_surface(members, around.grown(element_neighborhood), cells, tile.counts);
    elements = surface_elements(voxels, options_.extend_edges);
  });
  std::erase_if(elements, [&](const SurfaceElement& element) {
    return !around.contains(element.position.head<2>());
  });
  const auto voxel = static_cast<float>(options_.voxel_size_m);
  for (SurfaceElement& element : elements) {
    if (cells.contains(element.position.head<2>())) ++tile.counts.elements;
    element.position *= voxel;
  }
  RefinedSurface surface;
  if (elements.empty()) {
    progress_->advance(of_tile.size());
  } else {
    timed("refinement", [&] {
      surface = refine_surface(
          std::move(elements), options_.planes, search_within(options_.voxel_size_m),
          options_.pose_error_m, [&](const AddViews& add) {
            images_.each_view_group(of_tile, options_.color,
                                    [&](std::span<const RefinementView> views, std::size_t count) {
                                      add(views);
                                      progress_->advance(count);
                                    });
          });
    });
  }
  timed("cloud", [&] { tile.cloud = make_cloud(cells, surface, tile.counts); });
  return tile;
}

SurfaceVoxels Fusion::coarse_surface(const Members& members, const TileMask& around,
                                     const TileMask& cells, FusionCounts& counts) {
  SurfaceVoxels voxels;
  const auto make = [&](std::size_t n, const TileMask& wanted) {
    CoarseFrame coarse;
    coarse.number = members.frames[n];
    const FusionFrame& frame = frames()[coarse.number];
    const bool is_counted =
        std::binary_search(members.counted.begin(), members.counted.end(), coarse.number);
    add_frame(*images_.depth_of(frame.node), frame.grid_from_base, wanted,
              is_counted ? FittedPixels::all : FittedPixels::in_cells, coarse);
    if (!is_counted) coarse.pixels = {};
    return coarse;
  };
  each_frame(members.frames.size(), around, make, [&](const CoarseFrame& coarse) {
    voxels.merge(coarse.voxels, around);
    merge_into(counts.pixels, coarse.pixels);
  });
  for (const std::uint64_t key : voxels.index().keys())
    if (cells.has_cell(unpack(key).cell.head<2>())) ++counts.occupied_voxels;
  return voxels;
}

PointCloud Fusion::make_cloud(const TileMask& cells, const RefinedSurface& surface,
                              FusionCounts& counts) const {
  SurfacePoints points =
      make_surface_points(surface, options_.voxel_size_m, cells, options_.points);
  counts.points = points.counts;
  counts.output_points = points.cloud.size();
  for (Eigen::Vector3d& position : points.cloud.positions) position += plan_.grid_origin;
  return std::move(points.cloud);
}

}  // namespace

DepthFusionResult fuse_depth(const ScanSource& scan, const Trajectory& world_from_base,
                             const DepthFusionOptions& options, Progress& progress) {
  TileFusion fusion(scan, world_from_base, options, whole_plan, progress);
  TileFusion::Tile whole = fusion.make(0);
  DepthFusionResult result = fusion.report();
  static_cast<FusionCounts&>(result) = whole.counts;
  result.cloud = std::move(whole.cloud);
  return result;
}

class TileFusion::Work : public Fusion {
 public:
  using Fusion::Fusion;
};

TileFusion::TileFusion(const ScanSource& scan, const Trajectory& world_from_base,
                       const DepthFusionOptions& options, double tile_m, Progress& progress,
                       const FusionPlan* known)
    : work_(std::make_unique<Work>(scan, world_from_base, options, progress, known)) {
  work_->make_tiles(tile_m);
}

TileFusion::~TileFusion() = default;

const FusionPlan& TileFusion::plan() const { return work_->plan(); }

const std::vector<XyTile>& TileFusion::tiles() const { return work_->tiles(); }

TileFusion::Tile TileFusion::make(std::size_t tile) { return work_->make(tile); }

DepthFusionResult TileFusion::report() const { return work_->report(); }

}  // namespace libmap
