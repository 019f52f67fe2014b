#include "libgtd/scenario_io.h"

#include <gtest/gtest.h>

#include "libgtd/gripper/gripper_io.h"
#include "libmap/core/data_folder.h"
#include "libmap/core/error.h"
#include "tests/support/test_support.h"

namespace scenario_io_test {

using graspmap_test::error_of;
const auto scratch = [](const char* name) { return graspmap_test::scratch_folder() / name; };

TEST(ReadScenario, EveryScenarioOfTheToolkit) {
  int count = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(libmap::data_folder() / "scenarios")) {
    const auto options = libgtd::read_scenario(entry.path().stem().string());
    ASSERT_TRUE(options.gripper);
    const auto expected = libgtd::find_gripper(options.scenario.gripper);
    EXPECT_EQ(options.gripper->palm_diameter_mm, expected.palm_diameter_mm);
    ++count;
  }
  EXPECT_GE(count, 5);
}

TEST(ReadScenario, OverridesReachTheGripper) {
  graspmap_test::write_text(
      scratch("s.yaml"), "gripper: hubrobo\nvoxel_size_m: 0.002\ngripper.palm_diameter_mm: 33\n");
  const auto options = libgtd::read_scenario(scratch("s.yaml").string());
  EXPECT_EQ(options.scenario.voxel_size_m, 0.002);
  EXPECT_EQ(options.gripper->palm_diameter_mm, 33.0);
  EXPECT_EQ(options.gripper->opening_angle_deg, libgtd::find_gripper("hubrobo").opening_angle_deg);
}

TEST(ReadScenario, ErrorsNameFileAndField) {
  EXPECT_EQ(error_of([] { libgtd::read_scenario("no_such"); }).context().value, "no_such");
  graspmap_test::write_text(scratch("s.yaml"), "voxel_size_m: -1\n");
  const libmap::Error error = error_of([] { libgtd::read_scenario(scratch("s.yaml").string()); });
  EXPECT_EQ(error.context().file, scratch("s.yaml").string());
  EXPECT_EQ(error.context().field, "voxel_size_m");
  graspmap_test::write_text(scratch("s.yaml"), "gripper: nobodys\n");
  EXPECT_EQ(error_of([] { libgtd::read_scenario(scratch("s.yaml").string()); }).context().value,
            "nobodys");
}

// The gripper of the scenario is used, not a default gripper.
TEST(Detection, UsesTheGripperOfItsScenario) {
  libgtd::DetectionOptions options;
  options.scenario.gripper = "hubrobo";
  options.scenario.gripper_overrides = {{"palm_diameter_mm", "41"}};
  EXPECT_EQ(libgtd::gripper_of(options).palm_diameter_mm, 41.0);
  options.gripper = libgtd::find_gripper("scar-e");
  EXPECT_EQ(libgtd::gripper_of(options).palm_diameter_mm,
            libgtd::find_gripper("scar-e").palm_diameter_mm);
}

}  // namespace scenario_io_test
