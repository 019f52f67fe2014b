// The motion between two frames by their depth images alone.
#pragma once

#include <optional>

#include "libmap/core/pose_graph.h"
#include "libmap/refine/features.h"

namespace libmap {

// How frame `b` moved from frame `a` by their depth alone: `a_from_b` is a guess, to which
// directions that the surfaces do not bind are held. Nothing where the surfaces do not come to lie
// on each other.
std::optional<PoseLink> align_pair(const FrameFeatures& a, const FrameFeatures& b,
                                   const Pose& a_from_b);

}  // namespace libmap
