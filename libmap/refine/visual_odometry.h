// RGB-D visual odometry: the way of a camera from the features of its frames and the depth behind
// them, each frame against a key frame before it. Where the way is lost it is taken up again at
// earlier frames that look alike.
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
  // A frame becomes the next key frame when fewer matches than this bind it to the last one ...
  int keyframe_inliers = 100;        // >= 0
  double keyframe_distance_m = 0.3;  // > 0: ... or it has moved so far from it
  double keyframe_angle_deg = 20.0;  // > 0: ... or turned so far
  // Earlier frames that a lost one is compared with: those that look most like it.
  int relocalization_candidates = 8;  // >= 0
};
void bind(ParameterTable& table, VisualOdometryOptions& options);

// What is known before.
struct TrackingStart {
  std::map<int, int> session;           // by node; 0 where none stands. Ways end with their session
  std::map<int, Pose> map_from_base;    // nodes that have a pose already: they keep it
  std::vector<std::vector<int>> parts;  // ... each in one part: its poses are in one frame
  std::map<int, Pose> first;  // where a part is put whose first node this is; else at the identity

  int session_of(int node) const {
    const auto known = session.find(node);
    return known == session.end() ? 0 : known->second;
  }
};

// A node that could not be tracked.
struct TrackingLoss {
  int node = 0;
  int key_frame = 0;  // node that it was compared with; 0: none
  std::string reason{};
  // Where it was found again, or a later node of the part that it began.
  int found_node = 0;  // 0: not
  int found_at = 0;    // the earlier node that this one was found at
};

// The first of them in words: node, reason, where it was found again.
std::string describe(const std::vector<TrackingLoss>& losses);

struct VisualOdometryResult {
  std::map<int, Pose> map_from_base;    // of each frame, and those known before
  std::vector<std::vector<int>> parts;  // nodes in one frame; a frame bound to none is its own part
  // Of tracked frames (LinkType::neighbor), and of frames found again (local_space_closure).
  std::vector<FeatureLink> links;
  std::vector<PoseLink> depth_links;  // of frames that were tracked by depth alone
  std::set<FramePair> tried;          // pairs that need not be tried again
  std::vector<int> key_frames;
  std::vector<TrackingLoss> losses;
  std::size_t relocalized = 0;  // parts joined to others, and frames found again
};

// Frames in the order of the list. A frame that neither its key frame nor the last frame explains
// (verify_pairs) is tracked by depth alone (align_pair) from where a steady motion leads, or few
// matches (guess_motion). If that fails too, it is lost; it is found again if the motions to two
// earlier frames agree, else it begins a part. A later key frame of the part may still join it to
// another. Motions are those of estimate_relative_pose, their covariances scaled by the residuals
// of each. The same for any number of threads. Throws Error: options out of their ranges.
VisualOdometryResult track_frames(const std::vector<FrameFeatures>& frames,
                                  const TrackingStart& start,
                                  const LoopClosureDetectionOptions& matching,
                                  const VisualOdometryOptions& options, std::uint64_t seed,
                                  Progress& progress = no_progress());

// Recovers frames that visual odometry lost, for example to motion blur, from depth; track_frames
// does so at its end. Frames of parts of one to four are aligned by depth (align_pair) with the
// nearest frames of larger parts before and after them, from where a steady motion between these
// leads, or on from one side where the other has none, else from where a few matches lead
// (guess_motion). Alignments with both sides must agree. The frame's part joins that one in
// `result`, with the links in depth_links, which may help the next. `start` has the sessions, and
// the nodes whose poses stay.
void place_lost_frames(const std::vector<FrameFeatures>& frames, const TrackingStart& start,
                       const LoopClosureDetectionOptions& matching, std::uint64_t seed,
                       VisualOdometryResult& result);

// Normalized estimation error squared (Bar-Shalom et al. 2001) of links against true poses, by
// freedom: mean of e^T information e / 6. Near 1 where the stated covariances are honest. Links
// whose ends have no true pose are left out.
struct LinkConsistency {
  std::size_t links = 0;
  double squared_error_per_freedom = 0.0;
};
LinkConsistency link_consistency(const std::vector<FeatureLink>& links, const Trajectory& truth);

}  // namespace libmap
