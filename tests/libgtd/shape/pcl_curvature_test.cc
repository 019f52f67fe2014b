#include <pcl/features/normal_3d.h>
#include <pcl/features/principal_curvatures.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>

#include <cmath>

#include "libgtd/shape/curvature.h"
#include "tests/support/test_support.h"

namespace {

using graspmap_test::uniform;

// PCL's usual calls, with its usual search tree: neighbours come sorted by distance.
TEST(PclCurvature, ThesisIsPclsOwnPipelineToTheBit) {
  libmap::PointCloud cloud;
  pcl::PointCloud<pcl::PointXYZ>::Ptr points(new pcl::PointCloud<pcl::PointXYZ>);
  for (int i = 0; i < 3000; ++i) {
    const double x = uniform(-0.5, 0.5), y = uniform(-0.5, 0.5);
    cloud.positions.emplace_back(x, y, 0.1 * std::sin(9 * x) * std::cos(7 * y));
    const Eigen::Vector3f p = cloud.positions.back().cast<float>();
    points->emplace_back(p.x(), p.y(), p.z());
  }
  const pcl::search::KdTree<pcl::PointXYZ>::Ptr search(new pcl::search::KdTree<pcl::PointXYZ>);
  pcl::NormalEstimation<pcl::PointXYZ, pcl::Normal> normal_estimation;
  normal_estimation.setInputCloud(points);
  normal_estimation.setSearchMethod(search);
  normal_estimation.setRadiusSearch(0.09);
  pcl::PointCloud<pcl::Normal>::Ptr normals(new pcl::PointCloud<pcl::Normal>);
  normal_estimation.compute(*normals);
  pcl::PrincipalCurvaturesEstimation<pcl::PointXYZ, pcl::Normal> estimation;
  estimation.setInputCloud(points);
  estimation.setInputNormals(normals);
  estimation.setSearchMethod(search);
  estimation.setRadiusSearch(0.09);
  pcl::PointCloud<pcl::PrincipalCurvatures> expected;
  estimation.compute(expected);

  libgtd::CurvatureOptions options;
  options.method = libgtd::CurvatureMethod::thesis;
  const libgtd::CurvatureResult result = libgtd::estimate_curvature(cloud, options);
  ASSERT_EQ(result.valid_count, cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    ASSERT_EQ(result.points[i].k1, expected[i].pc1);
    ASSERT_EQ(result.points[i].k2, expected[i].pc2);
    ASSERT_EQ(result.points[i].normal.x(), (*normals)[i].normal_x);
    ASSERT_EQ(result.points[i].normal.z(), (*normals)[i].normal_z);
  }
}

}  // namespace
