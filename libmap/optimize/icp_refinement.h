// Poses by the depth images themselves: each frame's surface against the planes of all frames that
// see the same place, together (multi-view point-to-plane ICP; Chen and Medioni 1992, Pulli 1999).
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

// links: each pair of frames that a link joins; global: each frame with all that overlap it.
enum class IcpMode { off, links, global };

struct IcpOptions {
  IcpMode mode = IcpMode::global;
  int iterations = 12;           // >= 1
  int pairs_per_frame = 8;       // >= 1: global, those that overlap most
  double min_overlap = 0.25;     // 0 to 1: of the one frame's surface
  int samples = 1500;            // >= 1: of a frame against another, at most
  double max_distance_m = 0.03;  // > 0: between a sample and the plane, at first
  double max_normal_angle_deg = 35.0;
  double correlation = 4.0;   // >= 1: samples that tell as much as one independent one
  double degenerate = 0.002;  // >= 0: share of the best-bound direction's information below
                              // which a pair says nothing about a direction
  // Not bound: the loss is at first as wide as the distance, and narrows slowly (graduated
  // non-convexity, Blake and Zisserman 1987), for starts that are far away.
  bool graduated = false;
};
void bind(ParameterTable& table, IcpOptions& options);

struct IcpResult {
  std::map<int, Pose> map_from_base;
  // Prior and surfaces together, in the order of the poses, divided by the square of
  // deviation_scale.
  BlockSystem information{0};
  double deviation_scale = 1.0;  // >= 1: how much larger errors are than independent noise explains
  std::size_t pairs = 0;
  std::size_t samples = 0;                // that matched, at the end
  std::size_t degenerate_directions = 0;  // of all pairs
  double initial_rms_m = 0.0;             // along the normals
  double final_rms_m = 0.0;
  int iterations = 0;
  bool converged = false;
  std::vector<FramePair> frame_pairs;  // that were laid against each other
  double max_distance_m = 0.0;         // between a sample and a plane at the end
};

// `prior` holds what is known already (BundleAdjustmentResult::information), of steps from
// `map_from_base`; directions that the surfaces do not bind are left to it. `links` are the pairs
// of IcpMode::links. The same for any number of threads.
IcpResult align_surfaces(const std::vector<FrameFeatures>& frames,
                         const std::map<int, Pose>& map_from_base, const BlockSystem& prior,
                         const std::vector<GraphComponent>& components,
                         const std::vector<PoseLink>& links, const IcpOptions& options = {},
                         Progress& progress = no_progress());

// What the surfaces of pairs of frames ask of steps of the poses as they are. The same for any
// number of threads.
BlockSystem surface_system(const std::vector<FrameFeatures>& frames,
                           const std::map<int, Pose>& map_from_base,
                           const std::vector<FramePair>& pairs, double max_distance_m,
                           const IcpOptions& options);

// How frame `b` moved from frame `a` by their depth alone. Directions that the surfaces do not bind
// keep the guess `a_from_b`. Returns nullopt if the surfaces do not align.
std::optional<PoseLink> align_pair(const FrameFeatures& a, const FrameFeatures& b,
                                   const Pose& a_from_b);

}  // namespace libmap
