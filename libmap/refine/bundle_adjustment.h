// Poses, points and, if wanted, intrinsics that agree best with all observations of the points, in
// the pictures and in depth (Triggs et al. 2000), by Ceres with the points eliminated.
#pragma once

#include <cstddef>
#include <map>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/refine/block_system.h"
#include "libmap/refine/feature_tracks.h"
#include "libmap/refine/pose_graph_optimization.h"

namespace libmap {

struct BundleAdjustmentOptions {
  double robust_scale = 3.0;       // > 0: of Cauchy's loss, standard deviations of an observation
  int max_iterations = 30;         // >= 1
  bool refine_intrinsics = false;  // of each camera of the rig, the same in all frames; their
                                   // distortion stays
  double focal_prior = 0.005;      // > 0: standard deviation of the focal length, of itself
  double center_prior_px = 2.0;    // > 0: ... and of the principal point
};
void bind(ParameterTable& table, BundleAdjustmentOptions& options);

// Steps away from a camera's own.
struct IntrinsicsStep {
  double fx_share = 0.0;  // of fx
  double fy_share = 0.0;
  double cx_px = 0.0;
  double cy_px = 0.0;
};
// The camera with the step, and the rays of the features whose pixels it made.
Camera moved(Camera camera, const IntrinsicsStep& step);
void move_intrinsics(FrameFeatures& frame, const std::vector<IntrinsicsStep>& steps);

struct BundleAdjustmentResult {
  std::map<int, Pose> map_from_base;
  std::vector<Eigen::Vector3d> points;     // in the map, one a track
  std::vector<IntrinsicsStep> intrinsics;  // of a frame's cameras; empty if not asked
  // Of steps of the poses (rigid_motion.h), in the order of map_from_base, the points eliminated
  // (Schur complement), at the end: the links among them.
  BlockSystem information{0};
  std::size_t tracks = 0;
  std::size_t conflicts = 0;  // matches that are in no track (FeatureTracks)
  std::size_t observations = 0;
  double initial_cost = 0.0;
  double final_cost = 0.0;
  // Root mean squares of what is not down-weighted below a half.
  double reprojection_rms_px = 0.0;
  double depth_rms_m = 0.0;
  std::size_t outliers = 0;
  int iterations = 0;
  bool converged = false;
};

// Poses that the intrinsics were refined with fit features that move_intrinsics has moved. `links`
// are those of the graph at its optimum (odometry, closures of other sources, priors); the
// gauge nodes of the components stay where they are. The information is that of `system_tracks`
// where there are any: of TrackFrames::linked it is a little less, and sparse.
BundleAdjustmentResult adjust_bundle(const std::vector<FrameFeatures>& frames,
                                     const std::vector<FeatureTrack>& tracks,
                                     const std::map<int, Pose>& map_from_base,
                                     const std::vector<GraphLinkResult>& links,
                                     const std::vector<GraphComponent>& components,
                                     const BundleAdjustmentOptions& options = {},
                                     const std::vector<FeatureTrack>& system_tracks = {});

// The same of all that links of features say. More than a hundred frames or so are adjusted with
// conjugate gradients, and with a sparse information: in time that grows with the observations.
BundleAdjustmentResult adjust_bundle(const std::vector<FrameFeatures>& frames,
                                     const std::vector<FeatureLink>& feature_links,
                                     const std::map<int, Pose>& map_from_base,
                                     const std::vector<GraphLinkResult>& links,
                                     const std::vector<GraphComponent>& components,
                                     const BundleAdjustmentOptions& options = {});

}  // namespace libmap
