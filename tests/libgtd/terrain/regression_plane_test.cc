#include "libgtd/terrain/regression_plane.h"
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "libmap/core/parallel.h"
#include "tests/libgtd/terrain/regression_plane_test_support.h"
#include "tests/support/test_support.h"

namespace regression_plane_test {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::uniform;
using libgtd::fit_regression_plane;
using libgtd::PlaneMethod;
using libgtd::RegressionPlane;
using libgtd::RegressionPlaneOptions;
using libgtd::UpSource;
using libmap::PointCloud;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// Ground with bumps; its normal is nearly z, and its heights are skewed upward.
PointCloud bumpy_ground(std::size_t count) {
  PointCloud cloud;
  for (std::size_t i = 0; i < count; ++i) {
    const double x = uniform(-2, 2), y = uniform(-1, 1);
    const double bump = 0.3 * std::exp(-20 * ((x - 0.5) * (x - 0.5) + y * y));
    cloud.positions.emplace_back(x + 1.0, y + 0.4, 0.1 * x + bump + uniform(-0.01, 0.01) + 0.2);
  }
  return cloud;
}

PointCloud moved(const PointCloud& cloud, const Matrix3d& rotation, const Vector3d& shift) {
  libmap::Pose pose = libmap::Pose::Identity();
  pose.linear() = rotation;
  pose.translation() = shift;
  PointCloud result = libmap::transform_cloud(cloud, pose);
  result.viewpoint = cloud.viewpoint;
  return result;
}

Matrix3d rotation_about(const Vector3d& axis, double degrees) {
  return Eigen::AngleAxisd(degrees * std::numbers::pi / 180, axis.normalized()).matrix();
}

TEST(RegressionPlane, AgreesWithSingularValueDecomposition) {
  const PointCloud cloud = moved(bumpy_ground(20000), rotation_about({1, 2, 0.5}, 35), {3, -1, 2});
  const RegressionPlane plane =
      fit_regression_plane(cloud, upwards({0, 0, 1}, PlaneMethod::corrected));

  Eigen::MatrixXd points(3, cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i)
    points.col(static_cast<Eigen::Index>(i)) = cloud.positions[i];
  const Vector3d mean = points.rowwise().mean();
  points.colwise() -= mean;
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(points, Eigen::ComputeThinU);
  EXPECT_LT((plane.centroid - mean).norm(), 1e-12);
  EXPECT_NEAR(std::abs(svd.matrixU().col(2).dot(axes_of(plane).col(2))), 1, 1e-13);
  EXPECT_NEAR(plane.rmse_m, svd.singularValues()[2] / std::sqrt(20000.0), 1e-12);
}

TEST(RegressionPlane, FrameIsARotationWithTheCentroidAtItsOrigin) {
  const PointCloud cloud = moved(bumpy_ground(500), rotation_about({1, 1, 0}, 50), {1, 2, 3});
  for (const PlaneMethod method :
       {PlaneMethod::thesis, PlaneMethod::corrected, PlaneMethod::robust}) {
    const RegressionPlane plane = fit_regression_plane(cloud, upwards({0, 0, 1}, method));
    const Matrix3d axes = axes_of(plane);
    EXPECT_LT((axes.transpose() * axes - Matrix3d::Identity()).norm(), 1e-12);
    EXPECT_NEAR(axes.determinant(), 1, 1e-12);
    EXPECT_LT((plane.terrain_from_input * plane.centroid).norm(), 1e-12);
    EXPECT_EQ(plane.points, 500u);
    EXPECT_EQ(plane.skipped, 0u);
  }
}

TEST(RegressionPlane, ThesisHeadingIsEquation2_17) {
  const PointCloud cloud = bumpy_ground(500);
  const RegressionPlane plane =
      fit_regression_plane(cloud, upwards({0, 0, 1}, PlaneMethod::thesis));
  const Vector3d n = axes_of(plane).col(2);
  const Vector3d y = plane.centroid.cross(n).normalized();
  EXPECT_LT((axes_of(plane).col(1) + y).norm(), 1e-12);
  EXPECT_LT((axes_of(plane).col(0) - n.cross(y)).norm(), 1e-12);
}

TEST(RegressionPlane, CorrectedHeadingIsTheInputsXAxis) {
  const PointCloud cloud = moved(bumpy_ground(500), rotation_about({1, 1, 0}, 40), {1, 2, 3});
  const Matrix3d axes = axes_of(fit_regression_plane(cloud, upwards({0, 0, 1})));
  const Vector3d n = axes.col(2);
  const Vector3d projected = (Vector3d::UnitX() - n.x() * n).normalized();
  EXPECT_LT((axes.col(0) - projected).norm(), 1e-12);
}

TEST(RegressionPlane, CorrectedHeadingOnAWallAcrossXIsTheInputsYAxis) {
  PointCloud wall;
  for (int i = 0; i < 100; ++i) wall.positions.emplace_back(2, uniform(-1, 1), uniform(-1, 1));
  const Matrix3d axes = axes_of(fit_regression_plane(wall, upwards({-1, 0, 0})));
  EXPECT_LT((axes.col(2) + Vector3d::UnitX()).norm(), 1e-12);
  EXPECT_LT((axes.col(1) - Vector3d::UnitY()).norm(), 1e-12);
  EXPECT_NEAR(axes.determinant(), 1, 1e-12);
}

TEST(RegressionPlane, TurningTheCloudTurnsTheThesisFrameWithIt) {
  const PointCloud cloud = bumpy_ground(500);
  const Matrix3d turn = rotation_about({0, 0, 1}, 90);
  const PointCloud turned = moved(cloud, turn, Vector3d::Zero());
  const auto options = upwards({0, 0, 1}, PlaneMethod::thesis);
  const RegressionPlane a = fit_regression_plane(cloud, options);
  const RegressionPlane b = fit_regression_plane(turned, options);
  EXPECT_LT((axes_of(b) - turn * axes_of(a)).norm(), 1e-12);
}

TEST(RegressionPlane, TurningTheCloudTurnsItsImageInTheCorrectedFrame) {
  PointCloud level;  // symmetric, so that its normal is z
  for (int i = 0; i < 200; ++i) {
    const Vector3d p(uniform(-2, 2), uniform(-1, 1), uniform(-0.1, 0.1));
    for (const double sx : {-1, 1})
      for (const double sy : {-1, 1}) level.positions.emplace_back(sx * p.x(), sy * p.y(), p.z());
  }
  const Matrix3d turn = rotation_about({0, 0, 1}, 90);
  const PointCloud turned = moved(level, turn, Vector3d::Zero());
  const RegressionPlaneOptions corrected{.method = PlaneMethod::corrected};
  const RegressionPlane a = fit_regression_plane(level, corrected);
  const RegressionPlane b = fit_regression_plane(turned, corrected);
  EXPECT_LT((axes_of(a) - axes_of(b)).norm(), 1e-12);
  const Vector3d before = a.terrain_from_input * level.positions[7];
  EXPECT_LT((turn * before - b.terrain_from_input * turned.positions[7]).norm(), 1e-12);
}

TEST(RegressionPlane, AFarOriginDoesNoHarm) {
  const PointCloud near = bumpy_ground(3000);
  const PointCloud far = moved(near, Matrix3d::Identity(), {1e6, -2e6, 5e5});
  const RegressionPlane a = fit_regression_plane(near);
  const RegressionPlane b = fit_regression_plane(far);
  EXPECT_LT((axes_of(a) - axes_of(b)).norm(), 1e-8);
  EXPECT_NEAR(a.rmse_m, b.rmse_m, 1e-9);
  const auto at_near = libgtd::transform_to_terrain(near, a, PlaneMethod::corrected);
  const auto at_far = libgtd::transform_to_terrain(far, b, PlaneMethod::corrected);
  for (std::size_t i = 0; i < near.size(); ++i)
    ASSERT_LT((at_near.positions[i] - at_far.positions[i]).norm(), 1e-7);
}

TEST(RegressionPlane, TheCentroidIsRightToTheLastBits) {
  PointCloud cloud;
  for (int i = 0; i < 50000; ++i) {
    const Vector3d d(uniform(-1, 1), uniform(-1, 1), 0);
    cloud.positions.push_back(Vector3d(1e9 + 0.3, 0.3, 0) + d);
    cloud.positions.push_back(Vector3d(1e9 + 0.3, 0.3, 0) - d);
  }
  const RegressionPlane plane = fit_regression_plane(cloud);
  EXPECT_NEAR(plane.centroid.x(), 1e9 + 0.3, 2.5e-7);  // two units of rounding at this size
  EXPECT_NEAR(plane.centroid.y(), 0.3, 1e-14);
}

TEST(RegressionPlane, TinyAndHugeClouds) {
  for (const double scale : {1e-9, 1e9, 1e120}) {
    PointCloud cloud = bumpy_ground(100);
    const Matrix3d axes = axes_of(fit_regression_plane(cloud));
    for (Vector3d& p : cloud.positions) p *= scale;
    EXPECT_LT((axes_of(fit_regression_plane(cloud)) - axes).norm(), 1e-9) << scale;
  }
}

TEST(RegressionPlane, SameBitsWithAnyNumberOfThreads) {
  const PointCloud cloud = bumpy_ground(50000);
  const RegressionPlane a = fit_regression_plane(cloud);
  for (const unsigned threads : {1u, 2u, 3u}) {
    const libmap::ThreadLimit limit(threads);
    const RegressionPlane b = fit_regression_plane(cloud);
    EXPECT_EQ(a.terrain_from_input.matrix(), b.terrain_from_input.matrix());
    EXPECT_EQ(a.rmse_m, b.rmse_m);
  }
}

TEST(RegressionPlaneUp, DirectionWinsOverAllElse) {
  PointCloud cloud = bumpy_ground(300);
  cloud.normals.assign(300, Eigen::Vector3f(0, 0, 1));
  cloud.viewpoint.translation() = Vector3d(0, 0, 5);
  const RegressionPlane plane = fit_regression_plane(cloud, upwards({0, 0, -0.001}));
  EXPECT_EQ(plane.up_source, UpSource::direction);
  EXPECT_LT(axes_of(plane)(2, 2), 0);
  EXPECT_LT(plane.relief_skewness, 0);
}

TEST(RegressionPlaneUp, ThenTheViewpoint) {
  PointCloud cloud = bumpy_ground(300);
  cloud.normals.assign(300, Eigen::Vector3f(0, 0, 1));
  cloud.viewpoint.translation() = Vector3d(0, 0, -5);
  const RegressionPlane plane = fit_regression_plane(cloud);
  EXPECT_EQ(plane.up_source, UpSource::viewpoint);
  EXPECT_LT(axes_of(plane)(2, 2), 0);
}

TEST(RegressionPlaneUp, ThenTheNormalsIfTheyAgree) {
  PointCloud cloud = bumpy_ground(300);
  cloud.normals.assign(300, Eigen::Vector3f(0, 0, -0.4F));
  for (std::size_t i = 0; i < 10; ++i) cloud.normals[i] = Eigen::Vector3f(0, 0, 1);
  const RegressionPlane plane = fit_regression_plane(cloud);
  EXPECT_EQ(plane.up_source, UpSource::normals);
  EXPECT_LT(axes_of(plane)(2, 2), 0);
  EXPECT_NEAR(plane.normals_up.value(), 290.0 / 300, 1e-12);
}

// Normals with random sides, as from eigenvector solvers and closed surfaces: any majority is
// chance.
TEST(RegressionPlaneUp, NormalsThatDisagreeDoNotDecide) {
  for (const double fraction : {0.25, 0.5, 0.7, 0.78}) {
    PointCloud cloud = bumpy_ground(1000);
    cloud.normals.assign(1000, Eigen::Vector3f(0, 0, 1));
    for (std::size_t i = 0; i < 1000; ++i)  // in one part of the ground
      if (cloud.positions[i].x() < 4 * fraction - 1) cloud.normals[i].z() = -1;
    const RegressionPlane plane = fit_regression_plane(cloud);
    EXPECT_EQ(plane.up_source, UpSource::frame_z) << fraction;
    EXPECT_GT(axes_of(plane)(2, 2), 0) << fraction;
    EXPECT_LT(plane.opposing_normals, 0.1) << fraction;
    for (Eigen::Vector3f& normal : cloud.normals)
      normal.z() = uniform(0, 1) < fraction ? -1.0F : 1.0F;
    const RegressionPlane mixed = fit_regression_plane(cloud);
    EXPECT_EQ(mixed.up_source, UpSource::frame_z) << fraction;
    EXPECT_GT(mixed.opposing_normals, 0.1) << fraction;
  }
}

// Missing heights tilt the plane of a DEM.
TEST(RegressionPlaneUp, ThePlaneOfHeightsMayNotBeSteep) {
  const PointCloud wall = moved(bumpy_ground(300), rotation_about({0, 1, 0}, 84), {4, 0, 1});
  RegressionPlaneOptions options = upwards({0, 0, 1});
  EXPECT_NO_THROW(fit_regression_plane(wall, options));
  options.max_tilt_deg = 75;
  const libmap::Error error = error_of([&] { fit_regression_plane(wall, options); });
  EXPECT_EQ(error.context().field, "tilt of the plane");
  EXPECT_NO_THROW(fit_regression_plane(bumpy_ground(300), options));
}

TEST(RegressionPlaneUp, ZeroNormalsSayNothing) {
  PointCloud cloud = bumpy_ground(300);
  cloud.normals.assign(300, Eigen::Vector3f::Zero());
  cloud.normals[5] = Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());
  const RegressionPlane plane = fit_regression_plane(cloud);
  EXPECT_EQ(plane.up_source, UpSource::frame_z);
  EXPECT_GT(axes_of(plane)(2, 2), 0);
  EXPECT_GT(plane.relief_skewness, 0);
}

TEST(RegressionPlaneUp, OnAWallTheCameraAtTheOrigin) {
  const PointCloud wall = moved(bumpy_ground(300), rotation_about({0, 1, 0}, 84), {4, 0, 1});
  const RegressionPlane plane = fit_regression_plane(wall);
  EXPECT_EQ(plane.up_source, UpSource::camera_origin);
  EXPECT_LT(plane.centroid.dot(axes_of(plane).col(2)), 0);  // eq. 2-16
}

TEST(RegressionPlaneUp, TheReliefWhereNothingElseIsKnown) {
  PointCloud wall;  // through the origin, bumps toward -x
  for (int i = 0; i < 40; ++i)
    for (int j = -20; j < 20; ++j)
      wall.positions.emplace_back(i % 10 == 0 ? -0.09 : 0.01, 0.1 * i - 1.95, 0.1 * j + 0.05);
  const RegressionPlane plane = fit_regression_plane(wall);
  EXPECT_EQ(plane.up_source, UpSource::relief);
  EXPECT_LT(axes_of(plane)(0, 2), 0);
  EXPECT_GT(plane.relief_skewness, 0);
}

TEST(RegressionPlaneUp, NamesOfTheSources) {
  EXPECT_EQ(libgtd::to_text(UpSource::direction), "direction");
  EXPECT_EQ(libgtd::to_text(UpSource::camera_origin), "camera_origin");
}

TEST(RegressionPlaneErrors, TooFewPoints) {
  PointCloud cloud;
  EXPECT_TRUE(is_error(error_of([&] { fit_regression_plane(cloud); }),
                       {.field = "points", .value = "0", .bound = ">= 3"}));
  cloud.positions = {{0, 0, 0}, {1, 0, 0}, {0, nan, 0}};
  EXPECT_TRUE(is_error(error_of([&] { fit_regression_plane(cloud); }),
                       {.field = "points", .value = "2", .bound = ">= 3"}));
}

TEST(RegressionPlaneErrors, AllInOnePlace) {
  for (const Vector3d& place : {Vector3d(0, 0, 0), Vector3d(0.1, 0.7, 1e6)}) {
    PointCloud cloud;
    cloud.positions.assign(1000, place);
    EXPECT_TRUE(is_error(error_of([&] { fit_regression_plane(cloud); }), {.field = "points"}));
  }
}

TEST(RegressionPlaneErrors, AllOnALine) {
  for (const Vector3d& offset : {Vector3d(0, 0, 0), Vector3d(1e3, 2e3, -1e3)}) {
    PointCloud cloud;
    for (int i = 0; i < 100; ++i) {
      const Vector3d p = Vector3d(1, 2, 3) * uniform(0, 1);
      cloud.positions.push_back(p.cast<float>().cast<double>() + offset);
    }
    EXPECT_TRUE(is_error(error_of([&] { fit_regression_plane(cloud); }), {.field = "points"}));
  }
}

TEST(RegressionPlaneErrors, UpWithoutLengthOrInThePlane) {
  PointCloud square;
  square.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
  for (const Vector3d& up : {Vector3d(0, 0, 0), Vector3d(1, 0, 0), Vector3d(nan, 0, 1)})
    EXPECT_EQ(error_of([&] { fit_regression_plane(square, upwards(up)); }).context().field, "up");
}

TEST(RegressionPlaneErrors, ThesisWithTheCentroidOnTheNormal) {
  PointCloud square;
  square.positions = {{-1, -1, 2}, {1, -1, 2}, {-1, 1, 2}, {1, 1, 2}};
  const RegressionPlaneOptions thesis{.method = PlaneMethod::thesis};
  EXPECT_TRUE(
      is_error(error_of([&] { fit_regression_plane(square, thesis); }), {.about = "eq. 2-17"}));
  for (Vector3d& p : square.positions) p.z() = 0;
  EXPECT_TRUE(
      is_error(error_of([&] { fit_regression_plane(square, thesis); }), {.about = "eq. 2-17"}));
  EXPECT_NO_THROW(fit_regression_plane(square));
}

TEST(RegressionPlane, PointsThatAreNotFiniteAreSkipped) {
  PointCloud cloud = bumpy_ground(300);
  const RegressionPlane clean = fit_regression_plane(cloud);
  cloud.positions.emplace(cloud.positions.begin(), nan, 0, 0);
  cloud.positions.emplace_back(0, std::numeric_limits<double>::infinity(), 0);
  const RegressionPlane plane = fit_regression_plane(cloud);
  EXPECT_EQ(plane.skipped, 2u);
  EXPECT_LT((plane.terrain_from_input.matrix() - clean.terrain_from_input.matrix()).norm(), 1e-12);
}

// Site of 3 x 3 m whose ground rises by a tenth along x. Rocks of up to 0.4 m cover 40 % of it, all
// on one side; `is_dense` adds a hundred points near a corner for each existing one.
PointCloud ground_with_rocks(bool is_dense) {
  PointCloud cloud;
  for (int i = 0; i < 20000; ++i) {
    const double x = uniform(-1.5, 1.5), y = uniform(-1.5, 1.5);
    const bool is_rock = x > 0.3;
    const double height =
        is_rock ? 0.1 + 0.3 * std::abs(std::sin(7 * x) * std::sin(5 * y)) : uniform(-0.005, 0.005);
    cloud.positions.emplace_back(x, y, 0.1 * x + height);
  }
  for (int i = 0; is_dense && i < 50000; ++i) {
    const double x = uniform(1.2, 1.5), y = uniform(1.2, 1.5);
    cloud.positions.emplace_back(x, y, 0.1 * x + 0.3);
  }
  return cloud;
}

double degrees_off(const RegressionPlane& plane, const Vector3d& normal) {
  return std::acos(std::min(1.0, axes_of(plane).col(2).dot(normal.normalized()))) * 180.0 /
         std::numbers::pi;
}

TEST(RobustPlane, RocksAndDensePartsDoNotTiltIt) {
  const Vector3d truth(-0.1, 0, 1);
  for (const bool is_dense : {false, true}) {
    const PointCloud cloud = ground_with_rocks(is_dense);
    const RegressionPlane squares =
        fit_regression_plane(cloud, upwards({0, 0, 1}, PlaneMethod::corrected));
    const RegressionPlane robust =
        fit_regression_plane(cloud, upwards({0, 0, 1}, PlaneMethod::robust));
    EXPECT_GT(degrees_off(squares, truth), 4.0);
    EXPECT_LT(degrees_off(robust, truth), 0.1);
    EXPECT_EQ(robust.centroid, squares.centroid);
  }
}

TEST(RobustPlane, IsTheLeastSquaresPlaneOfAPlane) {
  PointCloud cloud;
  for (int i = 0; i < 3000; ++i) {
    const double x = uniform(-1, 1), y = uniform(-2, 2);
    cloud.positions.emplace_back(x + 7, y - 3, 0.3 * x - 0.2 * y);
  }
  EXPECT_LT(degrees_off(fit_regression_plane(cloud, upwards({0, 0, 1}, PlaneMethod::robust)),
                        Vector3d(-0.3, 0.2, 1)),
            1e-6);
}

TEST(RobustPlane, TurnsWithTheCloud) {
  const PointCloud cloud = ground_with_rocks(false);
  const Matrix3d turn = rotation_about({1, 2, 3}, 20);
  const Vector3d normal = axes_of(fit_regression_plane(cloud, upwards({0, 0, 1}))).col(2);
  const PointCloud turned = moved(cloud, turn, {4, 5, 6});
  EXPECT_LT(degrees_off(fit_regression_plane(turned, upwards({0, 0, 1})), turn * normal), 0.01);
}

class InBlocks : public libmap::PointStream {
 public:
  explicit InBlocks(const PointCloud& cloud) : cloud_(cloud) {}
  void for_each_block(Need need, const Visit& visit) const override {
    for (std::size_t begin = 0; begin < cloud_.size(); begin += block_points) {
      std::vector<std::size_t> indices(std::min(block_points, cloud_.size() - begin));
      std::iota(indices.begin(), indices.end(), begin);
      PointCloud block = libmap::select_points(cloud_, indices);
      if (need == Need::positions) block.normals.clear();
      visit(block);
    }
  }

 private:
  const PointCloud& cloud_;
};

TEST(RegressionPlane, SameBitsFromBlocks) {
  PointCloud cloud = bumpy_ground(2 * libmap::PointStream::block_points + 12345);
  cloud.positions[3].x() = nan;
  const auto expect_same = [&] {
    const RegressionPlane whole = fit_regression_plane(cloud);
    const RegressionPlane blocks = fit_regression_plane(InBlocks(cloud));
    EXPECT_EQ(blocks.centroid, whole.centroid);
    EXPECT_EQ(blocks.terrain_from_input.matrix(), whole.terrain_from_input.matrix());
    EXPECT_EQ(blocks.rmse_m, whole.rmse_m);
    EXPECT_EQ(blocks.relief_skewness, whole.relief_skewness);
    EXPECT_EQ(blocks.up_source, whole.up_source);
    EXPECT_EQ(blocks.points, whole.points);
    EXPECT_EQ(blocks.skipped, 1u);
  };
  expect_same();
  cloud.normals.assign(cloud.size(), Eigen::Vector3f(0, 0.1F, -1));
  expect_same();
  cloud.viewpoint.translation() = Vector3d(0, 0, 3);
  expect_same();
}

TEST(RegressionPlane, NormalsAndViewpointMoveAlong) {
  PointCloud cloud = moved(bumpy_ground(300), rotation_about({1, 0, 0}, 30), {0, 0, 1});
  cloud.normals.assign(300, rotation_about({1, 0, 0}, 30).col(2).cast<float>());
  cloud.viewpoint.translation() = Vector3d(0, -3, 5);
  const RegressionPlane plane = fit_regression_plane(cloud);
  for (const PlaneMethod method : {PlaneMethod::thesis, PlaneMethod::corrected}) {
    const PointCloud terrain = libgtd::transform_to_terrain(cloud, plane, method);
    EXPECT_GT(terrain.viewpoint.translation().z(), 0);
    EXPECT_GT(terrain.normals[0].z(), 0.9F);
    for (std::size_t i = 0; i < cloud.size(); ++i)
      ASSERT_LT((terrain.positions[i] - plane.terrain_from_input * cloud.positions[i]).norm(),
                method == PlaneMethod::thesis ? 1e-6 : 1e-12);
  }
}

}  // namespace regression_plane_test
