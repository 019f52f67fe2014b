#include "libmap/features/frame_calibration.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "libmap/features/features.h"
#include "libmap/geometry/rigid_motion.h"
#include "tests/libmap/refine/textured_scan.h"

namespace frame_calibration_test {

using graspmap_test::around;
using graspmap_test::boulders;
using graspmap_test::TexturedScan;
using libmap::Feature;
using libmap::FrameFeatures;
using libmap::Pose;
using libmap::Vector6d;

// 6 mm and 0.8 degrees.
Pose wrong_registration() {
  Vector6d step;
  step << 0.004, -0.003, 0.003, 0.008, -0.01, 0.005;
  return libmap::moved(Pose::Identity(), step);
}

FrameFeatures frame_of(const TexturedScan& scan) {
  return libmap::find_features(scan, {1}, graspmap_test::small_options().features).frames.front();
}

// The scene in closed form from the color camera, with depth from the stored registration.
double true_depth_m(const Feature& feature, const Pose& world_from_base,
                    const FrameFeatures& frame) {
  const Pose eye =
      world_from_base * frame.cameras.front().base_from_camera * wrong_registration().inverse();
  return boulders()(eye.translation(), eye.linear() * feature.ray.cast<double>().homogeneous());
}

// With the noise of two planes it would be 0.85.
TEST(RegisteredDepth, IsOfTheScenePlusTheNoiseOfOnePlane) {
  TexturedScan scan;
  scan.see(boulders(), around(20), Vector6d::Zero());
  const FrameFeatures frame = frame_of(scan);
  double squares = 0.0;
  double before = 0.0;
  std::size_t count = 0;
  for (const Feature& feature : frame.features) {
    const double truth = true_depth_m(feature, *scan.graph_.nodes[0].truth_from_base, frame);
    const auto found = libmap::registered_depth(frame, feature, wrong_registration());
    const auto stored = static_cast<double>(feature.depth_m);
    // At the edges of the boulders, planes mix both surfaces.
    if (!found.known || !(std::abs(stored - truth) < 0.05)) continue;
    squares += std::pow((stored + found.added_m - truth) / double{feature.depth_noise_m}, 2);
    before += std::pow((stored - truth) / double{feature.depth_noise_m}, 2);
    ++count;
  }
  ASSERT_GT(count, 200U);
  EXPECT_GT(std::sqrt(before / static_cast<double>(count)), 3.0);
  EXPECT_LT(std::sqrt(squares / static_cast<double>(count)), 0.77);
}

// Without measurements on the right, a feature at that edge keeps its stored depth, which is that
// of another point.
TEST(RegisteredDepth, IsUnknownWhereThereIsNoPlane) {
  TexturedScan scan;
  scan.see(boulders(), around(20), Vector6d::Zero());
  libmap::DepthImage& depth = scan.frames.at(1).depth;
  for (int y = 0; y < depth.height; ++y)
    for (int x = 128; x < depth.width; ++x) depth.at(x, y) = 0.0F;
  const FrameFeatures stored = frame_of(scan);
  FrameFeatures registered = stored;
  libmap::SensorCalibration calibration;
  calibration.color_from_depth = {wrong_registration()};
  libmap::calibrate(registered, calibration);
  std::size_t unknown = 0;
  for (std::size_t n = 0; n < stored.features.size(); ++n) {
    const Feature& feature = stored.features[n];
    const bool known = libmap::registered_depth(stored, feature, wrong_registration()).known;
    EXPECT_EQ(registered.features[n].depth_noise_m,
              known ? feature.depth_noise_m : libmap::unknown_depth_m);
    unknown += !known;
  }
  EXPECT_GT(unknown, 2U);
  EXPECT_LT(unknown, stored.features.size() / 4);
}

}  // namespace frame_calibration_test
