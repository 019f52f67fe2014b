// Focal lengths and principal points of a scan's cameras from the scan itself.
#pragma once

#include <cstddef>
#include <map>
#include <vector>

#include "libmap/refine/bundle_adjustment.h"
#include "libmap/refine/held_out.h"

namespace libmap {

struct IntrinsicsEstimate {
  std::size_t frames = 0;             // that it rests on
  BundleAdjustmentResult adjustment;  // of those frames, with the steps of the intrinsics
  HeldOutEvaluation held_out;         // of those frames: as they were, and adjusted with the steps
};

// A bundle adjustment with free intrinsics. Of a long scan they are estimated from the `max_frames`
// frames that links join most closely to the one with most links: more do not tell them better than
// is needed, and the time does not grow with the scan. Poses are those of an adjustment with fixed
// intrinsics; `links` join frames, `graph_links` are other links of the graph.
IntrinsicsEstimate estimate_intrinsics(const std::vector<FrameFeatures>& frames,
                                       const std::vector<FeatureLink>& links,
                                       const std::map<int, Pose>& map_from_base,
                                       const std::vector<GraphLinkResult>& graph_links,
                                       const std::vector<GraphComponent>& components,
                                       const BundleAdjustmentOptions& options,
                                       std::size_t max_frames = 80);

// The steps that undo others.
std::vector<IntrinsicsStep> reversed(const std::vector<IntrinsicsStep>& steps);

}  // namespace libmap
