#include "libmap/fusion/surface_refinement.h"

#include <gtest/gtest.h>

#include <cmath>

#include "libmap/core/parallel.h"
#include "tests/libmap/fusion/depth_scenes.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace surface_refinement_test {

using graspmap_test::looking;
using graspmap_test::nearest_of;
using graspmap_test::plane_z;
using graspmap_test::random_engine;
using graspmap_test::small_camera;
using graspmap_test::sphere;
using graspmap_test::Surface;
using graspmap_test::uniform;

const DepthSensor sensor;
constexpr SurfaceSearch search{.disc_radius_m = 0.03, .search_m = 0.01};

Pose optical(const Pose& world_from_base) { return world_from_base * optical_to_body_rotation(); }

RefinementView view_of(const DepthImage& depth, const Pose& grid_from_camera, std::uint32_t frame) {
  CameraView view;
  view.depth_camera = view.color_camera = small_camera();
  view.depth = depth;
  return make_refinement_view(std::move(view),
                              std::make_shared<const PixelRays>(pixel_rays(small_camera())),
                              grid_from_camera.inverse(), frame);
}

RefinementView view_of(const Surface& surface, const Pose& grid_from_camera, std::uint32_t frame) {
  return view_of(
      graspmap_test::render_depth(surface, small_camera(), grid_from_camera, {}, random_engine()),
      grid_from_camera, frame);
}

SurfaceElement element_at(const Eigen::Vector3f& position) {
  return {.position = position, .normal = Eigen::Vector3f::UnitZ()};
}

RefinedSurface refined(std::vector<SurfaceElement> elements,
                       const std::vector<RefinementView>& views, double pose_error_m = 0.0) {
  return refine_surface(std::move(elements), sensor, search, pose_error_m,
                        [&](const AddViews& add) { add(views); });
}

// Cameras on a ring, looking down at the origin.
std::vector<RefinementView> ring(const Surface& surface, int count) {
  std::vector<RefinementView> views;
  for (int n = 0; n < count; ++n) {
    const Eigen::Vector3d eye(0.5 * std::cos(n), 0.5 * std::sin(n), 1.0);
    views.push_back(
        view_of(surface, optical(looking(eye, {0, 0, 0})), static_cast<std::uint32_t>(n)));
  }
  return views;
}

TEST(SurfaceRefinement, ElementsMoveOntoThePlane) {
  std::vector<SurfaceElement> elements;
  for (int n = 0; n < 200; ++n)
    elements.push_back(
        element_at(Eigen::Vector3d(uniform(-0.1, 0.1), uniform(-0.1, 0.1), uniform(-0.01, 0.01))
                       .cast<float>()));
  const RefinedSurface surface = refined(elements, ring(plane_z(0), 4));
  ASSERT_EQ(surface.refined.size(), elements.size());
  EXPECT_FALSE(surface.has_color);
  for (std::size_t n = 0; n < elements.size(); ++n) {
    const RefinedElement& one = surface.refined[n];
    ASSERT_NEAR(one.shift_m, -elements[n].position.z(), 1e-6);
    EXPECT_EQ(one.frames, 4U);
    EXPECT_EQ(one.seen_through, 0.0F);
    EXPECT_EQ(one.missed, 0.0F);
    // Half of the shift counts as a possible error, beside the noise.
    EXPECT_GT(one.expected_error_m, 0.5F * std::abs(one.shift_m));
  }
}

TEST(SurfaceRefinement, ViewsThatSeeThroughAnElementOrMissIt) {
  const Pose above = optical(looking({0, 0, 1}, {0, 0, 0}));
  DepthImage hole(small_camera().width, small_camera().height, 1.0F);
  for (int y = 40; y < 56; ++y)
    for (int x = 56; x < 72; ++x) hole.at(x, y) = 0.0F;
  hole.at(0, 0) = 2.0F;  // farthest measurement
  hole.at(1, 0) = 0.5F;
  const std::vector<RefinementView> views = {view_of(plane_z(0), above, 0),
                                             view_of(hole, above, 1)};
  const RefinedSurface surface =
      refined({element_at({0, 0, 0}), element_at({0, 0, 0.3F}), element_at({0, 0, -0.3F})}, views);
  const auto& [on, over, under] =
      std::tie(surface.refined[0], surface.refined[1], surface.refined[2]);
  EXPECT_EQ(on.frames, 1U);
  EXPECT_NEAR(on.seen, 1.0F, 1e-3F);
  EXPECT_NEAR(on.missed, 1.0F, 1e-3F) << "by the second view";
  EXPECT_EQ(over.frames, 0U);
  EXPECT_NEAR(over.seen_through, 1.0F, 1e-3F);
  EXPECT_EQ(under.frames, 0U);
  EXPECT_EQ(under.seen_through, 0.0F) << "it is hidden";
  EXPECT_EQ(under.seen, 0.0F);
}

// A near frame measures 1 mm too high, a distant one 1 mm too low.
std::vector<RefinementView> contrary_views() {
  const Pose near = optical(looking({0, 0, 0.5}, {0, 0, 0}));
  const Pose far = optical(looking({0, 0, 2.0}, {0, 0, 0}));
  return {view_of(plane_z(0.001), near, 0), view_of(plane_z(-0.001), far, 1)};
}

TEST(SurfaceRefinement, PoseErrorPreventsTheNearestFrameFromDominating) {
  const std::vector<SurfaceElement> one = {element_at({0, 0, 0})};
  EXPECT_GT(refined(one, contrary_views()).refined[0].shift_m, 0.0009F);
  const RefinedElement even = refined(one, contrary_views(), 0.1).refined[0];
  EXPECT_NEAR(even.shift_m, 0.0F, 2e-5F);
  EXPECT_GT(even.expected_error_m, 0.05F);
}

TEST(SurfaceRefinement, CamerasOfOneFrameCountOnce) {
  std::vector<RefinementView> views = ring(plane_z(0), 3);
  for (RefinementView& view : views) view.frame = 7;
  EXPECT_EQ(refined({element_at({0, 0, 0})}, views).refined[0].frames, 1U);
}

TEST(SurfaceRefinement, ObservationsAreTheHeightsOfEachFrame) {
  const std::vector<SurfaceElement> elements = {element_at({0, 0, 0}), element_at({9, 9, 9}),
                                                element_at({0.02F, 0.01F, 0.0005F})};
  const auto found = observe_surface(elements, contrary_views(), sensor, search);
  ASSERT_EQ(found.size(), 4U);
  for (std::size_t n = 0; n < found.size(); ++n) {
    EXPECT_EQ(found[n].element, n < 2 ? 0U : 2U);
    EXPECT_EQ(found[n].frame, n % 2);
    const float height = n % 2 == 0 ? 0.001F : -0.001F;
    EXPECT_NEAR(found[n].height_m, height - elements[found[n].element].position.z(), 1e-6);
  }
  EXPECT_LT(found[0].variance_m2, found[1].variance_m2) << "the nearer frame has less noise";
}

// The gate is 4 standard deviations of depth plus the search, at an incidence of 0 degrees.
TEST(SurfaceRefinement, DepthsBeyondTheGateHaveNoWeight) {
  const Pose above = optical(looking({0, 0, 1}, {0, 0, 0}));
  const double gate = 4 * sensor.noise.axial_at(1.0) + search.search_m;
  EXPECT_GE(max_gate_m(sensor, search), gate);
  const std::vector<SurfaceElement> one = {element_at({0, 0, 0})};
  EXPECT_EQ(refined(one, {view_of(plane_z(0.95 * gate), above, 0)}).refined[0].frames, 1U);
  EXPECT_EQ(refined(one, {view_of(plane_z(1.1 * gate), above, 0)}).refined[0].frames, 0U);
}

TEST(SurfaceRefinement, GroupsAndThreadsDoNotChangeTheBits) {
  std::vector<SurfaceElement> elements;
  for (int n = 0; n < 1000; ++n)
    elements.push_back(
        element_at(Eigen::Vector3d(uniform(-0.3, 0.3), uniform(-0.3, 0.3), uniform(-0.02, 0.02))
                       .cast<float>()));
  const std::vector<RefinementView> views =
      ring(nearest_of({plane_z(0), sphere({0, 0, -0.1}, 0.2)}), 6);
  const RefinedSurface at_once = refined(elements, views);
  const ThreadLimit limit(1);
  const RefinedSurface one_by_one =
      refine_surface(elements, sensor, search, 0.0, [&](const AddViews& add) {
        for (const RefinementView& view : views) add({&view, 1});
      });
  for (std::size_t n = 0; n < elements.size(); ++n) {
    ASSERT_EQ(at_once.refined[n].shift_m, one_by_one.refined[n].shift_m);
    ASSERT_EQ(at_once.refined[n].expected_error_m, one_by_one.refined[n].expected_error_m);
    ASSERT_EQ(at_once.refined[n].seen, one_by_one.refined[n].seen);
  }
}

}  // namespace surface_refinement_test
}  // namespace libmap
