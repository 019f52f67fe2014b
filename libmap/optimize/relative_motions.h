// Estimates velocities of the base from neighboring poses. Private to bundle_adjustment.
#pragma once

#include <map>
#include <vector>

#include "libmap/features/features.h"
#include "libmap/geometry/rigid_motion.h"
#include "libmap/optimize/pose_graph_optimization.h"

namespace libmap {

// Velocity in the base frame (m/s, rad/s). The default `deviation` is that of a hand-held camera:
// its velocity at a frame minus its mean velocity between two poses that are 1/3 s or more apart.
struct KnownMotion {
  Vector6d mean = Vector6d::Zero();
  Vector6d deviation = (Vector6d() << 0.15, 0.15, 0.15, 0.25, 0.25, 0.25).finished();
};

// Returns velocities by node, for each frame with a pose; zero without another pose within 3 s.
// Poses of different `components` are in different coordinate frames; if empty, all are in one.
std::map<int, KnownMotion> relative_motions(const std::vector<FrameFeatures>& frames,
                                            const std::map<int, Pose>& poses,
                                            const std::vector<GraphComponent>& components);

}  // namespace libmap
