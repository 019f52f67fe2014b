// How a base moves at its poses, by those before and after. Inner part of bundle_adjustment.
#pragma once

#include <map>
#include <vector>

#include "libmap/features/features.h"
#include "libmap/geometry/rigid_motion.h"
#include "libmap/optimize/pose_graph_optimization.h"

namespace libmap {

// In the base's own frame (m/s, rad/s). The deviation is that of a hand's motion from the one
// between poses a third of a second or more apart.
struct KnownMotion {
  Vector6d mean = Vector6d::Zero();
  Vector6d deviation = (Vector6d() << 0.15, 0.15, 0.15, 0.25, 0.25, 0.25).finished();
};

// Of the frames' nodes with a pose. Poses of different components are in different frames; without
// components, all are in one.
std::map<int, KnownMotion> relative_motions(const std::vector<FrameFeatures>& frames,
                                            const std::map<int, Pose>& poses,
                                            const std::vector<GraphComponent>& components);

}  // namespace libmap
