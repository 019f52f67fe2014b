// Compares with the terrain frames that the author published for his clouds.
#include <gtest/gtest.h>
#include <pcl/filters/voxel_grid.h>
#include <pcl/point_types.h>

#include <filesystem>
#include <ostream>
#include <string>

#include "libgtd/terrain/regression_plane.h"
#include "libmap/io/cloud_io.h"
#include "tests/libgtd/terrain/regression_plane_test_support.h"
#include "tests/support/reference_data.h"
#include "tests/support/test_support.h"

namespace regression_plane_reference_test {

using Eigen::Vector3d;
using libgtd::fit_regression_plane;
using libgtd::PlaneMethod;
using libgtd::RegressionPlane;
using libmap::PointCloud;
using regression_plane_test::axes_of;
using regression_plane_test::upwards;

struct ReferenceCase {
  const char* cloud;
  const char* frame;
  float leaf_m;
};

void PrintTo(const ReferenceCase& set, std::ostream* out) { *out << set.frame; }

class RegressionPlaneReference : public testing::TestWithParam<ReferenceCase> {
 protected:
  // The author's program downsamples the cloud before it fits the plane.
  static PointCloud downsampled(const ReferenceCase& set) {
    const auto path = graspmap_test::data_folder() / "clouds" / (std::string(set.cloud) + ".pcd");
    pcl::PointCloud<pcl::PointXYZ>::Ptr dense(new pcl::PointCloud<pcl::PointXYZ>);
    for (const Vector3d& p : libmap::read_cloud(path).cloud.positions)
      dense->emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()),
                          static_cast<float>(p.z()));
    pcl::VoxelGrid<pcl::PointXYZ> grid;
    grid.setInputCloud(dense);
    grid.setLeafSize(set.leaf_m, set.leaf_m, set.leaf_m);
    pcl::PointCloud<pcl::PointXYZ> thin;
    grid.filter(thin);
    PointCloud cloud;
    for (const pcl::PointXYZ& p : thin) cloud.positions.emplace_back(p.x, p.y, p.z);
    return cloud;
  }
  static std::filesystem::path reference(const ReferenceCase& set, const char* what) {
    return graspmap_test::reference_folder() / "gtd" / (std::string(set.frame) + what);
  }
};

TEST_P(RegressionPlaneReference, ThesisFrame) {
  GRASPMAP_REQUIRE_DATA();
  GRASPMAP_REQUIRE_REFERENCE();
  const auto frame = graspmap_test::read_frame(reference(GetParam(), ".frame.txt"));
  const PointCloud cloud = downsampled(GetParam());
  ASSERT_EQ(cloud.size(), static_cast<std::size_t>(frame.downsampled));
  const RegressionPlane plane =
      fit_regression_plane(cloud, upwards(frame.rotation.col(2), PlaneMethod::thesis));
  EXPECT_LT((plane.centroid - frame.centroid).norm(), 5e-6);
  EXPECT_LT((axes_of(plane) - frame.rotation).cwiseAbs().maxCoeff(), 1e-4);
  EXPECT_GT(plane.relief_skewness, 0);

  const auto expected =
      graspmap_test::read_points_f32_gz(reference(GetParam(), ".transformed.f32.gz"));
  const PointCloud terrain = libgtd::transform_to_terrain(cloud, plane, PlaneMethod::thesis);
  ASSERT_EQ(terrain.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i)
    ASSERT_LT((terrain.positions[i] - expected[i].cast<double>()).norm(), 2e-4) << i;
}

TEST_P(RegressionPlaneReference, TransformWithTheGivenFrameToTheBit) {
  GRASPMAP_REQUIRE_DATA();
  GRASPMAP_REQUIRE_REFERENCE();
  const auto frame = graspmap_test::read_frame(reference(GetParam(), ".frame.txt"));
  RegressionPlane plane;
  plane.centroid = frame.centroid;
  plane.terrain_from_input.linear() = frame.rotation.transpose();
  plane.terrain_from_input.translation() = -(frame.rotation.transpose() * frame.centroid);
  const PointCloud terrain =
      libgtd::transform_to_terrain(downsampled(GetParam()), plane, PlaneMethod::thesis);
  const auto expected =
      graspmap_test::read_points_f32_gz(reference(GetParam(), ".transformed.f32.gz"));
  ASSERT_EQ(terrain.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i)
    ASSERT_EQ(terrain.positions[i], expected[i].cast<double>()) << i;
}

TEST_P(RegressionPlaneReference, CorrectedFindsTheSideOfTheRelief) {
  GRASPMAP_REQUIRE_DATA();
  GRASPMAP_REQUIRE_REFERENCE();
  const auto path =
      graspmap_test::data_folder() / "clouds" / (std::string(GetParam().cloud) + ".pcd");
  const auto frame = graspmap_test::read_frame(reference(GetParam(), ".frame.txt"));
  const RegressionPlane plane = fit_regression_plane(libmap::read_cloud(path).cloud);
  EXPECT_GT(axes_of(plane).col(2).dot(frame.rotation.col(2)), 0.99);
}

INSTANTIATE_TEST_SUITE_P(
    Sets, RegressionPlaneReference,
    testing::Values(ReferenceCase{"artificial_rocks", "artificial_rocks.thesis", 0.01F},
                    ReferenceCase{"leaning_bouldering_holds", "leaning_holds_scare.thesis", 0.01F},
                    ReferenceCase{"leaning_bouldering_holds", "leaning_holds_hubrobo.thesis",
                                  0.001F},
                    ReferenceCase{"scanned_cloud_primitive", "primitive_shapes.thesis", 0.005F}),
    [](const auto& set) {
      const std::string name = set.param.frame;
      return name.substr(0, name.find('.'));
    });

}  // namespace regression_plane_reference_test
