#include "libmap/view/scene_camera.h"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "tests/support/test_support.h"

namespace libmap {
namespace scene_camera_test {

using graspmap_test::error_of;
using graspmap_test::uniform;

const PixelRect plot{20.0, 30.0, 640.0, 400.0};
const Eigen::Vector2d middle(340.0, 230.0);

SceneCamera unit_cross_seen(Viewpoint view) {
  std::vector<Eigen::Vector3d> cross;
  for (int axis = 0; axis < 3; ++axis)
    for (const double sign : {-1.0, 1.0}) cross.push_back(sign * Eigen::Vector3d::Unit(axis));
  return fit_camera(view, {}, cross, 0.0, plot);
}

TEST(SceneCamera, TopHasXRightAndYUp) {
  const SceneCamera camera = unit_cross_seen(Viewpoint::top);
  EXPECT_NEAR((camera.pixel_of({0, 0, 0}) - middle).norm(), 0.0, 1e-9);
  // The height is what limits: 0.9 * 400 pixels for 2 m.
  EXPECT_NEAR((camera.pixel_of({1, 0, 0}) - middle - Eigen::Vector2d(180, 0)).norm(), 0.0, 1e-9);
  EXPECT_NEAR((camera.pixel_of({0, 1, 0}) - middle - Eigen::Vector2d(0, -180)).norm(), 0.0, 1e-9);
  EXPECT_LT(camera.depth_of({0, 0, 1}), camera.depth_of({0, 0, -1}));
  EXPECT_GT(camera.depth_of({0, 0, 1}), 0.0);
}

TEST(SceneCamera, FrontLooksAlongYAndSideAlongMinusX) {
  const SceneCamera front = unit_cross_seen(Viewpoint::front);
  EXPECT_GT(front.pixel_of({1, 0, 0}).x(), middle.x());
  EXPECT_LT(front.pixel_of({0, 0, 1}).y(), middle.y());
  EXPECT_LT(front.depth_of({0, -1, 0}), front.depth_of({0, 1, 0}));
  const SceneCamera side = unit_cross_seen(Viewpoint::side);
  EXPECT_GT(side.pixel_of({0, 1, 0}).x(), middle.x());
  EXPECT_LT(side.pixel_of({0, 0, 1}).y(), middle.y());
  EXPECT_LT(side.depth_of({1, 0, 0}), side.depth_of({-1, 0, 0}));
}

TEST(SceneCamera, ObliqueStandsInFrontOnTheLeftAndAbove) {
  const SceneCamera camera = unit_cross_seen(Viewpoint::oblique);
  EXPECT_LT(camera.position.x(), 0.0);
  EXPECT_LT(camera.position.y(), 0.0);
  EXPECT_GT(camera.position.z(), 0.0);
  EXPECT_TRUE(camera.perspective);
  EXPECT_GT(camera.pixel_of({1, 0, 0}).x(), camera.pixel_of({-1, 0, 0}).x());
  EXPECT_LT(camera.pixel_of({0, 0, 1}).y(), camera.pixel_of({0, 0, -1}).y());
}

// Any scene is shown completely, not too small, centered, and with a proper rotation.
TEST(SceneCamera, FitsAnyCloud) {
  for (int round = 0; round < 100; ++round) {
    const Eigen::Vector3d size(std::pow(10.0, uniform(-3, 3)), std::pow(10.0, uniform(-3, 3)),
                               std::pow(10.0, uniform(-3, 3)));
    const Eigen::Vector3d offset = 1e4 * Eigen::Vector3d(uniform(-1, 1), uniform(-1, 1), 0.0);
    std::vector<Eigen::Vector3d> points;
    for (int i = 0; i < 200; ++i)
      points.push_back(offset + size.cwiseProduct(Eigen::Vector3d(uniform(-1, 1), uniform(-1, 1),
                                                                  uniform(-1, 1))));
    for (const Viewpoint view :
         {Viewpoint::top, Viewpoint::front, Viewpoint::side, Viewpoint::oblique}) {
      const SceneCamera camera = fit_camera(view, {}, points, 0.0, plot);
      EXPECT_NEAR(camera.right.cross(camera.up).dot(-camera.forward), 1.0, 1e-12);
      Eigen::Vector2d low = camera.pixel_of(points.front());
      Eigen::Vector2d high = low;
      for (const Eigen::Vector3d& point : points) {
        ASSERT_GT(camera.depth_of(point), 0.0);
        low = low.cwiseMin(camera.pixel_of(point));
        high = high.cwiseMax(camera.pixel_of(point));
      }
      const double slack = 0.01;
      EXPECT_GE(low.x(), plot.left + 32.0 - slack);
      EXPECT_LE(high.x(), plot.right() - 32.0 + slack);
      EXPECT_GE(low.y(), plot.top + 20.0 - slack);
      EXPECT_LE(high.y(), plot.bottom() - 20.0 + slack);
      const double filled = std::max((high.x() - low.x()) / (0.9 * plot.width),
                                     (high.y() - low.y()) / (0.9 * plot.height));
      EXPECT_NEAR(filled, 1.0, view == Viewpoint::oblique ? 0.2 : 1e-3);
    }
  }
}

TEST(SceneCamera, APlacedCameraIsAPinhole) {
  CameraPlacement placement;
  placement.position = {0, 0, 10};
  placement.focal_point = {0, 0, 0};
  placement.up = {0, 3, 0.5};
  placement.field_of_view_deg = 90.0;
  const SceneCamera camera = fit_camera(Viewpoint::camera, placement, {{0, 0, 0}}, 0.0, plot);
  EXPECT_NEAR((camera.pixel_of({0, 0, 3}) - middle).norm(), 0.0, 1e-9);
  // 45 degrees off the axis is the upper edge.
  EXPECT_NEAR((camera.pixel_of({0, 10, 0}) - Eigen::Vector2d(340, 30)).norm(), 0.0, 1e-9);
  EXPECT_NEAR((camera.pixel_of({1, 0, 8}) - Eigen::Vector2d(440, 230)).norm(), 0.0, 1e-9);
}

TEST(SceneCamera, RefusesCamerasThatCannotBe) {
  const auto camera_error = [](const CameraPlacement& placement) {
    return error_of([&] { fit_camera(Viewpoint::camera, placement, {{0, 0, 0}}, 0.0, plot); });
  };
  CameraPlacement placement;
  placement.focal_point = placement.position;
  EXPECT_EQ(camera_error(placement).context().field, "camera");
  placement = {};
  placement.up = placement.focal_point - placement.position;
  EXPECT_EQ(camera_error(placement).context().field, "camera up");
  placement.up.setZero();
  EXPECT_EQ(camera_error(placement).context().field, "camera up");
  for (const double angle : {0.0, 180.0, -1.0, std::nan("")}) {
    placement = {};
    placement.field_of_view_deg = angle;
    EXPECT_EQ(camera_error(placement).context().field, "field_of_view_deg") << angle;
  }
}

}  // namespace scene_camera_test
}  // namespace libmap
