// Refines poses by depth images: aligns each frame's surface with the planes of all overlapping
// frames simultaneously (multi-view point-to-plane ICP; Chen and Medioni 1992, Pulli 1999).
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/progress.h"
#include "libmap/features/feature_tracks.h"
#include "libmap/features/features.h"
#include "libmap/optimize/block_system.h"
#include "libmap/optimize/pose_graph_optimization.h"

namespace libmap {

// links: aligns pairs of frames that are joined by a link. global: aligns all overlapping frames.
enum class IcpMode { off, links, global };

struct IcpOptions {
  IcpMode mode = IcpMode::global;
  int iterations = 12;           // >= 1: maximum number of iterations
  int pairs_per_frame = 8;       // >= 1: for global, pairs of each frame, by largest overlap
  double min_overlap = 0.25;     // 0 to 1: for global, minimum overlap as a share of samples
  int samples = 1500;            // >= 1: approximate number of surface samples per frame
  double max_distance_m = 0.03;  // > 0: initial maximum distance between a sample and its plane
  double max_normal_angle_deg = 35.0;  // maximum angle between normals of sample and plane
  double correlation = 4.0;  // >= 1: number of samples that count as one independent sample
  // 0 to 1: a pair's directions with a smaller ratio eigenvalue / largest eigenvalue are ignored.
  double max_degenerate_ratio = 0.002;
  // The width of the robust loss decreases slowly, for inaccurate initial poses (graduated
  // non-convexity, Blake and Zisserman 1987). No command option.
  bool graduated = false;
};
void bind(ParameterTable& table, IcpOptions& options);

struct IcpResult {
  std::map<int, Pose> map_from_base;
  // Information matrix of prior and surfaces, by pose, divided by deviation_scale^2.
  BlockSystem information{0};
  double deviation_scale = 1.0;  // >= 1: pose errors divided by those expected of independent noise
  std::size_t pairs = 0;         // number of aligned pairs
  std::size_t samples = 0;       // matched samples in the last iteration
  std::size_t degenerate_directions = 0;  // number of ignored directions of all pairs
  double initial_rms_m = 0.0;             // RMS distance along normals, first iteration
  double final_rms_m = 0.0;               // RMS distance along normals, last iteration
  int iterations = 0;
  bool converged = false;
  std::vector<FramePair> frame_pairs;  // aligned pairs; empty if the alignment failed
  double max_distance_m = 0.0;         // final maximum distance between a sample and a plane
};

// Aligns the surfaces of frames with a pose. `prior` is the information matrix of steps from
// `map_from_base` (BundleAdjustmentResult::information), one block per pose, for directions that
// the surfaces do not constrain. For IcpMode::links, `links` selects the pairs. The
// gauge node of each component is fixed. Returns the input poses and the prior if there are no
// pairs or the alignment diverges. The result does not depend on the number of threads. Throws
// Error if the size of `prior` is not the number of poses.
IcpResult align_surfaces(const std::vector<FrameFeatures>& frames,
                         const std::map<int, Pose>& map_from_base, const BlockSystem& prior,
                         const std::vector<GraphComponent>& components,
                         const std::vector<PoseLink>& links, const IcpOptions& options = {},
                         Progress& progress = no_progress());

// Returns the normal equations of the surfaces of `pairs` for steps of the poses, one block per
// pose of `map_from_base`. Each frame of a pair must have a pose.
BlockSystem surface_system(const std::vector<FrameFeatures>& frames,
                           const std::map<int, Pose>& map_from_base,
                           const std::vector<FramePair>& pairs, double max_distance_m,
                           const IcpOptions& options);

// Estimates the motion from frame `a` to frame `b` from depth alone, as a link. Unconstrained
// directions keep the initial guess `a_from_b`. Returns nullopt if the surfaces do not align.
std::optional<PoseLink> align_pair(const FrameFeatures& a, const FrameFeatures& b,
                                   const Pose& a_from_b);

}  // namespace libmap
