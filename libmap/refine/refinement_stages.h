// The stages of a refinement: functions of the scan and a state that return the next state and a
// report. The workflow (refinement.cc) accepts or rejects them. Private to libmap/refine.
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

// What stages read and none changes.
struct RefinementInput {
  const ScanSource& scan;
  const RefinementOptions& options;
  Progress& progress;
  std::map<int, Pose> start{};                  // initial poses
  std::vector<std::vector<int>> start_parts{};  // nodes whose initial poses are in one frame
  std::set<int> tracked{};                      // nodes that visual odometry places
  std::vector<BoardView> board_views{};
  // Matches of pairs of frames, kept for matching again with another calibration; nullptr for long
  // scans, whose features are compared again.
  KnownMatches* known_matches = nullptr;
  Pose color_from_depth = Pose::Identity();  // by which the depth of `scan` has been registered
};

// Frames are shared between states; a stage that changes frames makes others.
using SharedFrames = std::shared_ptr<std::vector<FrameFeatures>>;

// What stages change.
struct RefinementState {
  std::map<int, Pose> poses{};            // of nodes and, below 0, of landmarks
  std::vector<std::vector<int>> parts{};  // nodes whose poses are in one frame
  SharedFrames frames{};                  // with the calibration applied
  SharedFrames stored_frames{};           // with the stored cameras
  SensorCalibration calibration{};
  std::vector<GraphLink> other_links{};  // of the scan, and of frames that depth alone tracks
  std::vector<FeatureLink> feature_links{};
  std::set<FramePair> tried{};             // pairs of frames that have been compared
  PoseGraphResult graph{};                 // its links: other_links, then feature_links
  std::vector<TrackingLoss> losses{};      // of visual odometry
  BlockSystem information{0};              // of steps of the poses, in their order
  bool by_observations = false;            // the information is that of a bundle adjustment
  std::vector<FramePair> surface_pairs{};  // that have moved the poses
  double surface_distance_m = 0.0;         // IcpResult::max_distance_m
  double deviation_scale = 1.0;            // IcpResult::deviation_scale
  DepthNoise noise{};                      // that the frames have
  std::vector<std::string> warnings{};

  // Of the graph's links, those that are not of features.
  std::vector<GraphLinkResult> results_of_other_links() const {
    return {graph.links.begin(),
            graph.links.begin() + static_cast<std::ptrdiff_t>(other_links.size())};
  }
};

inline constexpr const char* depth_link_group = "depth odometry";

// What a calibration is estimated from; it refers to the state and to `other_links`.
CalibrationInput calibration_input(const RefinementInput& input, const RefinementState& state,
                                   const std::vector<GraphLinkResult>& other_links);

// The frames as if they had been recorded with the calibration.
SharedFrames calibrated(const std::vector<FrameFeatures>& stored,
                        const SensorCalibration& calibration);

struct StageResult {
  RefinementState state;
  StageReport report{};
  bool is_validated = false;  // the stage has compared held-out observations itself
};

// Places nodes without a pose by visual odometry. Its motions are links of features like all
// others.
StageResult track_stage(const RefinementInput& input, const RefinementState& state);

// The pose graph of all links, without recalibration: closures are checked against it.
PoseGraphResult graph_as_stored(const RefinementInput& input, const RefinementState& state);

// Pairs of frames to match in a round. Round 0: frames that follow each other, which determine how
// good the odometry is. Round 1: similar and near frames. Later: frames that are near by the poses.
std::set<FramePair> candidate_pairs(const RefinementInput& input, const RefinementState& state,
                                    int round);
// Links pairs of frames by their features and optimizes the pose graph.
StageResult link_stage(const RefinementInput& input, const RefinementState& state, int round,
                       const std::vector<FramePair>& pairs);
// Links frames that no feature link joins by aligning their depth, from the poses as they are, with
// frames that follow each other or are near. The links have no matches.
StageResult depth_link_stage(const RefinementInput& input, const RefinementState& state);
// Drops links of features that the pose graph has rejected. Returns their number.
std::size_t drop_rejected_links(RefinementState& state);

// Bundle adjustment with the stored cameras.
StageResult bundle_stage(const RefinementInput& input, const RefinementState& state);

// Bundle adjustment with free intrinsics, depth, its registration and timing. `state` has stored
// cameras; its calibration, if any, is where the search begins and limits what is free.
StageResult calibrate_stage(const RefinementInput& input, const RefinementState& state);
// Matches linked frames again: a false camera hides matches and lets others pass. The links as they
// were if too few pairs match.
std::vector<FeatureLink> rematched_links(const RefinementInput& input,
                                         const RefinementState& state);
// The system of the poses at a calibration, for covariances.
BlockSystem information_of(const RefinementInput& input, const RefinementState& state);

// ICP of all overlapping depth images.
StageResult surface_stage(const RefinementInput& input, const RefinementState& state);

// Moves of each node for calibrations that are as likely: independent, one standard deviation each.
using CalibrationMoves = std::map<int, std::vector<Vector6d>>;
// `deviations` receives the standard deviations of intrinsics and timing.
CalibrationMoves calibration_moves(const RefinementInput& input, const RefinementState& state,
                                   SensorCalibration& deviations);

struct ScaleResult {
  std::string sentence{};              // source and uncertainty of the scale
  std::optional<StageResult> stage{};  // with the corrected scale
};
// The scale by known lengths, a board, a given factor or odometry; else that of the depth camera.
ScaleResult scale_stage(const RefinementInput& input, const RefinementState& state,
                        const std::map<int, Matrix6d>& covariance, const CalibrationMoves& moves);

}  // namespace libmap
