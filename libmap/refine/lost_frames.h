// Frames that visual odometry has lost, as by blur: their depth is as good as ever, and afterwards
// the way is known on both sides of them. Inner part of visual_odometry.
#pragma once

#include <map>
#include <vector>

#include "libmap/refine/features.h"
#include "libmap/refine/visual_odometry.h"

namespace libmap {

// Frames of parts of one to four are aligned by depth (align_pair) with the nearest frames of
// larger parts before and after them, from where a steady motion between these leads, or on from
// one side where the other has none, else from where a few matches lead (guess_motion). Alignments
// with both sides must agree. The frame's part joins that one in `result`, with the links in
// depth_links, which may help the next. `start` has the sessions, and the nodes whose poses stay.
void place_lost_frames(const std::vector<FrameFeatures>& frames, const TrackingStart& start,
                       const LoopClosureDetectionOptions& matching, std::uint64_t seed,
                       VisualOdometryResult& result);

}  // namespace libmap
