#include "libgtd/gripper/gripper.h"

#include <gtest/gtest.h>

#include "libgtd/gripper/gripper_io.h"
#include "libgtd/gripper/gripper_mask.h"
#include "tests/support/test_support.h"

namespace gripper_test {

using graspmap_test::error_of;
using libgtd::Gripper;

std::filesystem::path file_of(const std::string& name) {
  return graspmap_test::source_folder() / "data/grippers" / (name + ".yaml");
}

std::string yaml_of(const std::string& name) { return graspmap_test::read_text(file_of(name)); }

// Returns the file with the line of `key` replaced, or dropped for an empty `line`.
std::string with_line(std::string yaml, const std::string& key, const std::string& line) {
  const std::size_t start = yaml.find(key + ":");
  const std::size_t end = yaml.find('\n', start) + 1;
  return yaml.replace(start, end - start, line.empty() ? "" : line + "\n");
}

// Tab. 3-2 of the thesis.
TEST(Grippers, HoldThePublishedMeasures) {
  const Gripper scar_e = libgtd::read_gripper(file_of("scar-e"));
  EXPECT_EQ(scar_e.palm_diameter_mm, 71);
  EXPECT_EQ(scar_e.finger_joint_diameter_mm, 92);
  EXPECT_EQ(scar_e.finger_length_mm, 40);
  EXPECT_EQ(scar_e.spine_length_mm, 41);
  EXPECT_EQ(scar_e.opening_angle_deg, 85);
  EXPECT_EQ(scar_e.closing_angle_deg, 10);
  EXPECT_EQ(scar_e.opening_spine_radius_mm, 136);
  EXPECT_EQ(scar_e.closing_height_mm, 90);
  const Gripper hubrobo = libgtd::read_gripper(file_of("hubrobo"));
  EXPECT_EQ(hubrobo.palm_diameter_mm, 32);
  EXPECT_EQ(hubrobo.opening_angle_deg, 75);
  EXPECT_EQ(hubrobo.closing_angle_deg, 30);
  EXPECT_EQ(hubrobo.closing_height_mm, 16);
  EXPECT_EQ(libgtd::read_gripper(file_of("limbero")).closing_angle_deg, 42);
}

TEST(Grippers, AnOverrideReplacesAMeasure) {
  EXPECT_EQ(
      libgtd::read_gripper(file_of("scar-e"), {{"opening_angle_deg", "80"}}).opening_angle_deg, 80);
  EXPECT_EQ(error_of([] {
              libgtd::read_gripper(file_of("scar-e"), {{"opening_angel_deg", "80"}});
            })
                .context()
                .field,
            "opening_angel_deg");
}

struct BadGripper {
  const char* key;
  const char* line;
};
void PrintTo(const BadGripper& bad, std::ostream* out) { *out << bad.key << ": " << bad.line; }

class BadGripperFile : public testing::TestWithParam<BadGripper> {};

TEST_P(BadGripperFile, NamesFileAndKey) {
  const std::string yaml = with_line(yaml_of("scar-e"), GetParam().key, GetParam().line);
  const libmap::Error error = error_of([&] { libgtd::parse_gripper(yaml, "mine.yaml"); });
  EXPECT_EQ(error.context().file, "mine.yaml");
  const std::string line = GetParam().line;
  const std::string key = line.empty() ? GetParam().key : line.substr(0, line.find(':'));
  EXPECT_EQ(error.context().field, key) << error.what();
}

INSTANTIATE_TEST_SUITE_P(All, BadGripperFile,
                         testing::Values(BadGripper{"finger_length_mm", "finger_length_mm: -40"},
                                         BadGripper{"finger_length_mm", "finger_length_mm: 0"},
                                         BadGripper{"spine_length_mm", "spine_length_mm: .nan"},
                                         BadGripper{"spine_length_mm", "spine_length_mm: long"},
                                         BadGripper{"opening_angle_deg", "opening_angle_deg: 91"},
                                         BadGripper{"closing_angle_deg", "closing_angle_deg: 86"},
                                         BadGripper{"closing_angle_deg", "closing_angle_deg: 85"},
                                         BadGripper{"palm_diameter_mm", "palm_diamter_mm: 71"},
                                         BadGripper{"palm_diameter_mm", ""},
                                         BadGripper{"spine_depth_mm", "spine_depth_mm: [5]"}));

TEST(GripperMaskErrors, NameTheVoxelSize) {
  const Gripper gripper = libgtd::read_gripper(file_of("scar-e"));
  for (const auto& [name, method] : libgtd::method_names())
    for (const double size : {0.0, -1.0, 10.0, 0.2, 1e-5, 1e-8, 1e-300}) {
      const libgtd::GripperMaskOptions options = {method, size, 1};
      const libmap::Error error = error_of([&] { libgtd::make_gripper_mask(gripper, options); });
      EXPECT_EQ(error.context().field, "voxel_size_m") << name << " " << size;
    }
  EXPECT_EQ(error_of([&] {
              libgtd::make_gripper_mask(gripper, {libgtd::Method::corrected, 0.01, -1});
            })
                .context()
                .field,
            "extra_void_layers");
}

TEST(GripperMask, ExtraLayersAreVoidAndOnTop) {
  const Gripper gripper = libgtd::read_gripper(file_of("scar-e"));
  for (const libgtd::Method method :
       {libgtd::Method::thesis, libgtd::Method::envelope, libgtd::Method::corrected}) {
    const auto bare = libgtd::make_gripper_mask(gripper, {method, 0.01, 0});
    const auto layered = libgtd::make_gripper_mask(gripper, {method, 0.01, 4});
    ASSERT_EQ(layered.layers, bare.layers + 4);
    EXPECT_TRUE(std::equal(bare.solid.begin(), bare.solid.end(), layered.solid.begin()));
    for (std::size_t n = bare.solid.size(); n < layered.solid.size(); ++n)
      EXPECT_EQ(layered.solid[n], 0);
  }
}

TEST(GripperMask, TextHasALineForEachRow) {
  const auto mask = libgtd::make_gripper_mask(libgtd::read_gripper(file_of("scar-e")),
                                              {libgtd::Method::thesis, 0.01, 1});
  const std::string text = to_text(mask);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 2 + mask.layers * (mask.side + 1));
  EXPECT_EQ(
      std::count(text.begin() + static_cast<std::ptrdiff_t>(text.find("z 0")), text.end(), '1'),
      std::count(mask.solid.begin(), mask.solid.end(), 1) + 1);  // plus the digit of "z 1"
}

}  // namespace gripper_test
