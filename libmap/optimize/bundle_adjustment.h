// Poses, points and, if wanted, intrinsics and a correction of depth that agree best with all
// observations of the points, in the pictures and in depth (Triggs et al. 2000), the points
// eliminated.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/progress.h"
#include "libmap/features/feature_tracks.h"
#include "libmap/features/frame_calibration.h"
#include "libmap/fusion/depth_noise.h"
#include "libmap/optimize/block_system.h"
#include "libmap/optimize/pose_graph_optimization.h"

namespace libmap {

// Values that no camera exceeds: a calibration beyond them explains other errors.
struct CalibrationBounds {
  double frame_time_s = 0.033;  // > 0: of a delay of depth and of the rows of a picture
  double max_bend_m = 0.01;     // >= 0: of a correction of depth at range 0 ...
  double bend_of_range = 0.02;  // >= 0: ... and what each meter of range adds, m/m
  double deviations = 4.0;      // not bound; of other parameters, from their prior
};

struct BundleAdjustmentOptions {
  double robust_scale = 3.0;         // > 0: of Cauchy's loss, standard deviations of an observation
  int max_iterations = 30;           // >= 1
  bool refine_intrinsics = false;    // of each camera of the rig, the same in all frames; their
                                     // distortion stays
  bool refine_depth = false;         // a DepthCorrection of each camera
  bool refine_registration = false;  // of depth to color, of each camera
  bool refine_timing = false;        // a CameraTiming of each camera, and the motion at each node
  double focal_prior = 0.02;         // > 0: standard deviation of the focal length, of itself
  double center_prior_px = 8.0;      // > 0: ... and of the principal point
  double depth_prior = 4.0;          // > 0: ... and of a correction of depth, of depth's own noise
  double depth_bend = 0.7;           // > 0: ... and of its second difference from knot to knot
  double depth_knot_m = 0.2;         // >= 0.02: between the knots of its spline
  CalibrationBounds bounds{};
  // Not bound.
  DepthNoise depth_noise{};
  CameraTiming timing_mean{};  // of the prior; its deviation is the frame time
  double tolerance = 1e-6;     // steps end when one lowers the cost by less than this share
  bool hold_cameras = false;   // at the start's calibration: of what is free, motions alone change
  bool hold_poses = false;
  std::size_t alternatives = 0;  // of the result's calibration
  bool with_information = true;  // of the result

  bool refines_cameras() const {
    return refine_intrinsics || refine_depth || refine_registration || refine_timing;
  }
};
void bind(ParameterTable& table, BundleAdjustmentOptions& options);

// A sentence about the first parameter of a calibration that is outside its bounds; nullopt if the
// calibration is physically possible.
std::optional<std::string> exceeded_bound(const SensorCalibration& calibration,
                                          const BundleAdjustmentOptions& options);

// The mean share of the depths of its features by which a camera's depth may be corrected: pictures
// and depth alone cannot tell a scale of depth from a larger scene, so the scale stays that of the
// depth camera.
inline constexpr double depth_gauge = 1e-6;

struct BundleAdjustmentResult {
  std::map<int, Pose> map_from_base;
  std::vector<Eigen::Vector3d> points;  // in the map, one a track
  SensorCalibration calibration;        // what was free
  // Calibrations one standard deviation away in independent directions: those that move the
  // positions of the poses most.
  std::vector<SensorCalibration> alternatives;
  SensorCalibration deviations;  // standard deviations of intrinsics and timing, with alternatives
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

// The poses fit frames that are calibrated by the result's calibration. `links` are those of the
// graph at its optimum (odometry, closures of other sources, priors); the gauge nodes of the
// components stay where they are. The information is that of `system_tracks` where there are any:
// of TrackFrames::linked it is a little less, and sparse. `start` is where what is free begins;
// without it, at the stored cameras and the motion between poses. Memory grows with the square of
// the poses.
BundleAdjustmentResult adjust_bundle(
    const std::vector<FrameFeatures>& frames, const std::vector<FeatureTrack>& tracks,
    const std::map<int, Pose>& map_from_base, const std::vector<GraphLinkResult>& links,
    const std::vector<GraphComponent>& components, const BundleAdjustmentOptions& options = {},
    const std::vector<FeatureTrack>& system_tracks = {}, const SensorCalibration& start = {});

// The same of all that links of features say. More than a hundred frames or so are adjusted in the
// sparse system of the links (sparse_adjustment.h), unless calibration is free.
BundleAdjustmentResult adjust_bundle(
    const std::vector<FrameFeatures>& frames, const std::vector<FeatureLink>& feature_links,
    const std::map<int, Pose>& map_from_base, const std::vector<GraphLinkResult>& links,
    const std::vector<GraphComponent>& components, const BundleAdjustmentOptions& options = {},
    const SensorCalibration& start = {}, Progress& progress = no_progress());

// What a result without information lacks: the information, and the counts and residuals of
// observations. Without points of the tracks, they are where their observations agree best.
void add_information(const std::vector<FrameFeatures>& frames,
                     const std::vector<FeatureTrack>& tracks,
                     const std::vector<GraphLinkResult>& links,
                     const BundleAdjustmentOptions& options, BundleAdjustmentResult& result,
                     const std::vector<Eigen::Vector3d>& points = {});

// The tracks whose system is the information of a result with so many poses.
FeatureTracks information_tracks(const std::vector<FrameFeatures>& frames,
                                 const std::vector<FeatureLink>& feature_links, std::size_t poses);

}  // namespace libmap
