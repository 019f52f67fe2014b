// Whether the depth images of a scan agree by given poses; if not, the usual other convention of
// poses or depth by which they do.
#pragma once

#include <cstddef>
#include <string>

#include "libmap/core/pose_graph.h"
#include "libmap/scan/scan_source.h"

namespace libmap {

// How well measurements of pairs of frames agree.
struct DepthAgreement {
  std::size_t measurements = 0;  // that two frames of a pair have in common
  double contradicted = 0.0;     // share whose depths differ by more than 5 %; 1 without any
  double difference = 0.0;       // median, in depths; 1 without any
};

struct PoseConsistency {
  std::size_t pairs = 0;
  DepthAgreement given;
  // By the convention that fits best, if one is far better; empty otherwise.
  DepthAgreement best{};
  std::string convention{};

  // One sentence, or nothing if the frames agree or have too little in common.
  std::string warning() const;
};

// Compares up to 24 frames with the next one that has moved by 8 degrees or 0.1 m. Conventions that
// are tried: quaternions as w x y z, poses of the base, the camera's optical frame or a camera with
// y up, inverse poses, positions in other axes than the rotations, and depth in a unit 5 or 1000
// times larger or smaller. Frames that cannot be read are left out.
PoseConsistency check_pose_consistency(const ScanSource& scan, const Trajectory& world_from_base);

}  // namespace libmap
