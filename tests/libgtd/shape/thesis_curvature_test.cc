#include <pcl/features/normal_3d.h>
#include <pcl/features/principal_curvatures.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>

#include <cmath>

#include "libgtd/shape/curvature.h"
#include "libmap/io/cloud_io.h"
#include "tests/support/test_support.h"

namespace thesis_curvature_test {

using graspmap_test::uniform;

// Calls of PCL with its search tree; neighbors are sorted by distance.
void expect_pcls_own(const libmap::PointCloud& cloud, double radius_m) {
  pcl::PointCloud<pcl::PointXYZ>::Ptr points(new pcl::PointCloud<pcl::PointXYZ>);
  for (const Eigen::Vector3d& position : cloud.positions) {
    const Eigen::Vector3f p = position.cast<float>();
    points->emplace_back(p.x(), p.y(), p.z());
  }
  const pcl::search::KdTree<pcl::PointXYZ>::Ptr search(new pcl::search::KdTree<pcl::PointXYZ>);
  pcl::NormalEstimation<pcl::PointXYZ, pcl::Normal> normal_estimation;
  normal_estimation.setInputCloud(points);
  normal_estimation.setSearchMethod(search);
  normal_estimation.setRadiusSearch(radius_m);
  pcl::PointCloud<pcl::Normal>::Ptr normals(new pcl::PointCloud<pcl::Normal>);
  normal_estimation.compute(*normals);
  pcl::PrincipalCurvaturesEstimation<pcl::PointXYZ, pcl::Normal> estimation;
  estimation.setInputCloud(points);
  estimation.setInputNormals(normals);
  estimation.setSearchMethod(search);
  estimation.setRadiusSearch(radius_m);
  pcl::PointCloud<pcl::PrincipalCurvatures> expected;
  estimation.compute(expected);

  libgtd::CurvatureOptions options;
  options.method = libgtd::CurvatureMethod::thesis;
  options.radius_m = radius_m;
  const libgtd::CurvatureResult result = libgtd::estimate_curvature(cloud, options);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const libgtd::Curvature& ours = result.points[i];
    ASSERT_EQ(ours.valid, std::isfinite(expected[i].pc1) && std::isfinite(expected[i].pc2)) << i;
    if (!ours.valid) continue;
    ASSERT_EQ(ours.k1, expected[i].pc1) << i;
    ASSERT_EQ(ours.k2, expected[i].pc2) << i;
    const Eigen::Vector3f normal((*normals)[i].normal_x, (*normals)[i].normal_y,
                                 (*normals)[i].normal_z);
    ASSERT_EQ(ours.normal, normal) << i;
  }
}

libmap::PointCloud random_surface(int count) {
  libmap::PointCloud cloud;
  for (int i = 0; i < count; ++i) {
    const double x = uniform(-0.5, 0.5), y = uniform(-0.5, 0.5);
    cloud.positions.emplace_back(x, y, 0.1 * std::sin(9 * x) * std::cos(7 * y));
  }
  return cloud;
}

TEST(ThesisCurvature, IsPclsOwnPipelineToTheBit) { expect_pcls_own(random_surface(3000), 0.09); }

TEST(ThesisCurvature, IsPclsOwnWherePointsCoincideOrStandAlone) {
  libmap::PointCloud cloud = random_surface(1200);
  for (std::size_t i = 0; i < 900; i += 2) cloud.positions.push_back(cloud.positions[i]);
  for (int i = 0; i < 40; ++i)
    cloud.positions.emplace_back(3.0 + uniform(0, 1), 2.0 + uniform(0, 1), uniform(0, 1));
  expect_pcls_own(cloud, 0.09);
}

// Equal distances everywhere.
TEST(ThesisCurvature, IsPclsOwnOnARegularGrid) {
  libmap::PointCloud cloud;
  for (int i = 0; i < 40; ++i)
    for (int j = 0; j < 40; ++j)
      cloud.positions.emplace_back(i / 64.0, j / 64.0, (i * j % 7) / 256.0);
  expect_pcls_own(cloud, 0.0625);
}

// All squared distances are negligible against the squared radius.
TEST(ThesisCurvature, IsPclsOwnWhereTheRadiusIsFarLargerThanTheCloud) {
  libmap::PointCloud cloud = random_surface(150);
  for (int i = 0; i < 7; ++i)
    for (int j = 0; j < 7; ++j) cloud.positions.emplace_back(i / 8.0, j / 8.0, 0.25);
  expect_pcls_own(cloud, 100.0);
}

// A few positions with many points each, in sequence and mixed.
TEST(ThesisCurvature, IsPclsOwnOfManyPointsInFewPlaces) {
  libmap::PointCloud coordinates = random_surface(60);
  libmap::PointCloud cloud;
  for (std::size_t n = 0; n < 600; ++n)
    cloud.positions.push_back(coordinates.positions[n < 300 ? n / 5 : n % 60]);
  expect_pcls_own(cloud, 0.3);
}

TEST(ThesisCurvature, IsPclsOwnOnClimbingHolds) {
  GRASPMAP_REQUIRE_DATA();
  const auto file = graspmap_test::data_folder() / "clouds" / "leaning_bouldering_holds.pcd";
  expect_pcls_own(libmap::read_cloud(file).cloud, 0.03);
}

}  // namespace thesis_curvature_test
