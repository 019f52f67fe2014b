// Optimizes poses, points and optionally camera parameters by bundle adjustment (Triggs et al.
// 2000) of the points' image positions and depths. Points are eliminated by the Schur complement.
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

// Bounds of physically possible calibrations. Estimates beyond the bounds compensate other errors.
struct CalibrationBounds {
  double frame_time_s = 0.033;                  // > 0: maximum depth delay and rolling shutter time
  double max_depth_correction_m = 0.01;         // >= 0: maximum depth correction: constant term
  double max_depth_correction_of_range = 0.02;  // >= 0: term proportional to range, m/m
  double deviations = 4.0;  // > 0: maximum of other parameters, in prior deviations; no option
};

struct BundleAdjustmentOptions {
  double robust_scale = 3.0;         // > 0: width of Cauchy's loss, standard deviations
  int max_iterations = 30;           // >= 1: maximum number of iterations
  bool refine_intrinsics = false;    // focal length, principal point; distortion is fixed
  bool refine_depth = false;         // a DepthCorrection per camera
  bool refine_registration = false;  // pose of the depth camera relative to the color camera
  bool refine_timing = false;        // a CameraTiming per camera and a velocity per node
  // Standard deviations of the priors, > 0. Depth priors are relative to the depth noise.
  double focal_prior = 0.02;            // of the focal length, relative to the focal length
  double center_prior_px = 8.0;         // of the principal point
  double depth_prior = 4.0;             // of the depth correction
  double depth_smoothness_prior = 0.7;  // of the second differences of the correction's spline
  double depth_knot_m = 0.2;            // >= 0.02: distance of the knots of the correction's spline
  CalibrationBounds bounds{};
  // The following fields have no command option.
  DepthNoise depth_noise{};      // depth noise, to which the depth priors are relative
  CameraTiming timing_mean{};    // mean of the timing's prior; the deviation is frame_time_s
  double tolerance = 1e-6;       // converged if a step reduces the cost by less than this fraction
  bool fixes_cameras = false;    // cameras keep the calibration `start`; velocities are free
  bool fixes_poses = false;      // poses are fixed
  std::size_t alternatives = 0;  // maximum number of alternative calibrations in the result
  bool with_information = true;  // the result contains the information matrix

  bool refines_cameras() const {
    return refine_intrinsics || refine_depth || refine_registration || refine_timing;
  }
};
void bind(ParameterTable& table, BundleAdjustmentOptions& options);

// Describes the first parameter of a calibration that is outside the bounds, with value and bound.
// Returns nullopt if the calibration is physically possible.
std::optional<std::string> exceeded_bound(const SensorCalibration& calibration,
                                          const BundleAdjustmentOptions& options);

// Standard deviation of a prior (mean 0) of the relative depth correction averaged over a camera's
// features. Images and depth do not reveal a depth scale error, so the depth camera sets the scale.
inline constexpr double depth_gauge = 1e-6;
// Standard deviation of the prior of a registration's shift, m.
inline constexpr double registration_prior_m = 0.02;

struct BundleAdjustmentResult {
  std::map<int, Pose> map_from_base;
  std::vector<Eigen::Vector3d> points;  // map frame, one per track; 0 if observed from < 2 poses
  SensorCalibration calibration;        // estimated parameters; empty without any
  // Each alternative differs from `calibration` by one standard deviation, in one of the
  // independent directions in parameter space that change the poses' positions most.
  std::vector<SensorCalibration> alternatives;
  SensorCalibration deviations;  // of intrinsics and timing; empty without `alternatives`
  // Information matrix of steps of the poses (rigid_motion.h) at the optimum, in the order of
  // map_from_base, including the links. Points are eliminated (Schur complement).
  BlockSystem information{0};
  std::size_t tracks = 0;     // number of used tracks
  std::size_t conflicts = 0;  // FeatureTracks::conflicts
  std::size_t observations = 0;
  double initial_cost = 0.0;
  double final_cost = 0.0;
  double reprojection_rms_px = 0.0;  // RMS residual of inliers
  double depth_rms_m = 0.0;          // RMS residual of inliers
  std::size_t outliers = 0;          // observations with a weight below one half
  int iterations = 0;
  bool converged = false;  // true: the result is usable
};

// Adjusts poses, points and the camera parameters that `options` frees. The resulting poses are for
// frames to which the resulting calibration is applied (calibrate()). `links` are links of the pose
// graph that are not from the tracks, e.g. odometry. The gauge node of each component is fixed.
// `start` is the initial calibration; by default the stored cameras and the motion between poses.
// `system_tracks`, if any, replace `tracks` in information, counts and residuals (add_information);
// with TrackFrames::linked, the information matrix is sparse and slightly smaller. Memory is
// proportional to (number of poses)^2. Throws Error if an option is out of range.
BundleAdjustmentResult adjust_bundle(
    const std::vector<FrameFeatures>& frames, const std::vector<FeatureTrack>& tracks,
    const std::map<int, Pose>& map_from_base, const std::vector<GraphLinkResult>& links,
    const std::vector<GraphComponent>& components, const BundleAdjustmentOptions& options = {},
    const std::vector<FeatureTrack>& system_tracks = {}, const SensorCalibration& start = {});

// Builds tracks from feature links and adjusts them as above. From 120 poses on, adjust_sparse
// (sparse_adjustment.h) is used, unless camera parameters are free. Throws Error as above.
BundleAdjustmentResult adjust_bundle(
    const std::vector<FrameFeatures>& frames, const std::vector<FeatureLink>& feature_links,
    const std::map<int, Pose>& map_from_base, const std::vector<GraphLinkResult>& links,
    const std::vector<GraphComponent>& components, const BundleAdjustmentOptions& options = {},
    const SensorCalibration& start = {}, Progress& progress = no_progress());

// Sets information, counts and residuals of `result`. `points` are the points of `tracks` (map
// frame); if empty, they are estimated at the poses of `result`.
void add_information(const std::vector<FrameFeatures>& frames,
                     const std::vector<FeatureTrack>& tracks,
                     const std::vector<GraphLinkResult>& links,
                     const BundleAdjustmentOptions& options, BundleAdjustmentResult& result,
                     const std::vector<Eigen::Vector3d>& points = {});

// Builds the tracks for the information of `poses` poses: TrackFrames::linked from 120 poses on.
FeatureTracks information_tracks(const std::vector<FrameFeatures>& frames,
                                 const std::vector<FeatureLink>& feature_links, std::size_t poses);

}  // namespace libmap
