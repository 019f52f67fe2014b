#include "libgtd/score/scoring.h"

#include <algorithm>

namespace libgtd {

namespace {

double lowered(double percent, std::uint32_t ssv, int threshold) {
  if (ssv > static_cast<std::uint32_t>(threshold) || percent < 60.0) return percent;
  return percent - (static_cast<double>(threshold) - ssv) / threshold * 100.0;
}

}  // namespace

double score_percent(const VoxelCounts& counts, Method method, int solid_voxel_threshold) {
  if (counts.ssv == 0) return 0.0;
  switch (method) {
    case Method::thesis:
    case Method::envelope: {
      const float share = static_cast<float>(counts.gsv) / static_cast<float>(counts.ssv);
      const auto percent = static_cast<float>(static_cast<double>(share) * 100.0);
      return lowered(static_cast<double>(percent), counts.ssv, solid_voxel_threshold);
    }
    case Method::climblab:
      return 100.0 * counts.gsv / counts.ssv;
    case Method::corrected:
    case Method::calibrated:
      break;
  }
  return std::max(0.0, lowered(100.0 * counts.gsv / counts.ssv, counts.ssv, solid_voxel_threshold));
}

bool meets_threshold(const VoxelCounts& counts, double score, Method method,
                     int solid_voxel_threshold, double graspability_threshold) {
  if (method == Method::climblab)
    return counts.gsv == counts.ssv &&
           counts.ssv > static_cast<std::uint32_t>(solid_voxel_threshold);
  return score >= graspability_threshold;
}

}  // namespace libgtd
