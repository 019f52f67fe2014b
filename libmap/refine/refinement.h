// Pose refinement of a scan: features, rounds of loop closures with pose graph optimization, bundle
// adjustment, calibration and ICP. A stage is rejected if held-out observations (held_out.h) fit
// worse after it.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/error.h"
#include "libmap/core/parameters.h"
#include "libmap/core/pose_graph.h"
#include "libmap/core/progress.h"
#include "libmap/core/result_table.h"
#include "libmap/features/feature_cache.h"
#include "libmap/features/features.h"
#include "libmap/features/held_out.h"
#include "libmap/optimize/bundle_adjustment.h"
#include "libmap/optimize/icp_refinement.h"
#include "libmap/optimize/pose_graph_optimization.h"
#include "libmap/poses/trajectory_error.h"
#include "libmap/refine/board_scale.h"
#include "libmap/refine/initial_poses.h"
#include "libmap/refine/loop_closure.h"
#include "libmap/refine/scan_scale.h"
#include "libmap/refine/sensor_calibration.h"
#include "libmap/refine/visual_odometry.h"

namespace libmap {

// Treatment of focal lengths and principal points in bundle adjustment. automatic: estimated if the
// held-out observations then fit significantly better.
enum class IntrinsicsMode { fixed, refined, automatic };

// Source of the scale if no factor, known length or board is given. odometry: odometry links.
enum class ScaleSource { depth, odometry };

struct RefinementOptions {
  StartPoses start = StartPoses::automatic;
  int rounds = 5;      // >= 0: maximum number of rounds of loop closures
  bool bundle = true;  // bundle adjustment
  IntrinsicsMode intrinsics = IntrinsicsMode::automatic;
  // Depth camera: a name in data/sensors or a path. Its depth range, noise, timing and calibration
  // bounds replace default values. "auto": the noise is estimated.
  std::string sensor = "auto";
  // Parts of a calibration. Each is estimated, and used if the held-out data then fit better.
  bool correct_depth = true;    // correction by depth and distance from the image center
  bool register_depth = true;   // registration of depth to color
  bool estimate_timing = true;  // depth delay and rolling shutter time
  FeatureOptions features{};
  VisualOdometryOptions odometry{};
  LoopClosureDetectionOptions closures{};
  PoseGraphOptions graph{};
  BundleAdjustmentOptions bundle_adjustment{};
  IcpOptions icp{.iterations = 8};  // more iterations do not change results of simulated scans
  ScaleSource scale_from = ScaleSource::depth;
  double scale = 1.0;  // 0.5 to 2: known factor for poses and depth; 1: no factor is known
  // The next three fields have no key in the parameter table.
  std::vector<KnownLength> known_lengths{};
  std::optional<Chessboard> board{};  // static board in the scene
  bool one_map = false;               // only the largest connected component gets poses
  std::uint64_t seed = 1;
};
void bind(ParameterTable& table, RefinementOptions& options);

// Errors of poses against true poses, if these are stored in the scan. For reports only.
struct StageError {
  AbsoluteTrajectoryError absolute;
  TrajectoryError relative;  // between consecutive poses
};

struct StageReport {
  std::string name{};
  bool rejected = false;
  RejectionCounts closures{};                             // counts of this stage's candidates
  HeldOutEvaluation held_out{};                           // change by the stage, all feature links
  std::map<std::string, LinkGroupResult> groups{};        // empty without pose graph optimization
  std::vector<std::pair<std::string, double>> metrics{};  // name and value
  std::vector<std::string> warnings{};
  std::optional<StageError> error{};           // nullopt without true poses
  std::optional<StageError> rejected_error{};  // error of the poses of a rejected stage
  double seconds = 0.0;                        // elapsed time
  double processor_seconds = 0.0;              // processor time of all threads
};

struct RefinementResult {
  Trajectory poses;                // map from base, by ascending node
  std::vector<PoseLink> links;     // accepted links: stored links (recalibrated), then found links
  std::vector<PoseLink> closures;  // found links among `links`
  // Covariance of a step of each node's pose (rigid_motion.h) relative to the component's gauge
  // node, at the scale of the depth camera; empty if the poses are not determined. Includes the
  // uncertainty of the calibration, but not the depth camera's scale error.
  std::map<int, Matrix6d> covariance;
  std::vector<GraphComponent> components;
  std::vector<StageReport> stages;             // "start" first
  std::vector<std::pair<int, Error>> skipped;  // nodes of frames without features, with the reason
  std::vector<int> without_pose;               // nodes without a pose in `poses`
  std::vector<TrackingLoss> losses;            // of visual odometry
  std::vector<int> without_links;              // nodes without a link
  std::vector<PoseLink> rejected_links;        // stored links that the optimization rejected
  std::size_t features = 0;                    // number of features of all frames
  SensorCalibration calibration;               // empty: the stored cameras are kept
  SensorCalibration deviations;                // BundleAdjustmentResult::deviations
  std::vector<Camera> cameras;                 // of the images, as stored
  std::vector<std::string> findings;           // about the sensor, one sentence each
  std::string noise;                           // sentence: depth noise and source of the noise
  std::string scale;                           // sentence: source and uncertainty of the scale
  std::vector<std::string> warnings;
};
void describe(ResultTable& table, const RefinementResult& result);

// Refines the poses of a scan. With StartPoses::automatic or visual, visual odometry estimates the
// poses of nodes without an initial pose. A connected component of only such nodes gets no poses,
// except the largest one if no node has an initial pose. The output bytes do not depend on the
// number of threads. Throws Error if an option is out of range, the requested initial poses are
// missing, the focal length of depth is wrong, or no two frames match and the scan has no links.
// Also throws Error if two options determine the scale, or the requested source does not.
RefinementResult refine_poses(const ScanSource& scan, const RefinementOptions& options = {},
                              Progress& progress = no_progress(), const FeatureCache& cache = {});

// Returns the scan's camera with the estimated calibration and the findings. Throws Error if the
// scan has no calibration or several cameras.
CameraFile refined_camera(const RefinementResult& result, const ScanSource& scan);

}  // namespace libmap
