#include "libmap/fusion/surface_voxels.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "libmap/fusion/tile_mask.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace surface_voxels_test {

using graspmap_test::random_engine;
using graspmap_test::uniform;

TEST(SurfaceVoxels, MeansAreWeighted) {
  SurfaceVoxels voxels;
  voxels.add({0.25F, -0.5F, 7.5F}, {0, 0, 1}, 1.0F);
  voxels.add({0.75F, -0.5F, 7.9F}, {0, 0, 1}, 3.0F);
  ASSERT_EQ(voxels.size(), 1U);
  EXPECT_EQ(unpack(voxels.index().keys()[0]).cell, Eigen::Vector3i(0, -1, 7));
  const SurfaceVoxels::Sum& sum = voxels.sums()[0];
  EXPECT_FLOAT_EQ(sum.offset.x() / sum.weight, 0.125F);
  EXPECT_NEAR(sum.offset.z() / sum.weight, 0.3F, 1e-5F);
}

TEST(SurfaceVoxels, SidesOfASheetStayApart) {
  SurfaceVoxels all;
  for (int frame = 0; frame < 4; ++frame) {
    SurfaceVoxels one;
    const float side = frame % 2 == 0 ? 1.0F : -1.0F;
    one.add({0.5F, 0.5F, 0.5F + 0.2F * side}, {0, 0, side}, 1.0F);
    all.merge(std::move(one).take_frame(), {});
  }
  ASSERT_EQ(all.size(), 2U);
  for (const SurfaceVoxels::Sum& sum : all.sums()) {
    EXPECT_EQ(sum.frames, 2U);
    EXPECT_FLOAT_EQ(sum.offset.z(), 0.2F * sum.normal.z());
  }
}

TEST(SurfaceVoxels, PlacesBeyondTheGridAreLeftOut) {
  SurfaceVoxels voxels;
  voxels.add({2e6F, 0, 0}, {0, 0, 1}, 1.0F);
  voxels.add({0, std::numeric_limits<float>::quiet_NaN(), 0}, {0, 0, 1}, 1.0F);
  voxels.add({0, 0, -std::numeric_limits<float>::infinity()}, {0, 0, 1}, 1.0F);
  EXPECT_EQ(voxels.size(), 0U);
}

// A plane through the voxels, thick by a voxel of noise, dense enough to fill each column.
SurfaceVoxels thick_plane(const Eigen::Vector3f& normal, int half) {
  SurfaceVoxels voxels;
  for (int n = 0; n < 400 * half * half; ++n) {
    Eigen::Vector3f position(static_cast<float>(uniform(-half, half)),
                             static_cast<float>(uniform(-half, half)), 0);
    position.z() = -(normal.x() * position.x() + normal.y() * position.y()) / normal.z();
    voxels.add(position + static_cast<float>(uniform(-0.4, 0.4)) * normal, normal, 1.0F);
  }
  return voxels;
}

TEST(SurfaceVoxels, OneElementAColumn) {
  const Eigen::Vector3f normal = Eigen::Vector3f(0.3F, -0.2F, 1).normalized();
  const SurfaceVoxels voxels = thick_plane(normal, 10);
  const std::vector<SurfaceElement> elements = surface_elements(voxels, false);
  std::map<std::pair<int, int>, int> columns;
  for (const SurfaceElement& element : elements) {
    EXPECT_FALSE(element.extended);
    EXPECT_NEAR(element.position.dot(normal), 0, 0.4) << "nearer than the noise is wide";
    EXPECT_FLOAT_EQ(element.position.x() - std::floor(element.position.x()), 0.5F);
    ++columns[{static_cast<int>(std::floor(element.position.x())),
               static_cast<int>(std::floor(element.position.y()))}];
  }
  EXPECT_LT(elements.size(), voxels.size());
  std::size_t single = 0;
  for (int x = -9; x < 9; ++x)
    for (int y = -9; y < 9; ++y) {
      EXPECT_GE((columns[{x, y}]), 1);
      single += columns[{x, y}] == 1 ? 1 : 0;
    }
  EXPECT_GT(single, 18U * 18U * 9U / 10U);
}

TEST(SurfaceVoxels, EdgesReachOneVoxelFurther) {
  SurfaceVoxels voxels;
  for (int x = 0; x < 5; ++x)
    for (int y = 0; y < 5; ++y)
      voxels.add({static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F, 0.4F}, {0, 0, 1}, 1);
  std::set<std::pair<int, int>> beyond;
  for (const SurfaceElement& element : surface_elements(voxels, true)) {
    EXPECT_NEAR(element.position.z(), 0.4F, 1e-6F);
    const int x = static_cast<int>(std::floor(element.position.x()));
    const int y = static_cast<int>(std::floor(element.position.y()));
    const bool is_outside = x < 0 || y < 0 || x > 4 || y > 4;
    EXPECT_EQ(element.extended, is_outside) << x << " " << y;
    if (is_outside) {
      EXPECT_TRUE(beyond.insert({x, y}).second) << "duplicate";
    }
  }
  EXPECT_EQ(beyond.size(), 20U) << "four sides of five, no corners";
}

TEST(SurfaceVoxels, OrderDependsOnTheVoxelsAlone) {
  std::vector<Eigen::Vector3f> places;
  for (int n = 0; n < 500; ++n)
    places.emplace_back(static_cast<float>(static_cast<int>(uniform(-20, 20))) + 0.5F,
                        static_cast<float>(static_cast<int>(uniform(-20, 20))) + 0.5F, 0.5F);
  SurfaceVoxels forward;
  SurfaceVoxels backward;
  for (std::size_t n = 0; n < places.size(); ++n) {
    forward.add(places[n], {0, 0, 1}, 1.0F);
    backward.add(places[places.size() - 1 - n], {0, 0, 1}, 1.0F);
  }
  const auto a = surface_elements(forward, true);
  const auto b = surface_elements(backward, true);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t n = 0; n < a.size(); ++n) EXPECT_EQ(a[n].position, b[n].position);
}

}  // namespace surface_voxels_test
}  // namespace libmap
