#include "libgtd/gripper/gripper_mask.h"

#include <gtest/gtest.h>

#include "libgtd/gripper/gripper_io.h"
#include "libmap/core/error.h"
#include "tests/support/reference_data.h"
#include "tests/support/test_support.h"

namespace {

using libgtd::Gripper;
using libgtd::GripperMask;
using libgtd::Method;

Gripper gripper_named(const std::string& name) {
  return libgtd::read_gripper(graspmap_test::source_folder() / "data/grippers" / (name + ".yaml"));
}

struct MaskCase {
  const char* file;
  const char* gripper;
  double opening_angle_deg;
  Method method;
  double voxel_size_m;
  int extra_void_layers;
  bool top_first;  // ClimbLab's file begins with the top layer
};

void PrintTo(const MaskCase& given, std::ostream* out) { *out << given.file; }

class ReferenceMask : public testing::TestWithParam<MaskCase> {};

TEST_P(ReferenceMask, EveryVoxelAgrees) {
  GRASPMAP_REQUIRE_REFERENCE();
  const MaskCase& given = GetParam();
  Gripper gripper = gripper_named(given.gripper);
  gripper.opening_angle_deg = given.opening_angle_deg;
  const GripperMask mask = libgtd::make_gripper_mask(
      gripper, {given.method, given.voxel_size_m, given.extra_void_layers});
  const auto reference = graspmap_test::read_mask(graspmap_test::reference_folder() / given.file);
  ASSERT_EQ(reference.dims, (std::array<int, 3>{mask.side, mask.side, mask.layers}));
  int differences = 0;
  for (int z = 0; z < mask.layers; ++z)
    for (int x = 0; x < mask.side; ++x)
      for (int y = 0; y < mask.side; ++y) {
        const int layer = given.top_first ? mask.layers - 1 - z : z;
        differences += mask.is_solid(x, y, z) != (reference.at(x, y, layer) != 0);
      }
  EXPECT_EQ(differences, 0);
}

INSTANTIATE_TEST_SUITE_P(All, ReferenceMask,
                         testing::Values(MaskCase{"gtd/mask.thesis.scar-e.10mm.txt", "scar-e", 85,
                                                  Method::thesis, 0.01, 1, false},
                                         MaskCase{"gtd/mask.thesis.scar-e.5mm.txt", "scar-e", 85,
                                                  Method::thesis, 0.005, 5, false},
                                         MaskCase{"gtd/mask.thesis.hubrobo.1mm.txt", "hubrobo", 75,
                                                  Method::thesis, 0.001, 3, false},
                                         MaskCase{"gtd/mask.envelope.scar-e.10mm.txt", "scar-e", 80,
                                                  Method::envelope, 0.01, 1, false},
                                         MaskCase{"gtd/mask.envelope.hubrobo.1mm.txt", "hubrobo",
                                                  75, Method::envelope, 0.001, 3, false},
                                         MaskCase{"climblab/mask.hubrobo.1mm.txt", "hubrobo", 75,
                                                  Method::climblab, 0.001, 0, true}));

}  // namespace
