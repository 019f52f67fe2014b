// The state of one refinement, stage by stage. Inner part of libmap/refine.
#pragma once

#include <chrono>
#include <cstddef>
#include <ctime>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "libmap/refine/refinement.h"

namespace libmap {

inline constexpr const char* depth_group = "depth odometry";  // of links

class Refinement {
 public:
  Refinement(const ScanSource& scan, const RefinementOptions& options, Progress& progress,
             const FeatureCache& cache)
      : scan_(scan),
        options_(options),
        progress_(progress),
        cache_(cache),
        truth_(trajectory_of(scan.graph(), PoseSource::ground_truth)) {}
  // All stages; see refine_poses in refinement.h.
  RefinementResult run();

 private:
  using Clock = std::chrono::steady_clock;

  void start();
  void find_frames();
  bool may_be_visual() const {
    return options_.start == StartPoses::visual || options_.start == StartPoses::automatic;
  }
  bool is_all_tracked() const {
    return std::all_of(poses_.begin(), poses_.end(), [&](const auto& pose) {
      return pose.first < 0 || tracked_.contains(pose.first);
    });
  }
  void find_poses();
  void odometry();
  std::vector<int> unjoined(const std::vector<std::vector<int>>& parts) const;
  void leave_out_unjoined();
  bool round(int number);
  std::vector<FramePair> candidates(int number);
  std::vector<GraphLink> with_features(const std::vector<FeatureLink>& links) const;
  // Of long scans none: they are compared again.
  KnownMatches* matches_to_keep() {
    return frames_.size() <= options_.features.max_frames_in_memory ? &known_matches_ : nullptr;
  }
  void join_new(std::size_t first);
  void bundle();
  bool calibrate_sensor(const std::string& name);
  void calibrate_frames(const SensorCalibration& calibration);
  void move_frames(const std::map<int, Pose>& poses);
  void match_again();
  void track_again();
  void calibrate_sensor();
  void icp();
  void vary_calibration();
  void keep_start_if_better();
  void find_covariances();
  double scale_deviation() const;
  void find_scale();
  void finish();
  Trajectory trajectory(const std::map<int, Pose>& poses) const;
  void close(StageReport stage);
  // Compares poses with those before; true if they are worse.
  bool evaluate(StageReport& stage, const std::map<int, Pose>& before,
                const std::map<int, Pose>& after) const;
  std::optional<StageError> error_of(const std::map<int, Pose>& poses) const;

  const ScanSource& scan_;
  const RefinementOptions& options_;
  Progress& progress_;
  const FeatureCache& cache_;
  Trajectory truth_;
  Clock::time_point stage_begin_ = Clock::now();
  std::clock_t processor_begin_ = std::clock();
  RefinementResult result_;
  std::map<int, Pose> poses_;
  std::map<int, Pose> start_;  // poses of the start
  std::vector<std::vector<int>> start_parts_;
  std::string again_;  // added to the names of stages
  std::vector<std::vector<int>> parts_;
  std::vector<FrameFeatures> frames_;
  std::vector<FrameFeatures> stored_frames_;  // before an accepted calibration
  std::vector<BoardView> board_views_;
  std::vector<GraphLink> stored_;
  std::set<int> tracked_;  // nodes whose poses are by visual odometry
  std::vector<FeatureLink> links_;
  std::set<FramePair> tried_;
  KnownMatches known_matches_;  // for the calibration
  PoseGraphResult graph_;
  BlockSystem information_{0};
  std::vector<FramePair> surface_pairs_;  // that have moved the poses
  double surface_distance_m_ = 0.0;
  double deviation_scale_ = 1.0;  // IcpResult
  bool by_observations_ = false;  // whether the information is that of a bundle adjustment
  // Of each node, by calibrations that are as likely: independent, a standard deviation each.
  std::map<int, std::vector<Vector6d>> moves_;
};

// Of the graph's links, those that are not of features.
inline std::vector<GraphLinkResult> without_features(const std::vector<GraphLinkResult>& links,
                                                     std::size_t stored) {
  return {links.begin(), links.begin() + static_cast<std::ptrdiff_t>(stored)};
}

}  // namespace libmap
