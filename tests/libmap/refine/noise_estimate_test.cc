#include "libmap/refine/noise_estimate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "libmap/camera/sensor_model.h"
#include "tests/libmap/refine/textured_scan.h"
#include "tests/support/test_support.h"

namespace noise_estimate_test {

using libmap::DepthNoise;
using libmap::SurfaceResidual;

// Residuals of a camera with the noise `truth`, normalized by `assumed`; 10 % are outliers.
std::vector<SurfaceResidual> residuals_of(const DepthNoise& truth, const DepthNoise& assumed,
                                          int count = 20000) {
  std::vector<SurfaceResidual> residuals;
  std::mt19937_64& engine = graspmap_test::random_engine();
  std::normal_distribution<double> normal;
  for (int n = 0; n < count; ++n) {
    const double range_m = graspmap_test::uniform(0.6, 4.0);
    const double fraction = 1.0 / 6.0;  // a plane averages pixels
    const double distance_m = fraction * truth.axial_at(range_m) * normal(engine);
    residuals.push_back({n % 10 == 0 ? 5.0 * distance_m : distance_m,
                         fraction * assumed.axial_at(range_m), range_m});
    residuals.push_back({.distance_m = std::numeric_limits<double>::quiet_NaN()});
  }
  return residuals;
}

TEST(NoiseEstimate, FindsNoiseThatGrowsWithTheSquareOfTheRange) {
  const DepthNoise stereo{0.001, 0.0, 0.004, 0.8};
  const auto found = libmap::estimate_noise(residuals_of(stereo, {}), {});
  ASSERT_TRUE(found);
  for (const double range_m : {0.8, 1.5, 2.5, 3.8})
    EXPECT_NEAR(found->noise.axial_at(range_m) / stereo.axial_at(range_m), 1.1, 0.15) << range_m;
  EXPECT_GT(found->noise.axial_of_square, 0.003);
  EXPECT_GT(found->largest_ratio, 2.0);
  EXPECT_EQ(found->residuals, 20000U);
}

TEST(NoiseEstimate, AgreesWithTheAssumedNoiseIfThatIsRight) {
  const auto found = libmap::estimate_noise(residuals_of({}, {}), {});
  ASSERT_TRUE(found);
  EXPECT_LT(found->largest_ratio, 1.3);
  EXPECT_GE(found->noise.axial_of_range, 0.0);
  EXPECT_GE(found->noise.axial_of_square, 0.0);
}

TEST(NoiseEstimate, NeedsResiduals) {
  EXPECT_FALSE(libmap::estimate_noise(residuals_of({}, {}, 500), {}));
}

graspmap_test::MemoryScan boulders_with(const graspmap_test::DepthNoiseModel& noise, int frames) {
  graspmap_test::MemoryScan scan;
  for (int n = 0; n < frames; ++n)
    scan.see(graspmap_test::boulders(), graspmap_test::around(12.0 * n),
             graspmap_test::textured_camera(), noise, graspmap_test::random_engine());
  return scan;
}

// Held-out depth of near frames that are aligned by the rest of their depth, so that wrong poses do
// not look like noise.
TEST(ScanNoise, IsEstimatedIfItDiffersFromTheAssumedNoise) {
  const libmap::DepthPlaneOptions planes;
  for (const double pose_error_m : {0.0, 0.01}) {
    const auto chosen_for = [&](const graspmap_test::DepthNoiseModel& noise) {
      const auto scan = boulders_with(noise, 20);
      libmap::Trajectory poses = scan.poses;
      for (libmap::TrajectoryPose& pose : poses)
        pose.world_from_base.translation() += pose_error_m * Eigen::Vector3d::Random();
      return libmap::choose_noise(scan, poses, "auto", planes);
    };
    const libmap::ScanNoise same = chosen_for({0.002, 0.005});
    EXPECT_FALSE(same.is_estimated) << same.sentence;
    EXPECT_EQ(same.noise, planes.noise);
    const libmap::ScanNoise low = chosen_for({0.0005, 0.0005});
    EXPECT_TRUE(low.is_estimated) << low.sentence;
    EXPECT_LT(low.noise.axial_at(1.5), 0.7 * planes.noise.axial_at(1.5)) << low.sentence;
    EXPECT_GT(low.noise.axial_at(1.5), 0.0008);
    EXPECT_EQ(low.noise.lateral_px, planes.noise.lateral_px);
  }
}

TEST(ScanNoise, IsKeptIfItIsGivenOrThereIsTooLittleDepth) {
  const auto scan = boulders_with({0.0005, 0.0005}, 12);
  libmap::DepthPlaneOptions planes;
  EXPECT_EQ(libmap::choose_noise(scan, scan.poses, "kinect-v1", planes).noise, planes.noise);
  planes.noise.axial_of_square = 0.001;
  const libmap::ScanNoise given = libmap::choose_noise(scan, scan.poses, "auto", planes);
  EXPECT_FALSE(given.is_estimated);
  EXPECT_EQ(given.noise, planes.noise);
  const auto single = boulders_with({0.0005, 0.0005}, 1);
  EXPECT_FALSE(libmap::choose_noise(single, single.poses, "auto", {}).is_estimated);
  EXPECT_FALSE(libmap::choose_noise(single, {}, "auto", {}).is_estimated);
}

TEST(SensorModel, ShippedSensorsAreReadAndUnknownOnesAreNamed) {
  for (const char* name :
       {"kinect-v1", "kinect-v2", "realsense-d435", "l515", "azure-kinect", "ipad-lidar"}) {
    const libmap::SensorModel model = libmap::read_sensor_model(name);
    EXPECT_GT(model.far_m, model.near_m) << name;
    EXPECT_LE(model.rolling_shutter_s, model.frame_time_s) << name;
    EXPECT_LT(model.frame_time_s, 0.05) << name;
  }
  EXPECT_GT(libmap::read_sensor_model("kinect-v1").noise_of_square, 0.0);
  EXPECT_TRUE(graspmap_test::is_error(
      graspmap_test::error_of([] { libmap::read_sensor_model("kinect-v3"); }),
      {.field = "sensor", .value = "kinect-v3"}));
}

TEST(SensorModel, EarlierKeysAreRead) {
  const std::string path = (graspmap_test::scratch_folder() / "earlier.yaml").string();
  graspmap_test::write_text(
      path, "noise_m: 0.001\nfar_m: 4\nrefine.max_bend_m: 0.02\nrefine.bend_of_range: 0.004\n");
  const libmap::SensorModel model = libmap::read_sensor_model(path);
  EXPECT_EQ(model.max_depth_correction_m, 0.02);
  EXPECT_EQ(model.max_depth_correction_of_range, 0.004);
}

}  // namespace noise_estimate_test
