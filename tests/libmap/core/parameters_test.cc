#include "libmap/core/parameters.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/test_support.h"

namespace parameters_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using libmap::ParameterTable;
using libmap::Range;

enum class Shape { round, square };

struct Options {
  double size_m = 0.01;
  double height_m = -1.5;
  int layers = 1;
  std::uint64_t seed = 3;
  bool fill = false;
  std::string name = "default";
  Shape shape = Shape::square;
  std::vector<std::pair<std::string, std::string>> overrides;

  void bind(ParameterTable& table) {
    table.add("size_m", size_m, libmap::positive, "edge, m");
    table.add("height_m", height_m, libmap::any_number, "height, m");
    table.add("layers", layers, {0, 10}, "layers");
    table.add("seed", seed, libmap::any_number, "seed");
    table.add("fill", fill, "fill gaps");
    table.add("name", name, "a name");
    table.add("shape", shape, {{"round", Shape::round}, {"square", Shape::square}}, "the shape");
    table.add_overrides("gripper", overrides);
  }
};

void bind(ParameterTable& table, Options& options) { options.bind(table); }

class ParametersTest : public testing::Test {
 protected:
  ParametersTest() { options.bind(table); }
  libmap::Error refusal(const std::string& key, const std::string& value) {
    return error_of([&] { table.set(key, value); });
  }
  Options options;
  ParameterTable table;
};

TEST(Parameters, FieldsOutsideTheirBoundsAreNamed) {
  const auto refused = [](const auto& change) {
    Options options;
    change(options);
    return error_of([&] { libmap::check_parameters(options); });
  };
  EXPECT_NO_THROW(libmap::check_parameters(Options{.seed = ~std::uint64_t{0}, .overrides = {}}));
  EXPECT_TRUE(is_error(refused([](Options& o) { o.size_m = 0; }),
                       {.field = "size_m", .value = "0", .bound = "> 0"}));
  EXPECT_TRUE(is_error(refused([](Options& o) { o.height_m = std::nan(""); }),
                       {.field = "height_m", .value = "nan"}));
  EXPECT_TRUE(is_error(refused([](Options& o) { o.layers = 11; }),
                       {.field = "layers", .value = "11", .bound = ">= 0 and <= 10"}));
  EXPECT_TRUE(is_error(refused([](Options& o) { o.shape = static_cast<Shape>(7); }),
                       {.field = "shape", .bound = "one of round square"}));
}

TEST(Parameters, TheFirstChangedKey) {
  EXPECT_EQ(libmap::changed_key<Options>({}, bind), std::nullopt);
  Options options;
  options.name = "other";
  options.fill = true;
  EXPECT_EQ(libmap::changed_key(options, bind), "fill");
}

TEST_F(ParametersTest, FormerKeys) {
  table.add_former_key("edge_m", "size_m");
  const auto keys = libmap::set_from_yaml(table, "edge_m: 0.5\n", "old.yaml");
  EXPECT_EQ(options.size_m, 0.5);
  EXPECT_EQ(keys, std::vector<std::string>{"size_m"});
  EXPECT_TRUE(is_error(refusal("edge_m", "0"), {.field = "size_m", .value = "0", .bound = "> 0"}));
  const auto both =
      error_of([&] { libmap::set_from_yaml(table, "size_m: 1\nedge_m: 2\n", "old.yaml"); });
  EXPECT_TRUE(is_error(both, {.file = "old.yaml", .field = "edge_m"}));
  EXPECT_EQ(options.size_m, 0.5);
}

TEST(Parameters, SectionsOfAFile) {
  int count = 0;
  double angle = 0.0;
  ParameterTable table;
  table.add("count", count, {0, 10}, "number");
  table.add("part.angle", angle, libmap::positive, "angle");
  EXPECT_EQ(libmap::set_from_yaml(table, "part:\n  angle: 2\ncount: 3\n", "f"),
            (std::vector<std::string>{"count", "part.angle"}));
  EXPECT_EQ(count, 3);
  EXPECT_EQ(angle, 2.0);
  const auto field = [&](const std::string& yaml) {
    return error_of([&] { libmap::set_from_yaml(table, yaml, "f"); }).context().field;
  };
  EXPECT_EQ(field("part: {angel: 2}"), "part.angel");
  EXPECT_EQ(field("part: {angle: [2]}"), "part.angle");
  EXPECT_EQ(field("part: 1"), "part");
  EXPECT_EQ(field("part.angle: 1\npart: {angle: 1}"), "part.angle");
  EXPECT_EQ(field("other: {angle: 1}"), "other");
  EXPECT_EQ(
      error_of([&] { libmap::set_from_yaml(table, "part: {angle: -1}", "f"); }).context().file,
      "f");
  EXPECT_EQ(count, 3);
}

TEST_F(ParametersTest, GetsAndSetsTheFields) {
  EXPECT_EQ(table.find("size_m")->get(), "0.01");
  EXPECT_EQ(table.find("shape")->get(), "square");
  EXPECT_EQ(table.find("fill")->get(), "false");
  table.set("size_m", "0.25");
  table.set("height_m", " -3e-2 ");
  table.set("layers", "10");
  table.set("seed", "9000000000000000000");
  table.set("fill", "yes");
  table.set("name", " a: b # c ");
  table.set("shape", "round");
  EXPECT_EQ(options.size_m, 0.25);
  EXPECT_EQ(options.height_m, -0.03);
  EXPECT_EQ(options.layers, 10);
  EXPECT_EQ(options.seed, 9000000000000000000U);
  EXPECT_TRUE(options.fill);
  EXPECT_EQ(options.name, " a: b # c ");
  EXPECT_EQ(options.shape, Shape::round);
}

TEST_F(ParametersTest, ErrorsNameKeyValueAndBound) {
  EXPECT_TRUE(is_error(refusal("size_m", "0"), {.field = "size_m", .value = "0", .bound = "> 0"}));
  EXPECT_TRUE(
      is_error(refusal("size_m", "-1"), {.field = "size_m", .value = "-1", .bound = "> 0"}));
  EXPECT_TRUE(
      is_error(refusal("size_m", "wide"), {.field = "size_m", .value = "wide", .bound = "> 0"}));
  EXPECT_TRUE(
      is_error(refusal("size_m", "0,01"), {.field = "size_m", .value = "0,01", .bound = "> 0"}));
  EXPECT_TRUE(is_error(refusal("height_m", "nan"),
                       {.field = "height_m", .value = "nan", .bound = "a finite number"}));
  EXPECT_TRUE(is_error(refusal("height_m", "inf"),
                       {.field = "height_m", .value = "inf", .bound = "a finite number"}));
  EXPECT_TRUE(is_error(refusal("layers", "11"),
                       {.field = "layers", .value = "11", .bound = ">= 0 and <= 10"}));
  EXPECT_TRUE(is_error(refusal("layers", "1.5"),
                       {.field = "layers", .value = "1.5", .bound = ">= 0 and <= 10"}));
  EXPECT_TRUE(is_error(refusal("seed", "-1"), {.field = "seed", .value = "-1", .bound = ">= 0"}));
  EXPECT_TRUE(is_error(refusal("fill", "maybe"),
                       {.field = "fill", .value = "maybe", .bound = "true or false"}));
  EXPECT_TRUE(is_error(
      refusal("shape", "rond"),
      {.field = "shape", .value = "rond", .bound = "one of round square", .about = "'round'"}));
  EXPECT_TRUE(is_error(refusal("sise_m", "1"), {.field = "sise_m", .about = "'size_m'"}));
  EXPECT_EQ(options.size_m, 0.01) << "a refused value changes nothing";
  EXPECT_EQ(options.layers, 1);
  EXPECT_EQ(options.shape, Shape::square);
}

TEST(ParameterRange, IntegerThatDoesNotFitIsRefused) {
  int field = 1;
  ParameterTable table;
  table.add("n", field, libmap::any_number, "");
  for (const char* text : {"2147483648", "-2147483649", "9223372036854775807"})
    EXPECT_TRUE(is_error(error_of([&] { table.set("n", text); }), {.field = "n", .value = text}));
  EXPECT_EQ(field, 1);
  table.set("n", "-2147483648");
  EXPECT_EQ(field, -2147483647 - 1);
}

TEST(ParameterRange, OpenEndsExcludeTheirValue) {
  double field = 0.5;
  ParameterTable table;
  table.add("open", field, Range{0, 90, true, true}, "");
  table.add("closed", field, libmap::zero_to_one, "");
  EXPECT_TRUE(is_error(error_of([&] { table.set("open", "0"); }),
                       {.field = "open", .value = "0", .bound = "> 0 and < 90"}));
  EXPECT_TRUE(is_error(error_of([&] { table.set("open", "90"); }),
                       {.field = "open", .value = "90", .bound = "> 0 and < 90"}));
  table.set("open", "89.9");
  table.set("closed", "0");
  table.set("closed", "1");
  EXPECT_TRUE(is_error(error_of([&] { table.set("closed", "1.0000001"); }),
                       {.field = "closed", .value = "1.0000001", .bound = ">= 0 and <= 1"}));
}

TEST(ParameterRange, Descriptions) {
  EXPECT_EQ(libmap::describe(libmap::positive), "> 0");
  EXPECT_EQ(libmap::describe(libmap::not_negative), ">= 0");
  EXPECT_EQ(libmap::describe(libmap::zero_to_one), ">= 0 and <= 1");
  EXPECT_EQ(libmap::describe(libmap::any_number), "a finite number");
  EXPECT_EQ(libmap::describe({0, 90, true, true}), "> 0 and < 90");
}

TEST_F(ParametersTest, KeysStandInTheirOrder) {
  EXPECT_EQ(table.keys(), (std::vector<std::string>{"size_m", "height_m", "layers", "seed", "fill",
                                                    "name", "shape"}));
  EXPECT_EQ(table.find("shape")->choices, (std::vector<std::string>{"round", "square"}));
  EXPECT_EQ(table.find("none"), nullptr);
}

TEST_F(ParametersTest, OverridesAreKeptAsText) {
  EXPECT_TRUE(table.knows("gripper.angle_deg"));
  EXPECT_FALSE(table.knows("gripper."));
  EXPECT_FALSE(table.knows("gripper"));
  EXPECT_FALSE(table.knows("griper.angle_deg"));
  table.set("gripper.angle_deg", "80");
  ASSERT_EQ(options.overrides.size(), 1U);
  EXPECT_EQ(options.overrides[0], (std::pair<std::string, std::string>{"angle_deg", "80"}));
  EXPECT_EQ(table.values().back(),
            (std::pair<std::string, std::string>{"gripper.angle_deg", "80"}));
}

TEST_F(ParametersTest, TheLastOverrideOfAKeyHolds) {
  table.set("gripper.angle_deg", "70");
  table.set("gripper.name", "x");
  table.set("gripper.angle_deg", "80");
  EXPECT_EQ(options.overrides,
            (std::vector<std::pair<std::string, std::string>>{{"angle_deg", "80"}, {"name", "x"}}));
}

TEST(ParameterFlags, UnitsAreLeftOut) {
  EXPECT_EQ(libmap::flag_of("voxel_size_m"), "--voxel-size");
  EXPECT_EQ(libmap::flag_of("palm_diameter_mm"), "--palm-diameter");
  EXPECT_EQ(libmap::flag_of("opening_angle_deg"), "--opening-angle");
  EXPECT_EQ(libmap::flag_of("width_px"), "--width");
  EXPECT_EQ(libmap::flag_of("delay_s"), "--delay");
  EXPECT_EQ(libmap::flag_of("extra_void_layers"), "--extra-void-layers");
  EXPECT_EQ(libmap::flag_of("max"), "--max");
}

}  // namespace parameters_test
