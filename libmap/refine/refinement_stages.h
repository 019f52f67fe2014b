// Stages of a refinement: functions of an input and a state that return the next state and a
// report. refinement.cc accepts or rejects the next state. Private to libmap/refine. Stages throw
// Error for an option that is out of range.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "libmap/refine/refinement.h"

namespace libmap {

// Inputs of all stages, which no stage changes.
struct RefinementInput {
  const ScanSource& scan;
  const RefinementOptions& options;
  Progress& progress;
  std::map<int, Pose> start{};                  // initial poses
  std::vector<std::vector<int>> start_parts{};  // InitialPoses::parts
  std::set<int> odometry_nodes{};               // nodes whose poses visual odometry estimates
  std::vector<BoardView> board_views{};
  // Cache of feature matches, which do not depend on the calibration.
  KnownMatches* known_matches = nullptr;
  Pose color_from_depth = Pose::Identity();  // coarse registration that `scan` applies
};

// Frames are shared between states; a stage that changes frames creates new ones.
using SharedFrames = std::shared_ptr<std::vector<FrameFeatures>>;

// State that stages change.
struct RefinementState {
  std::map<int, Pose> poses{};            // map_from_base by node; ids below 0: landmarks
  std::vector<std::vector<int>> parts{};  // groups of nodes with poses in one coordinate frame
  SharedFrames frames{};                  // with the calibration applied
  SharedFrames stored_frames{};           // with the stored cameras
  SensorCalibration calibration{};
  std::vector<GraphLink> other_links{};  // links of the scan, and from ICP of lost frames
  std::vector<FeatureLink> feature_links{};
  std::set<FramePair> tried_pairs{};       // pairs of frames that have been matched
  PoseGraphResult graph{};                 // links: other_links, then feature_links
  std::vector<TrackingLoss> losses{};      // of visual odometry
  BlockSystem information{0};              // information matrix of pose errors, order of `poses`
  bool is_from_bundle = false;             // the information is from a bundle adjustment
  std::vector<FramePair> surface_pairs{};  // pairs of frames that ICP has aligned
  double surface_distance_m = 0.0;         // IcpResult::max_distance_m
  double deviation_scale = 1.0;            // IcpResult::deviation_scale
  DepthNoise noise{};                      // noise that the frames assume
  std::vector<std::string> warnings{};

  // Results of the graph's links that are not from features.
  std::vector<GraphLinkResult> results_of_other_links() const {
    return {graph.links.begin(),
            graph.links.begin() + static_cast<std::ptrdiff_t>(other_links.size())};
  }
};

inline constexpr const char* depth_link_group = "depth odometry";  // GraphLink::group of ICP links

// Returns the input of a calibration, which contains references to `state` and `other_links`.
CalibrationInput calibration_input(const RefinementInput& input, const RefinementState& state,
                                   const std::vector<GraphLinkResult>& other_links);

// Returns a copy of the stored frames with the calibration applied.
SharedFrames calibrated(const std::vector<FrameFeatures>& stored,
                        const SensorCalibration& calibration);

struct StageResult {
  RefinementState state;
  StageReport report{};
  bool is_validated = false;  // the stage has compared held-out observations itself
};

// Estimates missing poses by visual odometry. Motions between frames become feature links.
StageResult track_stage(const RefinementInput& input, const RefinementState& state);

// Optimizes the pose graph of all links without recalibration, for the check of loop closures.
PoseGraphResult graph_as_stored(const RefinementInput& input, const RefinementState& state);

// Returns pairs of frames to match in a round. Round 0: consecutive frames, from which the noise of
// the odometry is estimated. Round 1: similar and near frames. Later: near frames.
std::set<FramePair> candidate_pairs(const RefinementInput& input, const RefinementState& state,
                                    int round);
// Links pairs of frames by features and optimizes the pose graph.
StageResult link_stage(const RefinementInput& input, const RefinementState& state, int round,
                       const std::vector<FramePair>& pairs);
// Links frames without feature links to consecutive and near frames by aligning depth, from the
// present poses. Adds these links, which have no matches, to feature_links.
StageResult depth_link_stage(const RefinementInput& input, const RefinementState& state);
// Drops feature links that the pose graph has rejected. Returns the number of dropped links.
std::size_t drop_rejected_links(RefinementState& state);

// Refines the poses by bundle adjustment with the cameras of `state.frames`.
StageResult bundle_stage(const RefinementInput& input, const RefinementState& state);

// Estimates intrinsics, depth correction, registration and timing by bundle adjustment. The frames
// of `state` have stored cameras. The search begins at the calibration of `state`, if any, and
// estimates only the parts of that calibration.
StageResult calibrate_stage(const RefinementInput& input, const RefinementState& state);
// Matches linked frames again after a calibration, because a false calibration causes missed and
// false matches. Returns state.feature_links if fewer than 90 % of the pairs match.
std::vector<FeatureLink> rematched_links(const RefinementInput& input,
                                         const RefinementState& state);
// Returns the information matrix of steps of the poses with the state's calibration.
BlockSystem information_of(const RefinementInput& input, const RefinementState& state);

// Aligns depth images by ICP: all overlapping images, or only linked images (IcpOptions::mode).
StageResult surface_stage(const RefinementInput& input, const RefinementState& state);

// Pose changes by node: one per independent direction of the calibration's error, for an error of
// one standard deviation in this direction.
using CalibrationMoves = std::map<int, std::vector<Vector6d>>;
// Returns the linearized changes, divided by state.deviation_scale; empty without a calibration or
// a solution. Sets `deviations` to the standard deviations of intrinsics and timing.
CalibrationMoves calibration_moves(const RefinementInput& input, const RefinementState& state,
                                   SensorCalibration& deviations);

// Replaces default values by the values of options.sensor. Throws Error for an unknown sensor.
RefinementOptions with_sensor(RefinementOptions options);
// Throws Error if two options determine the scale.
void require_one_scale(const RefinementOptions& options);

struct ScaleResult {
  std::string sentence{};              // source and uncertainty of the scale
  std::optional<StageResult> stage{};  // with the corrected scale; nullopt if it is unchanged
};
// Determines the scale from known lengths, a board, a given factor or odometry, else the depth
// camera. Throws Error if the requested source does not determine the scale.
ScaleResult scale_stage(const RefinementInput& input, const RefinementState& state,
                        const std::map<int, Matrix6d>& covariance, const CalibrationMoves& moves);

}  // namespace libmap
