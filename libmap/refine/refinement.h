// The whole way from a scan's odometry to refined poses: features, rounds of loop closures each
// followed by an optimization of the pose graph, bundle adjustment, depth against depth. A stage
// after which what was held out fits worse is rejected and reported.
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

// Whether the bundle adjustment estimates focal lengths and principal points too.
// automatic: if what was held out fits better then, by more than chance explains.
enum class IntrinsicsMode { fixed, refined, automatic };

// What determines the scale where neither a factor, lengths nor a board are known.
enum class ScaleSource { depth, odometry };

struct RefinementOptions {
  StartPoses start = StartPoses::automatic;
  int rounds = 5;  // >= 0: of loop closures, each on the poses of the last
  bool bundle = true;
  IntrinsicsMode intrinsics = IntrinsicsMode::automatic;
  // Name in data/sensors or a path: its noise, useful range, timing and bounds replace what the
  // other options leave at their defaults. "auto": the noise is estimated.
  std::string sensor = "auto";
  // Parts of a calibration that are estimated if the held-out data fit better with them.
  bool correct_depth = true;    // bend of depth by range and radius
  bool register_depth = true;   // registration of depth to color
  bool estimate_timing = true;  // delay of depth, and time of the rows of an image
  FeatureOptions features{};
  VisualOdometryOptions odometry{};
  LoopClosureDetectionOptions closures{};
  PoseGraphOptions graph{};
  BundleAdjustmentOptions bundle_adjustment{};
  IcpOptions icp{};
  ScaleSource scale_from = ScaleSource::depth;
  double scale = 1.0;  // 0.5..2: known factor of poses and depth; 1: none is known
  std::vector<KnownLength> known_lengths{};  // not bound; they determine the scale
  std::optional<Chessboard> board{};         // not bound; at rest in the scene, does so too
  bool one_map = false;  // not bound: parts that nothing joins to the largest get no poses
  std::uint64_t seed = 1;
};
void bind(ParameterTable& table, RefinementOptions& options);

// Against true poses, where the scan holds any: for reports only, nothing is fitted to them.
struct StageError {
  AbsoluteTrajectoryError absolute;
  TrajectoryError relative;  // from pose to pose
};

struct StageReport {
  std::string name{};
  bool rejected = false;
  RejectionCounts closures{};                       // of this stage
  HeldOutEvaluation held_out{};                     // of this stage's links and of those before
  std::map<std::string, LinkGroupResult> groups{};  // of an optimized graph
  std::vector<std::pair<std::string, double>> figures{};  // metrics of the stage
  std::vector<std::string> warnings{};
  std::optional<StageError> error{};
  std::optional<StageError> rejected_error{};  // of the poses that were given up
  double seconds = 0.0;
  double processor_seconds = 0.0;
};

struct RefinementResult {
  Trajectory poses;                // by ascending node
  std::vector<PoseLink> links;     // stored ones as recalibrated, then those found; none rejected
  std::vector<PoseLink> closures;  // those found, among the links
  // Of a step of each pose against its component's gauge node, that of the calibration included; in
  // units of the depth camera, whose own scale error is not.
  std::map<int, Matrix6d> covariance;
  std::vector<GraphComponent> components;
  std::vector<StageReport> stages;             // "start" first
  std::vector<std::pair<int, Error>> skipped;  // frames without features and why
  std::vector<int> without_pose;
  std::vector<TrackingLoss> losses;  // of visual odometry
  std::vector<int> without_links;
  std::vector<PoseLink> rejected_links;  // stored ones
  std::size_t features = 0;
  SensorCalibration calibration;      // as estimated
  SensorCalibration deviations;       // BundleAdjustmentResult::deviations
  std::vector<Camera> cameras;        // of the pictures, as stored
  std::vector<std::string> findings;  // about the sensor, a sentence each
  std::string noise;                  // of depth, and its source, a sentence
  std::string scale;                  // a sentence: what it comes from, and how certain it is
  std::vector<std::string> warnings;
};
void describe(ResultTable& table, const RefinementResult& result);

// Nodes that neither poses nor links place are placed by visual odometry (StartPoses::automatic,
// visual); those of its parts that nothing joins to the largest one are left out of the poses, for
// they would lie anywhere. The same bytes for any number of threads. Throws Error: options out of
// their ranges, poses asked for that the scan has not, no two frames that could be matched where
// nothing else gives poses, a board that does not determine the scale.
RefinementResult refine_poses(const ScanSource& scan, const RefinementOptions& options = {},
                              Progress& progress = no_progress(), const FeatureCache& cache = {});

// The camera of the scan as estimated, with the findings. Throws Error: the scan has no
// calibration, or several cameras.
CameraFile refined_camera(const RefinementResult& result, const ScanSource& scan);

}  // namespace libmap
