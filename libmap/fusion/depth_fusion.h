// Fuses all depth images of a scan into one oriented, colored cloud, in four steps:
// 1. frame_registration moves frames so that the surfaces agree in random blocks of the x-y plane.
// 2. First pass over the frames: depth_planes fits a plane to the pixels around each pixel, and
//    surface_voxels averages positions and normals in a hashed voxel grid. The result is a coarse
//    surface of surface elements (points with normals): in each column of voxels, one per surface.
// 3. Second pass: surface_refinement moves each element along its normal to the weighted mean of
//    the measurements of all frames within a disc around the element.
// 4. surface_points converts the elements to a cloud.
// Both passes average intersections of rays with the surface instead of noisy points, so the means
// are unbiased. Memory is proportional to the occupied voxels of a tile. Up to 256 MB of decoded
// depth is cached (300 frames of 512 x 424); other frames are decoded once per pass.
#pragma once

#include <cstddef>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/pose_graph.h"
#include "libmap/core/progress.h"
#include "libmap/core/stage_timer.h"
#include "libmap/fusion/depth_planes.h"
#include "libmap/fusion/fusion_frames.h"
#include "libmap/fusion/surface_points.h"
#include "libmap/scan/scan_source.h"
#include "libmap/tiles/xy_tile.h"

namespace libmap {

struct DepthFusionOptions {
  double voxel_size_m = 0.01;  // > 0: edge length of a voxel
  // Depth camera: a name in data/sensors or a path. Its depth range and noise replace default
  // values of `planes`. "auto": `planes` is used unchanged.
  std::string sensor = "auto";
  DepthPlaneOptions planes{};
  double disc_radius_voxels = 1.5;  // > 0: radius of the discs in which measurements are averaged
  // >= 0: standard deviation of a frame's position along the normal, due to pose errors. A value
  // above 0 prevents the nearest frame from dominating the mean.
  double pose_error_m = 0.0;
  // >= 0: maximum number of rounds of registration before fusion; 0: poses are used unchanged.
  int registration_rounds = 3;
  // true: poses are already refined with depth and color, so only color can confirm a registration.
  bool refined_poses = false;
  // >= 0: skips a frame that adds less than 1/enough_views to the information (inverse variance) of
  // earlier frames on nearly all of the frame's surface; 0: fuses all frames.
  double enough_views = 10.0;
  SurfacePointOptions points{};
  // Adds points one voxel beyond measured edges, unless views see through these points.
  bool extend_edges = true;
  bool color = true;
  bool stereo = false;  // compute the depth of stereo pairs (stereo_depth)
  bool strict = false;  // throw Error for a frame that cannot be used
};
void bind(ParameterTable& table, DepthFusionOptions& options);

// Counts for one tile, or sums over several.
struct FusionCounts {
  DepthPixelCounts pixels;          // each frame is counted in one tile only
  std::size_t occupied_voxels = 0;  // voxels with measurements
  std::size_t elements = 0;         // surface elements, before points are selected
  SurfacePointCounts points;
  std::size_t output_points = 0;  // points of the cloud
};
void describe(ResultTable& table, const FusionCounts& counts);

// Mean costs of pairs of overlapping frames with the poses before and after a registration. Cost of
// depth: log(1 + chi-square / 9). Cost of color: 1 - correlation of the brightness of patches.
struct PairCosts {
  std::size_t count = 0;  // number of compared pixels
  double before = 0.0;
  double after = 0.0;
  double deviation = 0.0;  // standard error of after - before, from the scatter of the pairs

  // Both return true if the difference exceeds two standard errors and half a percent of `before`.
  bool is_clearly_worse() const;
  bool is_clearly_better() const;
};

struct RegistrationCheck {
  PairCosts depth;  // in held-out blocks of the x-y plane
  PairCosts color;  // everywhere, because registration uses depth only

  // Returns true if neither depth nor color is clearly worse, and the sum of both improvements, in
  // standard errors, is above 0. For refined poses, color must be clearly better instead.
  bool is_accepted(bool refined_poses) const;
};

// Result of the first step: usable frames with registered poses, common to all tiles.
struct FusionPlan {
  // World position of the voxel grid's origin, near the first pose. Positions relative to the
  // origin can be in single precision, even far from the world's origin.
  Eigen::Vector3d grid_origin = Eigen::Vector3d::Zero();
  std::vector<FusionFrame> frames;               // by ascending node
  std::vector<std::pair<int, Error>> skipped{};  // nodes of unusable frames, with the reason
  std::vector<int> redundant{};                  // nodes of frames without new information
  int registration_rounds = 0;                   // rounds that moved frames; 0: poses are unchanged
  // true: the first round was rejected, or poses are refined and there is no color to check them.
  bool registration_rejected = false;
  RegistrationCheck registration_check{};  // of the first round
  // RMS deviation of frames' surface heights from the mean height, with given and final poses.
  double disagreement_before_m = 0.0;
  double disagreement_after_m = 0.0;
  DepthNoise noise{};  // depth noise that all passes assume
};

struct DepthFusionResult : FusionCounts {
  // World frame; unit normals towards the cameras; colors if any frame has color. Fields: `views`,
  // number of distinct frames; `expected_error`, standard deviation of the position along the
  // normal, m. It includes noise, disagreement of frames, and half the shift in the second pass,
  // which is large where the surface is curved within a disc.
  PointCloud cloud;
  std::size_t frames = 0;            // number of fused frames
  std::size_t redundant_frames = 0;  // number of frames skipped by `enough_views`
  // Registered poses of fused and redundant frames, world from base, by ascending node.
  Trajectory poses;
  // As in FusionPlan; shift and turn are root mean squares over the frames.
  int registration_rounds = 0;
  bool registration_rejected = false;
  RegistrationCheck registration_check{};
  double registration_shift_m = 0.0;
  double registration_turn_deg = 0.0;
  double disagreement_before_m = 0.0;
  double disagreement_after_m = 0.0;
  DepthNoise noise{};
  std::vector<std::pair<int, Error>> skipped;
  StageTimings timings_s;
};
void describe(ResultTable& table, const DepthFusionResult& result);

// Fuses the frames of `world_from_base` that have depth. The output bytes do not depend on the
// number of threads. Frames that have no depth or no finite pose, or that cannot be decoded, are
// skipped and listed, or with `strict` throw Error. Throws Error if an option is out of range, no
// frame is usable, or poses are too far apart for the voxel size (2^20 voxels).
DepthFusionResult fuse_depth(const ScanSource& scan, const Trajectory& world_from_base,
                             const DepthFusionOptions& options = {},
                             Progress& progress = no_progress());

// Side of a tile that contains the whole x-y plane.
inline constexpr double whole_plan = std::numeric_limits<double>::infinity();

// Fuses in square tiles of the world's x-y plane with side `tile_m`, rounded to whole voxels.
// Memory depends on the size of a tile; each frame adds 4 kB. Each point is in one tile only and is
// identical, bit for bit, to the point without tiles.
class TileFusion {
 public:
  // Selects and registers frames, or uses `known`, the plan() of another TileFusion. `scan` and
  // `progress` must outlive this object. Throws Error as fuse_depth does, and if poses are too far
  // from the world's origin.
  TileFusion(const ScanSource& scan, const Trajectory& world_from_base,
             const DepthFusionOptions& options, double tile_m, Progress& progress = no_progress(),
             const FusionPlan* known = nullptr);
  ~TileFusion();

  const FusionPlan& plan() const;            // plan of all tiles
  const std::vector<XyTile>& tiles() const;  // tiles with frames, in ascending order
  struct Tile {
    PointCloud cloud;
    FusionCounts counts;
  };
  Tile make(std::size_t tile);  // fuses the tile with this index in tiles()
  // Returns the result without cloud and counts, with the times until now.
  DepthFusionResult report() const;

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

}  // namespace libmap
