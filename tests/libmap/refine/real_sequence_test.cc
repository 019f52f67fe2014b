// Forty consecutive frames of fr1/rpy of the TUM RGB-D benchmark: a Kinect v1 with a rolling
// shutter, carried by hand, with the truth of motion capture.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "libmap/consistency/edge_agreement.h"
#include "libmap/refine/refinement.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace real_sequence_test {

// Consecutive nodes of a scan.
class Excerpt : public ScanSource {
 public:
  Excerpt(std::unique_ptr<ScanSource> scan, std::size_t first, std::size_t count)
      : scan_(std::move(scan)), graph_(scan_->graph()) {
    const auto begin = graph_.nodes.begin() + static_cast<std::ptrdiff_t>(first);
    graph_.nodes = std::vector<GraphNode>(begin, begin + static_cast<std::ptrdiff_t>(count));
  }

  const std::filesystem::path& path() const override { return scan_->path(); }
  const PoseGraph& graph() const override { return graph_; }
  RgbdFrame read_frame(int node, FrameParts parts) const override {
    return scan_->read_frame(node, parts);
  }

 private:
  std::unique_ptr<ScanSource> scan_;
  PoseGraph graph_;
};

Excerpt sequence() {
  return {open_scan(graspmap_test::data_folder() / "sequences" / "tum_fr1_rpy"), 150, 40};
}

// As a Kinect v1 may be: one image takes 33 ms.
void expect_possible(const SensorCalibration& calibration) {
  for (const CameraTiming& timing : calibration.timing) {
    EXPECT_LT(std::abs(timing.depth_delay_s), 0.033);
    EXPECT_GE(timing.rolling_shutter_s, 0.0);
    EXPECT_LT(timing.rolling_shutter_s, 0.033);
  }
  for (const DepthCorrection& depth : calibration.depth)
    for (double z = 0.5; z < 5.0; z += 0.1)
      for (const double radius2 : {0.0, 0.5, 1.0})
        EXPECT_LT(std::abs(depth.bend(z, radius2)), 0.01 + 0.02 * z) << z;
  for (const IntrinsicsStep& step : calibration.intrinsics)
    EXPECT_LT(std::abs(step.fx_relative), 0.08);
  for (const Pose& pose : calibration.color_from_depth) EXPECT_LT(pose.translation().norm(), 0.08);
}

TEST(RealSequence, CalibrationIsPhysicallyPossible) {
  GRASPMAP_REQUIRE_DATA();
  const RefinementResult result = refine_poses(sequence());
  EXPECT_EQ(result.poses.size(), 40U);
  expect_possible(result.calibration);
  // 24 +- 2 ms and 20 +- 3 ms before color; the whole sequence has 25 and 23 ms.
  ASSERT_EQ(result.calibration.timing.size(), 1U);
  EXPECT_NEAR(result.calibration.timing.front().rolling_shutter_s, 0.024, 0.005);
  EXPECT_NEAR(result.calibration.timing.front().depth_delay_s, -0.021, 0.007);
  EXPECT_LT(result.stages.back().error->absolute.rmse_m, 0.010);
}

TEST(RealSequence, DepthIsRegistered) {
  GRASPMAP_REQUIRE_DATA();
  const EdgeAgreement found = check_edge_agreement(sequence());
  EXPECT_EQ(found.frames, 24U);
  EXPECT_FALSE(found.is_displaced());
}

}  // namespace real_sequence_test
}  // namespace libmap
