#include "libmap/core/point_cloud.h"

#include <gtest/gtest.h>

#include "tests/support/test_support.h"

namespace point_cloud_test {

using graspmap_test::error_of;
using libmap::PointCloud;
using libmap::ScalarType;

PointCloud three_points() {
  PointCloud cloud;
  cloud.positions = {{0, 0, 0}, {1, 2, 3}, {-4, 5, -6}};
  cloud.normals = {{0, 0, 1}, {0, 0.5F, 0}, {1, 0, 0}};
  cloud.colors = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}};
  cloud.add_field("score", ScalarType::float32).values = {0.5, 0.25, 1.0};
  cloud.add_field("id", ScalarType::int32).values = {10, 11, 12};
  cloud.viewpoint = libmap::make_pose_from_rpy({1, 2, 3}, {10, 20, 30});
  return cloud;
}

TEST(PointCloudTest, EmptyCloudIsSound) {
  const PointCloud cloud;
  cloud.check();
  EXPECT_TRUE(cloud.empty());
  EXPECT_EQ(cloud.size(), 0U);
  EXPECT_FALSE(cloud.has_normals());
  EXPECT_FALSE(cloud.has_colors());
  EXPECT_EQ(cloud.find_field("score"), nullptr);
  EXPECT_TRUE(libmap::select_points(cloud, {}).empty());
}

TEST(PointCloudTest, AddFieldMakesZeros) {
  PointCloud cloud;
  cloud.positions.resize(4);
  const libmap::ScalarField& field = cloud.add_field("edge", ScalarType::uint8);
  EXPECT_EQ(field.values, std::vector<double>(4, 0.0));
  EXPECT_EQ(field.type, ScalarType::uint8);
  cloud.check();
}

TEST(PointCloudTest, AddFieldOfAKnownNameReplacesIt) {
  PointCloud cloud = three_points();
  cloud.add_field("score", ScalarType::float64);
  ASSERT_EQ(cloud.fields.size(), 2U);
  EXPECT_EQ(cloud.fields[0].name, "score");
  EXPECT_EQ(cloud.fields[0].type, ScalarType::float64);
  EXPECT_EQ(cloud.fields[0].values, std::vector<double>(3, 0.0));
}

TEST(PointCloudTest, FindFieldByItsWholeName) {
  PointCloud cloud = three_points();
  ASSERT_NE(cloud.find_field("id"), nullptr);
  cloud.find_field("id")->values[0] = 99;
  EXPECT_EQ(cloud.fields[1].values[0], 99);
  EXPECT_EQ(cloud.find_field("i"), nullptr);
  EXPECT_EQ(cloud.find_field("ID"), nullptr);
}

TEST(PointCloudTest, CheckNamesTheArrayOfAnotherLength) {
  PointCloud normals = three_points();
  normals.normals.pop_back();
  EXPECT_EQ(error_of([&] { normals.check(); }).context().field, "normals");
  PointCloud colors = three_points();
  colors.colors.emplace_back();
  EXPECT_EQ(error_of([&] { colors.check(); }).context().field, "colors");
  PointCloud field = three_points();
  field.fields[1].values.clear();
  EXPECT_EQ(error_of([&] { field.check(); }).context().field, "id")
      << "a field, unlike normals, may not be empty";
  three_points().check();
}

TEST(PointCloudTest, SelectTakesAllThatBelongsToAPoint) {
  const PointCloud cloud = three_points();
  const PointCloud selected = libmap::select_points(cloud, {2, 0, 2});
  selected.check();
  ASSERT_EQ(selected.size(), 3U);
  EXPECT_EQ(selected.positions[0], cloud.positions[2]);
  EXPECT_EQ(selected.positions[1], cloud.positions[0]);
  EXPECT_EQ(selected.normals[0], cloud.normals[2]);
  EXPECT_EQ(selected.colors[1], cloud.colors[0]);
  EXPECT_EQ(selected.fields[0].values, (std::vector<double>{1.0, 0.5, 1.0}));
  EXPECT_EQ(selected.fields[1].type, ScalarType::int32);
  EXPECT_TRUE(selected.viewpoint.isApprox(cloud.viewpoint));
}

TEST(PointCloudTest, SelectKeepsFieldsOfNoPoints) {
  const PointCloud selected = libmap::select_points(three_points(), {});
  EXPECT_EQ(selected.fields.size(), 2U);
  selected.check();
}

TEST(PointCloudTest, TransformMovesPointsAndTurnsNormals) {
  PointCloud cloud = three_points();
  const libmap::Pose pose = libmap::make_pose_from_rpy({10, 0, 0}, {0, 0, 90});
  const PointCloud moved = libmap::transform_cloud(cloud, pose);
  EXPECT_TRUE(moved.positions[1].isApprox(Eigen::Vector3d(8, 1, 3), 1e-12));
  EXPECT_TRUE(moved.normals[1].isApprox(Eigen::Vector3f(-0.5F, 0, 0), 1e-6F))
      << "turned, not moved, and its length kept";
  EXPECT_TRUE(moved.viewpoint.isApprox(pose * cloud.viewpoint, 1e-12));
  EXPECT_EQ(moved.fields, cloud.fields);
  EXPECT_EQ(moved.colors, cloud.colors);
}

TEST(PointCloudTest, TransformMovesViewpointsAndTurnsApproachesOfPoints) {
  PointCloud cloud = three_points();
  const Eigen::Vector3d vector(1, 2, 3);
  for (const std::string name : {"vp", "approach"})
    for (std::size_t axis = 0; axis < 3; ++axis)
      cloud.add_field(name + "_" + "xyz"[axis], ScalarType::float64)
          .values.assign(3, vector[static_cast<Eigen::Index>(axis)]);
  cloud.add_field("approach_xy", ScalarType::float64).values.assign(3, 7.0);
  const libmap::Pose pose = libmap::make_pose_from_rpy({10, 0, 0}, {0, 0, 90});
  const PointCloud moved = libmap::transform_cloud(cloud, pose);
  const auto vector_of = [&](const std::string& name) {
    return Eigen::Vector3d(moved.find_field(name + "_x")->values[2],
                           moved.find_field(name + "_y")->values[2],
                           moved.find_field(name + "_z")->values[2]);
  };
  EXPECT_TRUE(vector_of("vp").isApprox(Eigen::Vector3d(8, 1, 3), 1e-12));
  EXPECT_TRUE(vector_of("approach").isApprox(Eigen::Vector3d(-2, 1, 3), 1e-12));
  EXPECT_EQ(moved.find_field("approach_xy")->values[0], 7.0);
  // Two of three vector fields are ordinary fields.
  std::erase_if(cloud.fields, [](const auto& field) { return field.name == "vp_z"; });
  EXPECT_EQ(libmap::transform_cloud(cloud, pose).find_field("vp_x")->values[0], 1.0);
}

TEST(PointCloudTest, TransformThereAndBack) {
  const PointCloud cloud = three_points();
  const libmap::Pose pose = libmap::make_pose_from_rpy({1e3, -2e3, 5}, {12, -34, 156});
  const PointCloud back =
      libmap::transform_cloud(libmap::transform_cloud(cloud, pose), pose.inverse());
  for (std::size_t n = 0; n < cloud.size(); ++n)
    EXPECT_LT((back.positions[n] - cloud.positions[n]).norm(), 1e-9);
}

TEST(PointCloudTest, Bounds) {
  const libmap::Bounds3d bounds = libmap::bounds_of(three_points().positions);
  EXPECT_EQ(bounds.min, Eigen::Vector3d(-4, 0, -6));
  EXPECT_EQ(bounds.max, Eigen::Vector3d(1, 5, 3));
  const libmap::Bounds3d far = libmap::bounds_of({{100, 200, -300}});
  EXPECT_EQ(far.min, far.max) << "the origin is not in the box of one point";
  EXPECT_EQ(libmap::bounds_of({}).max, Eigen::Vector3d(0, 0, 0));
}

}  // namespace point_cloud_test
