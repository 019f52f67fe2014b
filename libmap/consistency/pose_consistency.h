// Checks that the depth images of a scan agree with given poses, to detect poses in a wrong format.
// If they disagree, finds a convention of poses or depth with which they agree.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "libmap/core/pose_graph.h"
#include "libmap/scan/scan_source.h"

namespace libmap {

// Agreement of depth between pairs of frames.
struct DepthAgreement {
  std::size_t measurements = 0;  // measurements common to both frames of a pair
  double contradicted = 0.0;     // share with a depth difference above 5 %; 1 without any
  double difference = 0.0;       // median relative depth difference; 1 without any
};

struct PoseConsistency {
  std::size_t pairs = 0;  // number of compared pairs of frames
  DepthAgreement given;
  // Agreement with the best other convention, and the convention's name; both are empty unless this
  // convention fits much better.
  DepthAgreement best{};
  std::string convention{};

  // Returns one sentence; empty if the frames agree or have too few common measurements.
  std::string warning() const;
};

// Returns pairs of indices: up to 24 poses, each with the next of 59 poses that differs by 8
// degrees or 0.1 m.
std::vector<std::pair<std::size_t, std::size_t>> near_pairs_of(const Trajectory& poses);

// Compares the frames of near_pairs_of(world_from_base). If they disagree, these conventions are
// tried: quaternions as w x y z; poses of the base, the camera's optical frame or a camera with y
// up; inverse poses; positions in other axes than the rotations; depth in a unit 5 or 1000 times
// larger or smaller. Frames that cannot be read are ignored.
PoseConsistency check_pose_consistency(const ScanSource& scan, const Trajectory& world_from_base);

}  // namespace libmap
