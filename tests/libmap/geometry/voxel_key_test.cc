#include "libmap/geometry/voxel_key.h"

#include <gtest/gtest.h>

#include <map>

#include "tests/support/test_support.h"

namespace libmap {
namespace voxel_key_test {

using graspmap_test::uniform;

TEST(VoxelKey, RoundTrip) {
  for (int n = 0; n < 1000; ++n) {
    VoxelSide place;
    for (int axis = 0; axis < 3; ++axis)
      place.cell[axis] = static_cast<int>(uniform(-voxel_cell_limit, voxel_cell_limit));
    place.side = n % 2;
    const VoxelSide back = unpack(pack(place));
    EXPECT_EQ(back.cell, place.cell);
    EXPECT_EQ(back.side, place.side);
  }
}

TEST(VoxelIndex, AgreesWithAMap) {
  VoxelIndex index;
  std::map<std::uint64_t, std::uint32_t> truth;
  const auto random_key = [](double reach) {
    VoxelSide place;
    for (int axis = 0; axis < 3; ++axis)
      place.cell[axis] = static_cast<int>(uniform(-reach, reach));
    place.side = uniform(0, 1) < 0.5 ? 0 : 1;
    return pack(place);
  };
  for (int n = 0; n < 20000; ++n) {
    const std::uint64_t key = random_key(9);
    const auto [at, is_new] = truth.try_emplace(key, static_cast<std::uint32_t>(truth.size()));
    ASSERT_EQ(index.find_or_add(key), at->second);
    const std::uint64_t asked = random_key(12);
    const auto known = truth.find(asked);
    ASSERT_EQ(index.find(asked), known == truth.end() ? VoxelIndex::none : known->second);
  }
  EXPECT_EQ(index.size(), truth.size());
}

// The order of keys is by x, then y, then z, then side.
TEST(VoxelKey, AscendWithTheCell) {
  const auto key = [](int x, int y, int z, int side) { return pack({{x, y, z}, side}); };
  EXPECT_LT(key(-1, 9, 9, 1), key(0, -9, -9, 0));
  EXPECT_LT(key(4, -1, 9, 1), key(4, 0, -9, 0));
  EXPECT_LT(key(4, 7, -1, 1), key(4, 7, 0, 0));
  EXPECT_LT(key(4, 7, -1, 0), key(4, 7, -1, 1));
}

// Each octant of a cube of 2^n voxels is one part of the curve.
TEST(VoxelKey, TheCurveGoesThroughOctantsOneByOne) {
  const auto on_curve = [](int x, int y, int z) { return z_order(pack({{x, y, z}, 0})); };
  const std::uint64_t first = on_curve(0, 0, 0);
  EXPECT_EQ(on_curve(7, 7, 7) - first, 2U * 511U);
  EXPECT_EQ(on_curve(0, 0, 1) - first, 2U);
  EXPECT_EQ(on_curve(0, 1, 0) - first, 4U);
  EXPECT_EQ(on_curve(1, 0, 0) - first, 8U);
  EXPECT_EQ(on_curve(2, 2, 2) - first, 2U * 56U);
}

}  // namespace voxel_key_test
}  // namespace libmap
