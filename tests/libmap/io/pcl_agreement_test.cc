// The Point Cloud Library as an independent reader and writer of the same files.
#include <gtest/gtest.h>
#include <pcl/console/print.h>
#include <pcl/conversions.h>
#include <pcl/io/pcd_io.h>
#include <pcl/io/ply_io.h>
#include <pcl/point_types.h>

#include "libmap/io/cloud_io.h"
#include "tests/libmap/io/cloud_samples.h"

namespace libmap {
namespace pcl_agreement_test {

using Points = pcl::PointCloud<pcl::PointXYZRGBNormal>;

Points pcl_cloud() {
  Points points;
  for (int i = 0; i < 300; ++i) {
    pcl::PointXYZRGBNormal point;
    point.x = static_cast<float>(graspmap_test::uniform(-2, 2));
    point.y = static_cast<float>(graspmap_test::uniform(-2, 2));
    point.z = static_cast<float>(graspmap_test::uniform(-2, 2));
    point.r = static_cast<std::uint8_t>(i % 256);
    point.g = static_cast<std::uint8_t>(i / 2);
    point.b = 255;
    point.a = static_cast<std::uint8_t>(255 - i % 2);
    point.normal_x = 0.25F;
    point.normal_y = static_cast<float>(i);
    point.normal_z = -0.125F;
    point.curvature = static_cast<float>(graspmap_test::uniform(0, 1));
    points.push_back(point);
  }
  points.sensor_origin_ = Eigen::Vector4f(1, 2, 3, 0);
  return points;
}

void expect_same(const Points& points, const PointCloud& cloud, float tolerance) {
  ASSERT_EQ(cloud.size(), points.size());
  ASSERT_EQ(cloud.normals.size(), points.size());
  ASSERT_EQ(cloud.colors.size(), points.size());
  ASSERT_NE(cloud.find_field("curvature"), nullptr);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const pcl::PointXYZRGBNormal& point = points[i];
    ASSERT_LE((cloud.positions[i].cast<float>() - point.getVector3fMap()).norm(), tolerance);
    ASSERT_LE((cloud.normals[i] - point.getNormalVector3fMap()).norm(), tolerance);
    ASSERT_EQ(cloud.colors[i], (Color{point.r, point.g, point.b}));
    ASSERT_NEAR(cloud.find_field("curvature")->values[i], static_cast<double>(point.curvature),
                static_cast<double>(tolerance));
  }
}

TEST(PclAgreement, ReadsWhatPclWrites) {
  pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);
  const Points points = pcl_cloud();
  const std::string path = (graspmap_test::scratch_folder() / "pcl.pcd").string();
  pcl::PCDWriter writer;
  writer.writeBinary(path, points);
  expect_same(points, read_cloud(path).cloud, 0.0F);
  EXPECT_EQ(read_cloud(path).cloud.viewpoint.translation(), Eigen::Vector3d(1, 2, 3));
  writer.writeBinaryCompressed(path, points);
  expect_same(points, read_cloud(path).cloud, 0.0F);
  writer.writeASCII(path, points, 9);
  expect_same(points, read_cloud(path).cloud, 0.0F);
  const std::string ply = (graspmap_test::scratch_folder() / "pcl.ply").string();
  for (const bool binary : {false, true}) {
    pcl::PLYWriter().write(ply, points, binary, true);
    expect_same(points, read_cloud(ply).cloud, binary ? 0.0F : 1e-4F);
  }
}

TEST(PclAgreement, PclReadsWhatIsWritten) {
  pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);
  PointCloud cloud = graspmap_test::sample_cloud(300);
  cloud.fields.clear();
  ScalarField& curvature = cloud.add_field("curvature", ScalarType::float32);
  for (double& value : curvature.values)
    value = graspmap_test::as_float(graspmap_test::uniform(0, 1));
  const std::string path = (graspmap_test::scratch_folder() / "ours.pcd").string();
  for (const FileEncoding encoding :
       {FileEncoding::ascii, FileEncoding::binary, FileEncoding::binary_compressed}) {
    write_cloud(path, cloud, {encoding, false});
    Points points;
    ASSERT_EQ(pcl::PCDReader().read(path, points), 0);
    expect_same(points, cloud, 0.0F);
    EXPECT_NEAR(points.sensor_origin_.x(), 1234.5678F, 1e-3F);
  }
  const std::string ply = (graspmap_test::scratch_folder() / "ours.ply").string();
  for (const bool big_endian : {false, true}) {
    write_cloud(ply, cloud, {FileEncoding::binary, big_endian});
    Points points;
    ASSERT_EQ(pcl::PLYReader().read(ply, points), 0);
    expect_same(points, cloud, 0.0F);
  }
}

TEST(PclAgreement, RealCloudsReadTheSame) {
  GRASPMAP_REQUIRE_DATA();
  pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);
  for (const char* const name :
       {"artificial_rocks.pcd", "scanned_cloud_primitive.pcd", "simulated_cloud_pre-scan.pcd",
        "scanned_cloud_realtime.pcd", "leaning_bouldering_holds.pcd", "realsense_octree.pcd"}) {
    const std::filesystem::path path = graspmap_test::data_folder() / "clouds" / name;
    const CloudReadResult read = read_cloud(path);
    pcl::PointCloud<pcl::PointXYZRGB> points;
    ASSERT_EQ(pcl::PCDReader().read(path.string(), points), 0);
    std::size_t row = 0;
    for (const pcl::PointXYZRGB& point : points) {
      if (!point.getVector3fMap().allFinite()) continue;
      ASSERT_LT(row, read.cloud.size());
      ASSERT_EQ(read.cloud.positions[row].cast<float>(), point.getVector3fMap()) << name;
      ASSERT_EQ(read.cloud.colors[row], (Color{point.r, point.g, point.b})) << name;
      ++row;
    }
    EXPECT_EQ(row, read.cloud.size()) << name;
  }
}

}  // namespace pcl_agreement_test
}  // namespace libmap
