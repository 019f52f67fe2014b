#include "libgtd/gripper/gripper_mask.h"

#include <gtest/gtest.h>

#include "libgtd/gripper/gripper_io.h"
#include "libmap/core/error.h"
#include "tests/support/reference_data.h"
#include "tests/support/test_support.h"

namespace gripper_mask_test {

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
  bool top_first;  // the ClimbLab file starts with the top layer
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

// Few voxels in total, but more than an integer along one side.
TEST(GripperMask, MeasuresFarApart) {
  Gripper flat = gripper_named("scar-e");
  flat.closing_height_mm = 1e-300;
  flat.finger_length_mm = 1e30;
  for (const auto& [name, method] : libgtd::method_names()) {
    const libmap::Error error = graspmap_test::error_of([&, method = method] {
      libgtd::make_gripper_mask(flat, {.method = method, .voxel_size_m = 0.01});
    });
    EXPECT_EQ(error.context().field, "voxel_size_m") << name;
    EXPECT_TRUE(graspmap_test::is_error(error, {.field = "voxel_size_m", .value = "0.01"}))
        << error.what();
  }
  // Its voxels per millimeter are infinite in single precision.
  Gripper tiny = gripper_named("scar-e");
  for (double* measure :
       {&tiny.palm_diameter_mm, &tiny.finger_joint_diameter_mm, &tiny.finger_length_mm,
        &tiny.spine_length_mm, &tiny.closing_height_mm, &tiny.opening_spine_radius_mm})
    *measure = 1e-40;
  for (const Method method : {Method::thesis, Method::envelope, Method::climblab}) {
    const libmap::Error error = graspmap_test::error_of(
        [&] { libgtd::make_gripper_mask(tiny, {.method = method, .voxel_size_m = 1e-44}); });
    EXPECT_TRUE(graspmap_test::is_error(error, {.field = "voxel_size_m"})) << error.what();
  }
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

}  // namespace gripper_mask_test
