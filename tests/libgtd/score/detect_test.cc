#include "libgtd/detect.h"

#include <gtest/gtest.h>

#include <limits>

#include "libgtd/tile_detection.h"
#include "tests/libgtd/score/score_test_support.h"

namespace libgtd {
namespace detect_test {

using graspmap_test::bumpy_cloud;
using graspmap_test::error_of;
using graspmap_test::gripper_named;
using graspmap_test::is_error;
using libgtd::Orientation;
using libmap::PointCloud;

DetectionOptions options_for(Method method) {
  DetectionOptions options;
  options.scenario.method = method;
  options.gripper = gripper_named("scar-e");
  return options;
}

class Detection : public testing::TestWithParam<Method> {};

INSTANTIATE_TEST_SUITE_P(All, Detection,
                         testing::Values(Method::thesis, Method::envelope, Method::climblab,
                                         Method::corrected, Method::calibrated),
                         [](const auto& given) { return name_of(given.param); });

TEST_P(Detection, TileSizeChangesNothing) {
  const PointCloud cloud = bumpy_cloud(0.7, 0.009);
  DetectionOptions options = options_for(GetParam());
  options.scenario.interpolation = true;
  const auto fields_with = [&](double tile_size_m) {
    options.scenario.tile_size_m = tile_size_m;
    return to_cloud(detect(cloud, options).map, MapFrame::input).fields;
  };
  const auto expected = fields_with(10.0);
  EXPECT_EQ(fields_with(0.05), expected);
  EXPECT_EQ(fields_with(0.31), expected);
}

TEST_P(Detection, MapReturnsIntoTheInputFrame) {
  const libmap::Pose tilted = libmap::make_pose_from_rpy({0.3, 0.2, 1.5}, {20.0, -10.0, 40.0});
  const PointCloud cloud = libmap::transform_cloud(bumpy_cloud(0.6, 0.01), tilted);
  DetectionOptions options = options_for(GetParam());
  options.up = tilted.linear().col(2);
  const auto result = detect(cloud, options);
  const PointCloud map = to_cloud(result.map, MapFrame::input);
  ASSERT_FALSE(map.empty());
  // The center of each voxel is within a voxel diagonal of a point of the cloud; the downsampling
  // and the second lattice of `thesis` shift it by up to another voxel.
  const bool downsamples = GetParam() == Method::thesis || GetParam() == Method::envelope;
  const double reach = downsamples ? 0.03 : 0.00867;
  for (std::size_t n = 0; n < map.size(); n += 7) {
    double nearest = 1.0;
    for (const Eigen::Vector3d& point : cloud.positions)
      nearest = std::min(nearest, (point - map.positions[n]).norm());
    EXPECT_LE(nearest, reach);
  }
}

TEST(DetectionErrors, NameTheField) {
  const PointCloud cloud = bumpy_cloud(0.4, 0.01);
  DetectionOptions options = options_for(Method::corrected);
  EXPECT_TRUE(
      is_error(error_of([&] { detect(PointCloud(), options); }), {.field = "points of the cloud"}));
  options.scenario.voxel_size_m = 10.0;
  EXPECT_EQ(error_of([&] { detect(cloud, options); }).context().field, "voxel_size_m");
  options.scenario.voxel_size_m = 0.0;
  EXPECT_EQ(error_of([&] { detect(cloud, options); }).context().field, "voxel_size_m");
  options = options_for(Method::corrected);
  options.scenario.tile_size_m = -1.0;
  EXPECT_EQ(error_of([&] { detect(cloud, options); }).context().field, "tile_size_m");
  options = options_for(Method::corrected);
  options.gripper->closing_angle_deg = options.gripper->opening_angle_deg;
  EXPECT_EQ(error_of([&] { detect(cloud, options); }).context().field, "closing_angle_deg");
}

TEST(Detection, StrayPointFarAboveCostsNoMemory) {
  PointCloud cloud = bumpy_cloud(0.3, 0.002);
  DetectionOptions options = options_for(Method::corrected);
  options.plane = PlaneSource::none;
  options.scenario.voxel_size_m = 0.002;
  options.scenario.curvature_radius_m = 0.0;
  const auto alone = detect(cloud, options).map.voxels;
  cloud.positions.emplace_back(0.0, 0.0, 900.0);
  const auto with_stray = detect(cloud, options).map.voxels;
  EXPECT_EQ(with_stray.size(), alone.size() + 1);
}

TEST(Detection, NormalsWithRandomSidesAreNoOutside) {
  PointCloud cloud = bumpy_cloud(0.5, 0.009);
  DetectionOptions options = options_for(Method::corrected);
  options.scenario.orientation = Orientation::surface;
  const auto without = detect(cloud, options);
  for (std::size_t n = 0; n < cloud.size(); ++n)
    cloud.normals.emplace_back(0, 0, graspmap_test::uniform(0, 1) < 0.5 ? -1 : 1);
  const auto with = detect(cloud, options);
  EXPECT_EQ(with.plane->up_source, libgtd::UpSource::frame_z);
  EXPECT_EQ(with.map.terrain_from_input.matrix(), without.map.terrain_from_input.matrix());
  ASSERT_EQ(with.map.voxels.size(), without.map.voxels.size());
  for (std::size_t n = 0; n < with.map.voxels.size(); ++n)
    EXPECT_EQ(with.map.voxels[n].score, without.map.voxels[n].score);
}

TEST(Detection, LoneVoxelsAreCountedAndRefused) {
  DetectionOptions options = options_for(Method::corrected);
  options.scenario.voxel_size_m = 0.01;
  EXPECT_EQ(detect(bumpy_cloud(0.5, 0.008), options).isolated_voxels, 0U);
  const libmap::Error error = error_of([&] { detect(bumpy_cloud(0.5, 0.03), options); });
  EXPECT_EQ(error.context().field, "share of voxels without a neighbor");
}

TEST(DetectionErrors, PointsInOnePlaceOrOnALineAreNoTerrain) {
  for (const PlaneSource plane : {PlaneSource::fit, PlaneSource::none}) {
    DetectionOptions options = options_for(Method::corrected);
    options.plane = plane;
    PointCloud cloud;
    cloud.positions = {{0.3, 0.2, 0.1}};
    EXPECT_TRUE(
        is_error(error_of([&] { detect(cloud, options); }), {.field = "points", .value = "1"}));
    for (int n = 0; n < 50; ++n) cloud.positions.emplace_back(0.3 + 0.01 * n, 0.2, 0.1);
    EXPECT_TRUE(is_error(error_of([&] { detect(cloud, options); }), {.field = "points"}));
  }
}

TEST(DetectionErrors, RadiiOfTooManyVoxels) {
  const GripperMask mask = make_gripper_mask(gripper_named("scar-e"), {});
  Scenario scenario;
  scenario.curvature_radius_m = 1e7;
  libmap::Error error = error_of([&] { halo_voxels(mask, scenario); });
  EXPECT_TRUE(is_error(error, {.field = "curvature_radius_m", .value = "1e+07"}));
  EXPECT_EQ(error.context().field, "curvature_radius_m");
  EXPECT_EQ(error.context().value, "1e+07");
  scenario = {};
  scenario.orientation = Orientation::surface;
  scenario.normal_radius_m = 1e7;
  error = error_of([&] { halo_voxels(mask, scenario); });
  EXPECT_EQ(error.context().field, "normal_radius_m");
}

TEST(Detection, WhatLiesBelowTheZeroPlaneIsScoredButNoTarget) {
  DetectionOptions options = options_for(Method::corrected);
  options.plane = PlaneSource::none;
  options.scenario.curvature_radius_m = 0.0;
  options.scenario.graspability_threshold = 0.0;
  options.scenario.zero_plane_m = 0.01;
  const auto result = detect(bumpy_cloud(0.5, 0.008), options);
  std::size_t below = 0;
  for (const MapVoxel& one : result.map.voxels) {
    const bool is_below = result.map.lattice.center_of(one.voxel).z() < 0.01;
    EXPECT_EQ(one.graspable, !is_below);
    below += is_below && one.score > 0.0 ? 1 : 0;
  }
  EXPECT_GT(below, 100U);
}

}  // namespace detect_test
}  // namespace libgtd
