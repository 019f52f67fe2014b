#include "libmap/refine/sensor_calibration.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "tests/libmap/optimize/bundle_scenes.h"

namespace sensor_calibration_test {

using graspmap_test::random_points;
using graspmap_test::see_points;
using graspmap_test::Way;
using graspmap_test::way_with_rows;
using libmap::FrameFeatures;
using libmap::Pose;

// A calibration uses a part of a long scan. The other frames have motions too; a frame without
// links has that of its neighbors.
TEST(SensorCalibration, AllFramesHaveMotions) {
  constexpr int count = 90;
  constexpr int alone = 50;
  const auto points = random_points(60);
  Way way = way_with_rows(points, 0.06, count);
  std::vector<libmap::FeatureLink> links;
  for (std::size_t n = 0; n + 1 < way.frames.size(); ++n) {
    if (n + 1 == alone || n + 2 == alone) continue;
    libmap::FeatureLink link;
    link.frames = {n, n + 1};
    link.link = {way.frames[n].node, way.frames[n + 1].node, libmap::LinkType::neighbor,
                 way.truth.at(way.frames[n].node).inverse() * way.truth.at(way.frames[n + 1].node),
                 libmap::Matrix6d::Identity()};
    link.matches = graspmap_test::same_numbers(points.size());
    links.push_back(link);
  }
  std::erase(way.components[0].nodes, alone);
  way.components.push_back({{alone}, alone});
  way.truth.at(alone) = Pose::Identity();  // anywhere
  libmap::SensorCalibration calibration;
  calibration.timing = {{0.0, 0.06}};
  for (const bool fixes_poses : {false, true}) {
    libmap::estimate_motions({way.frames, links, way.truth, {}, way.components, {}}, fixes_poses,
                             calibration);
    ASSERT_EQ(calibration.motion.size(), way.frames.size());
    for (const auto& [node, motion] : calibration.motion)
      EXPECT_NEAR(motion.y(), 0.6 * std::cos(1.5 * 0.3 * node), node == alone ? 0.1 : 0.03) << node;
  }
}

// Links of each frame to the next three, one match in ten held out.
std::vector<libmap::FeatureLink> links_of(const Way& way, std::size_t points) {
  std::vector<libmap::FeatureLink> links;
  for (std::size_t a = 0; a < way.frames.size(); ++a)
    for (std::size_t b = a + 1; b < std::min(way.frames.size(), a + 4); ++b) {
      libmap::FeatureLink link;
      link.frames = {a, b};
      link.matches = graspmap_test::same_numbers(points);
      for (std::size_t n = 0; n < link.matches.size(); n += 10)
        link.held_out.push_back(link.matches[n]);
      links.push_back(link);
    }
  return links;
}

// Rows of 60 ms are longer than a frame.
TEST(SensorCalibration, AModelBeyondItsBoundIsNotAccepted) {
  const auto points = random_points(200);
  const Way way = way_with_rows(points, 0.06, 12);
  const auto links = links_of(way, points.size());
  libmap::BundleAdjustmentOptions options;
  options.max_iterations = 100;
  const libmap::CalibrationChoice choice{.parts = {.timing = true}, .start = {}};
  for (const double frame_time_s : {0.033, 0.1}) {
    options.bounds.frame_time_s = frame_time_s;
    const libmap::CalibrationEstimate estimate = libmap::estimate_calibration(
        {way.frames, links, way.truth, {}, way.components, options}, choice);
    if (frame_time_s > 0.06) {
      EXPECT_TRUE(estimate.impossible.empty());
    } else {
      EXPECT_TRUE(estimate.calibration.timing.empty());
      ASSERT_FALSE(estimate.impossible.empty());
      EXPECT_EQ(estimate.impossible.front().first, "timing");
    }
  }
}

// Timing would absorb the error of a coarse registration.
TEST(SensorCalibration, ACoarseRegistrationIsPartOfEachModel) {
  const auto points = random_points(200);
  const Way way = way_with_rows(points, 0.02, 12);
  const auto links = links_of(way, points.size());
  for (const bool is_coarse : {false, true}) {
    const libmap::CalibrationEstimate estimate =
        libmap::estimate_calibration({way.frames, links, way.truth, {}, way.components, {}},
                                     {.keeps_registration = is_coarse, .start = {}});
    std::set<std::string> models;
    for (const auto& [model, change] : estimate.evaluated_models) models.insert(model);
    EXPECT_EQ(models.contains("timing"), !is_coarse);
    EXPECT_EQ(models.contains("intrinsics"), !is_coarse);
    EXPECT_EQ(models.contains("registration_timing"), is_coarse);
    EXPECT_EQ(models.contains("intrinsics_registration"), is_coarse);
  }
}

// A base that moves along x towards a wall: late depth is smaller by the distance moved.
TEST(SensorCalibration, LateDepthIsMovedBack) {
  libmap::SensorCalibration calibration;
  calibration.timing = {{0.05, 0.0}};
  calibration.motion[1] << 0.4, 0.0, 0.0, 0.0, 0.0, 0.0;
  FrameFeatures frame = see_points(1, Pose::Identity(), {{1.5, 0.1, 0.1}});
  const Pose pose = libmap::color_from_depth_of(frame, frame.features[0], calibration);
  // Forward is z in the camera: the depth's camera was 2 cm ahead.
  EXPECT_LT((pose.translation() - Eigen::Vector3d(0.0, 0.0, 0.02)).norm(), 1e-12);
  calibration.timing[0].rolling_shutter_s = 0.05;
  const double row = libmap::row_fraction(frame.features[0], frame.cameras[0]);
  EXPECT_NEAR(libmap::color_from_depth_of(frame, frame.features[0], calibration).translation().z(),
              0.4 * (0.05 - 0.05 * row), 1e-12);
  frame.depth_stamp_offset_s = -0.01;
  EXPECT_NEAR(libmap::color_from_depth_of(frame, frame.features[0], calibration).translation().z(),
              0.4 * (0.04 - 0.05 * row), 1e-12)
      << "stamps of depth that is earlier by 10 ms";
}

}  // namespace sensor_calibration_test
