#include "libgtd/score/voxel_matching.h"

#include <gtest/gtest.h>

#include "libgtd/gripper/gripper_io.h"
#include "tests/support/reference_data.h"
#include "tests/support/test_support.h"

namespace {

using libgtd::Gripper;
using libgtd::GripperMask;
using libgtd::Method;
using libgtd::TileBounds;
using libgtd::Voxel;
using libgtd::VoxelCounts;
using libgtd::VoxelGrid;

Gripper gripper_named(const std::string& name) {
  return libgtd::read_gripper(graspmap_test::source_folder() / "data/grippers" / (name + ".yaml"));
}

TileBounds whole(const VoxelGrid& grid) {
  return {grid.min.i, grid.max.i + 1, grid.min.j, grid.max.j + 1};
}

struct ReferenceCase {
  const char* name;
  const char* points;  // which cloud was voxelized
  const char* gripper;
  double opening_angle_deg;
  Method method;
  double voxel_size_m;
  int extra_void_layers;
};

void PrintTo(const ReferenceCase& given, std::ostream* out) { *out << given.name; }

class AuthorsProgram : public testing::TestWithParam<ReferenceCase> {
 protected:
  std::filesystem::path file(const std::string& kind) const {
    return graspmap_test::reference_folder() / "gtd" / (std::string(GetParam().name) + "." + kind);
  }
  VoxelGrid grid() const {
    return libgtd::voxelize_thesis(
        graspmap_test::read_points_f32_gz(file(std::string(GetParam().points) + ".f32.gz")),
        GetParam().voxel_size_m);
  }
};

TEST_P(AuthorsProgram, SameVoxels) {
  GRASPMAP_REQUIRE_REFERENCE();
  const VoxelGrid voxelized = grid();
  const auto reference = graspmap_test::read_voxels_gz(file("voxels.csv.gz"));
  EXPECT_EQ(reference.dims, (std::array<int, 3>{voxelized.max.i + 1, voxelized.max.j + 1,
                                                voxelized.max.k + 1}));
  ASSERT_EQ(voxelized.voxels.size(), reference.voxels.size());
  std::size_t differences = 0;
  for (std::size_t n = 0; n < reference.voxels.size(); ++n) {
    const auto& [i, j, k] = reference.voxels[n];
    differences += voxelized.voxels[n] != Voxel{i, j, k} ? 1 : 0;
  }
  EXPECT_EQ(differences, 0U);
}

TEST_P(AuthorsProgram, SameCountsOfEveryPivot) {
  GRASPMAP_REQUIRE_REFERENCE();
  const ReferenceCase& given = GetParam();
  const VoxelGrid voxelized = grid();
  Gripper gripper = gripper_named(given.gripper);
  gripper.opening_angle_deg = given.opening_angle_deg;
  const GripperMask mask = libgtd::make_gripper_mask(
      gripper, {given.method, given.voxel_size_m, given.extra_void_layers});
  const auto pivots = libgtd::pivots_in(voxelized, mask, whole(voxelized));
  const auto counts = libgtd::match_voxels(voxelized, mask, whole(voxelized), pivots);
  const auto reference = graspmap_test::read_scores_gz(file("scores.csv.gz"));
  ASSERT_EQ(pivots.size(), reference.rows.size());
  std::size_t differences = 0;
  for (std::size_t n = 0; n < pivots.size(); ++n) {
    const auto& [i, j, k, ssv, gsv] = reference.rows[n];
    differences += voxelized.voxels[pivots[n]] != Voxel{i, j, k} ? 1 : 0;
    differences += counts[n] != VoxelCounts{static_cast<std::uint32_t>(ssv),
                                            static_cast<std::uint32_t>(gsv)}
                       ? 1
                       : 0;
  }
  EXPECT_EQ(differences, 0U);
}

INSTANTIATE_TEST_SUITE_P(
    All, AuthorsProgram,
    testing::Values(ReferenceCase{"artificial_rocks.thesis", "transformed", "scar-e", 85,
                                  Method::thesis, 0.01, 1},
                    ReferenceCase{"artificial_rocks.envelope", "transformed", "scar-e", 80,
                                  Method::envelope, 0.01, 1},
                    ReferenceCase{"leaning_holds_scare.thesis", "transformed", "scar-e", 85,
                                  Method::thesis, 0.01, 1},
                    ReferenceCase{"primitive_shapes.thesis", "interpolated", "scar-e", 85,
                                  Method::thesis, 0.005, 5},
                    ReferenceCase{"leaning_holds_hubrobo.thesis", "interpolated", "hubrobo", 75,
                                  Method::thesis, 0.001, 3},
                    ReferenceCase{"leaning_holds_hubrobo.envelope", "interpolated", "hubrobo", 75,
                                  Method::envelope, 0.001, 3}));

}  // namespace
