// Estimates velocities of the base from neighboring poses. Private to bundle_adjustment.
#pragma once

#include <map>
#include <vector>

#include "libmap/features/features.h"
#include "libmap/geometry/rigid_motion.h"
#include "libmap/optimize/pose_graph_optimization.h"

namespace libmap {

// Velocity in the base frame (m/s, rad/s). The default standard deviation describes the deviation
// of a hand-held camera's velocity from the mean between poses a third of a second or more apart.
struct KnownMotion {
  Vector6d mean = Vector6d::Zero();
  Vector6d deviation = (Vector6d() << 0.15, 0.15, 0.15, 0.25, 0.25, 0.25).finished();
};

// Returns the velocity by node, for each frame with a pose. Poses of different components are in
// different coordinate frames; if `components` is empty, all poses are in one coordinate frame.
std::map<int, KnownMotion> relative_motions(const std::vector<FrameFeatures>& frames,
                                            const std::map<int, Pose>& poses,
                                            const std::vector<GraphComponent>& components);

}  // namespace libmap
