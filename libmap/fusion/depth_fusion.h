// One oriented, colored cloud from all depth images of a scan.
//
// Frames whose poses do not agree are moved together first (frame_registration): a map is as sharp
// as its poses. Elements for that are taken from squares of the plan chosen by chance. Then two
// passes over the frames. The first fits a plane to the pixels around each pixel (depth_planes) and
// averages positions and normals in a hashed voxel grid (surface_voxels): a coarse surface, one
// element per voxel. The second moves each element along its normal to the weighted mean of what
// all frames measured within a disc around it (surface_refinement). Both average where the rays
// meet the surface, not where noise has put the measurements: that is what makes the means free of
// bias. Memory grows with the occupied voxels of a tile; besides, up to 256 MB of decoded depth is
// kept for later passes (300 frames of 512 x 424), other frames are decoded once per pass.
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
  double voxel_size_m = 0.01;  // > 0
  // Name in data/sensors or a path: its useful range and noise where other options have their
  // defaults; "auto": the defaults, a Kinect v2's.
  std::string sensor = "auto";
  DepthPlaneOptions planes{};
  double disc_radius_voxels = 1.5;  // > 0: measurements this near along the surface are averaged
  // >= 0: by which a whole frame may lie wrong along a normal. It keeps the frame nearest to a
  // place from speaking for it alone.
  double pose_error_m = 0.0;
  // >= 0: times, at most, that all poses are corrected so that frames agree before they are fused
  // (frame_registration); 0: poses are taken as they are.
  int registration_rounds = 3;
  // The poses were refined by depth and color already: only color accepts a registration.
  bool refined_poses = false;
  // >= 0: frames are left out that add less than 1/enough_views to what earlier frames have
  // measured of nearly all their surface; 0: all frames are fused.
  double enough_views = 10.0;
  SurfacePointOptions points{};
  // Points one voxel beyond the edge of what was measured, unless views see through them.
  bool extend_edges = true;
  bool color = true;
  bool stereo = false;  // compute the depth of stereo pairs (stereo_depth)
  bool strict = false;  // a frame that cannot be used is an Error
};
void bind(ParameterTable& table, DepthFusionOptions& options);

// Of one tile, or of several together.
struct FusionCounts {
  DepthPixelCounts pixels;  // of each frame once
  std::size_t occupied_voxels = 0;
  std::size_t elements = 0;  // of the surface, before points were made of them
  SurfacePointCounts points;
  std::size_t points_made = 0;
};
void describe(ResultTable& table, const FusionCounts& counts);

// Mean costs of one kind of measurements by the poses before and after a registration.
struct PairCosts {
  std::size_t count = 0;
  double before = 0.0;
  double after = 0.0;
  double deviation = 0.0;  // standard error of after - before, between pairs of frames

  // By more than two standard errors and half a percent.
  bool is_clearly_worse() const;
  bool is_clearly_better() const;
};

struct RegistrationCheck {
  PairCosts depth;  // in the held-out squares of the plan
  PairCosts color;  // everywhere: registration uses depth only

  // No kind is clearly worse and both together are better. Refined poses have used depth already:
  // color must be clearly better.
  bool is_accepted(bool refined_poses) const;
};

// The frames that can be used, where they are fused: what all tiles have in common.
struct FusionSurvey {
  // The grid's origin is a corner of the world's own voxels near the first camera: single precision
  // is enough about it, wherever the scan lies.
  Eigen::Vector3d grid_origin = Eigen::Vector3d::Zero();
  std::vector<FusionFrame> frames;               // by ascending node
  std::vector<std::pair<int, Error>> skipped{};  // node and what it lacks
  std::vector<int> redundant{};                  // nodes whose frames add next to nothing
  int registration_rounds = 0;         // that moved frames; 0: the poses are those that were given
  bool registration_rejected = false;  // its first round
  RegistrationCheck registration_check{};  // of the first round
  // Of heights that frames measured of a place, about their mean: by the poses given, and in the
  // end.
  double disagreement_before_m = 0.0;
  double disagreement_after_m = 0.0;
};

struct DepthFusionResult : FusionCounts {
  // World frame; unit normals towards the cameras; colors if any frame has them. Fields: `views`,
  // distinct frames; `expected_error` of the position along the normal, m, one standard deviation:
  // from the noise, from how far frames disagree, and from how far the two passes do, as they do
  // where the surface bends within a disc.
  PointCloud cloud;
  std::size_t frames = 0;  // used
  std::size_t redundant_frames = 0;
  // The used and the redundant frames, by ascending node, with their poses after registration.
  Trajectory poses;
  // Of FusionSurvey, and root mean squares over the frames against the poses that were given.
  int registration_rounds = 0;
  bool registration_rejected = false;
  RegistrationCheck registration_check{};
  double registration_shift_m = 0.0;
  double registration_turn_deg = 0.0;
  double disagreement_before_m = 0.0;
  double disagreement_after_m = 0.0;
  std::vector<std::pair<int, Error>> skipped;
  StageTimings timings_s;
};
void describe(ResultTable& table, const DepthFusionResult& result);

// The frames of `world_from_base` that have depth, by ascending node. The same bytes for any number
// of threads. Frames without depth, with a pose that is not finite or that cannot be decoded are
// skipped and listed. Throws Error: options out of their ranges, no frame that can be used, poses
// that lie too far apart for the voxel size (2^20 voxels).
DepthFusionResult fuse_depth(const ScanSource& scan, const Trajectory& world_from_base,
                             const DepthFusionOptions& options = {},
                             Progress& progress = no_progress());

// Side of a tile that contains the whole plan.
inline constexpr double whole_plan = std::numeric_limits<double>::infinity();

// The same in square tiles of the world's x-y plane, with the side `tile_m`, rounded to whole
// voxels. Memory depends on the size of a tile, and each frame adds 4 kB. Each point is in one tile
// only. It is the same point, bit for bit, as without tiles.
class TileFusion {
 public:
  // Surveys and registers the frames, unless `known` is what that has found before. `scan`
  // and `progress` must outlive this. Throws Error as fuse_depth, or for poses too far from the
  // origin for tiles.
  TileFusion(const ScanSource& scan, const Trajectory& world_from_base,
             const DepthFusionOptions& options, double tile_m, Progress& progress = no_progress(),
             const FusionSurvey* known = nullptr);
  ~TileFusion();

  const FusionSurvey& survey() const;        // for a later TileFusion
  const std::vector<XyTile>& tiles() const;  // to which a frame matters, in their order
  struct Tile {
    PointCloud cloud;
    FusionCounts counts;
  };
  Tile make(std::size_t tile);  // of tiles()
  // But for cloud and counts; the times are those until now.
  DepthFusionResult report() const;

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

}  // namespace libmap
