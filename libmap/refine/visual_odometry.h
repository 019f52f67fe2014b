// RGB-D visual odometry: tracks each frame against the last key frame by features with depth. After
// a tracking loss, relocalizes against similar earlier frames.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/progress.h"
#include "libmap/refine/loop_closure.h"

namespace libmap {

struct VisualOdometryOptions {
  // A frame becomes the next key frame if it meets one of these conditions.
  int keyframe_inliers = 100;         // >= 0: fewer matches with the key frame
  double keyframe_distance_m = 0.3;   // > 0: larger distance from the key frame
  double keyframe_angle_deg = 20.0;   // > 0: larger rotation from the key frame
  int relocalization_candidates = 8;  // >= 0: similar frames with which a lost frame is matched
};
void bind(ParameterTable& table, VisualOdometryOptions& options);

// Sessions, and poses that are known before tracking.
struct TrackingStart {
  std::map<int, int> session;           // by node, 0 by default; tracking stops between sessions
  std::map<int, Pose> map_from_base;    // known poses by node, which are not changed
  std::vector<std::vector<int>> parts;  // disjoint groups of nodes, poses in one coordinate frame
  std::map<int, Pose> first;            // pose of a new part's first node; the identity by default

  int session_of(int node) const {
    const auto known = session.find(node);
    return known == session.end() ? 0 : known->second;
  }
};

// A node that could not be tracked.
struct TrackingLoss {
  int node = 0;
  int key_frame = 0;         // node of the key frame that did not match; 0: none
  std::string reason{};      // e.g. "too few matches"
  int relocalized_node = 0;  // relocalized node of the same part, maybe a later one; 0: none
  int relocalized_at = 0;    // node with which relocalized_node was matched; 0: none
};

// Returns text on the first five losses: node, reason, and the nodes of the relocalization.
std::string describe(const std::vector<TrackingLoss>& losses);

struct VisualOdometryResult {
  std::map<int, Pose> map_from_base;    // by node: all frames, and the known poses
  std::vector<std::vector<int>> parts;  // groups of nodes with poses in one coordinate frame
  // Links of tracked frames (LinkType::neighbor) and of relocalized frames (local_space_closure).
  std::vector<FeatureLink> links;
  std::vector<PoseLink> depth_links;  // links of frames tracked by depth only
  std::set<FramePair> tried_pairs;    // pairs of frames that need not be matched again
  std::vector<int> key_frames;        // nodes, ascending
  std::vector<TrackingLoss> losses;
  std::size_t relocalized = 0;  // number of relocalizations, of a frame alone or with its part
};

// Tracks frames in the order of the list. A frame that matches neither the key frame nor the last
// frame (verify_pairs) is tracked by depth (align_pair), from the pose that constant motion or a
// few matches (guess_motion) predict. If this fails too, the frame is lost. A lost frame is
// relocalized if its motions to two earlier frames agree. Otherwise, it begins a new part, which a
// later key frame may join to another part. Covariances of links are multiplied by the chi-square
// of the matches per degree of freedom. Throws Error if an option is out of range.
VisualOdometryResult track_frames(const std::vector<FrameFeatures>& frames,
                                  const TrackingStart& start,
                                  const LoopClosureDetectionOptions& matching,
                                  const VisualOdometryOptions& options, std::uint64_t seed,
                                  Progress& progress = no_progress());

// Recovers frames that visual odometry lost, for example due to motion blur, from depth.
// track_frames calls it last. A frame of a part of up to four frames is aligned by depth
// (align_pair) with the nearest frames of larger parts before and after it. The initial pose is
// from constant motion, interpolated between both sides or extrapolated from one side, else from a
// few matches (guess_motion). Alignments with both sides must agree. In `result`, the frame's part
// is then joined to the larger parts, and the links are added to depth_links.
void place_lost_frames(const std::vector<FrameFeatures>& frames, const TrackingStart& start,
                       const LoopClosureDetectionOptions& matching, std::uint64_t seed,
                       VisualOdometryResult& result);

// Normalized estimation error squared (Bar-Shalom et al. 2001) of links against true poses. Links
// without true poses at both ends are ignored.
struct LinkConsistency {
  std::size_t links = 0;  // number of evaluated links
  // Mean of e^T I e / 6 (error e, information matrix I); near 1 if the covariances are correct.
  double squared_error_per_freedom = 0.0;
};
LinkConsistency link_consistency(const std::vector<FeatureLink>& links, const Trajectory& truth);

}  // namespace libmap
