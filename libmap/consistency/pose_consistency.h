// Checks that the depth images of a scan agree with given poses, to detect poses in a wrong format.
// If they disagree, finds a convention of poses or depth unit with which they agree.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/pose_graph.h"
#include "libmap/scan/scan_source.h"

namespace libmap {

// Agreement of depth in pairs of frames.
struct DepthAgreement {
  std::size_t measurements = 0;  // pixels of a frame whose surface the other frame also measured
  double contradicted = 0.0;  // fraction with a depth difference above 5 %; 1 without measurements
  double difference = 0.0;    // median relative depth difference; 1 without measurements
};

struct PoseConsistency {
  std::size_t pairs = 0;  // number of compared pairs of frames
  DepthAgreement given;   // agreement with the given poses
  // Agreement with the best other convention, and the name of this convention; both are empty if no
  // convention fits much better.
  DepthAgreement best{};
  std::string convention{};

  // Returns one sentence; without `convention`, empty if contradicted < 0.5 or measurements < 500.
  std::string warning() const;
};

// Returns pairs of indices in `poses`, ascending. Up to 24 evenly spaced poses are paired with the
// first of the next 59 poses that differs by more than 8 degrees or 0.1 m, if there is one.
std::vector<std::pair<std::size_t, std::size_t>> near_pairs_of(const Trajectory& poses);

// Compares the frames of near_pairs_of(world_from_base); unreadable frames are ignored. If 20 % of
// the measurements or more contradict the given poses, these conventions are tried:
//   - quaternions as w x y z
//   - poses of the base, the camera's optical frame, or a camera with y up; inverse poses
//   - positions in other axes than the rotations; depth unit 5 or 1000 times larger or smaller
PoseConsistency check_pose_consistency(const ScanSource& scan, const Trajectory& world_from_base);

}  // namespace libmap
