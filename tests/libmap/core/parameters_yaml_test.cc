#include <gtest/gtest.h>

#include "libmap/core/parameters.h"
#include "tests/support/test_support.h"

namespace parameters_yaml_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using libmap::ParameterTable;

enum class Shape { round, square };

struct Options {
  double size_m = 0.01;
  int layers = 1;
  bool fill = false;
  std::string name = "default";
  Shape shape = Shape::square;
  std::vector<std::pair<std::string, std::string>> overrides;

  void bind(ParameterTable& table) {
    table.add("size_m", size_m, libmap::positive, "edge, m");
    table.add("layers", layers, {-10, 10}, "layers");
    table.add("fill", fill, "fill gaps");
    table.add("name", name, "a name");
    table.add("shape", shape, {{"round", Shape::round}, {"square", Shape::square}}, "the shape");
    table.add_overrides("gripper", overrides);
  }
};

class ParametersYaml : public testing::Test {
 protected:
  ParametersYaml() { options.bind(table); }
  void read(const std::string& yaml) { libmap::set_from_yaml(table, yaml, "s.yaml"); }
  libmap::Error refusal(const std::string& yaml) {
    return error_of([&] { read(yaml); });
  }
  Options options;
  ParameterTable table;
};

TEST_F(ParametersYaml, ReadsAFlatMap) {
  read(
      "# a scenario\nsize_m: 0.5   # m\nlayers: -3\nfill: yes\n'name': \"a: b\"\n"
      "shape: round\ngripper.angle_deg: 80\n");
  EXPECT_EQ(options.size_m, 0.5);
  EXPECT_EQ(options.layers, -3);
  EXPECT_TRUE(options.fill);
  EXPECT_EQ(options.name, "a: b");
  EXPECT_EQ(options.shape, Shape::round);
  EXPECT_EQ(options.overrides.at(0).second, "80");
}

TEST_F(ParametersYaml, NothingSetsNothing) {
  for (const char* yaml : {"", "\n", "# nothing\n", "---\n", "{}"}) read(yaml);
  EXPECT_EQ(options.size_m, 0.01);
}

TEST_F(ParametersYaml, UnknownKeyNamesTheNearest) {
  EXPECT_TRUE(is_error(refusal("size_m: 1\nlayer: 2\n"),
                       {.file = "s.yaml", .field = "layer", .about = "'layers'"}));
  EXPECT_EQ(options.size_m, 0.01) << "keys are known before the first is set";
}

TEST_F(ParametersYaml, KeyThatStandsTwice) {
  EXPECT_TRUE(
      is_error(refusal("layers: 1\nfill: no\nlayers: 2\n"), {.file = "s.yaml", .field = "layers"}));
  EXPECT_TRUE(
      is_error(refusal("gripper.a: 1\ngripper.a: 2\n"), {.file = "s.yaml", .field = "gripper.a"}));
}

TEST_F(ParametersYaml, ValueThatIsNoScalar) {
  for (const char* value : {"[1, 2]", "{a: 1}", "", "~", "\n  - 1"})
    EXPECT_TRUE(is_error(refusal("layers: " + std::string(value) + "\n"),
                         {.file = "s.yaml", .field = "layers"}))
        << value;
}

TEST_F(ParametersYaml, WrongValueNamesTheFile) {
  EXPECT_TRUE(is_error(refusal("size_m: -1\n"),
                       {.file = "s.yaml", .field = "size_m", .value = "-1", .bound = "> 0"}));
  EXPECT_TRUE(is_error(refusal("size_m: .nan\n"),
                       {.file = "s.yaml", .field = "size_m", .value = ".nan", .bound = "> 0"}));
}

TEST_F(ParametersYaml, WhatIsNoMap) {
  for (const char* yaml : {"- 1\n", "word", "[a, b]", "42"})
    EXPECT_TRUE(is_error(refusal(yaml), {.file = "s.yaml"})) << yaml;
}

TEST_F(ParametersYaml, WhatIsNoYaml) {
  for (const std::string& yaml :
       {std::string("a: b: c\n"), std::string("layers: [1\n"), std::string("\"open"),
        std::string("\tlayers: 1"), std::string("layers: *nothing\n"),
        std::string("? [a, b]\n: 1\n"), std::string(100000, '['), std::string(100000, '{'),
        std::string("layers: 1\n\x01\n")}) {
    const libmap::Error error = error_of([&] { read(yaml); });
    EXPECT_EQ(error.context().file, "s.yaml") << yaml.substr(0, 40);
  }
  EXPECT_EQ(options.layers, 1);
}

TEST_F(ParametersYaml, SecondDocumentIsNotSilentlyDropped) {
  EXPECT_EQ(error_of([&] { read("layers: 2\n---\nlayers: 3\n"); }).context().file, "s.yaml");
}

TEST_F(ParametersYaml, WrittenTableReadsBack) {
  options.size_m = 1e-7;
  options.layers = -4;
  options.fill = true;
  options.name = "yes: # \"no\" \\ \xC3\xA4 '";
  options.shape = Shape::round;
  options.overrides = {{"angle_deg", "80"}, {"name", "null"}};
  Options other;
  ParameterTable other_table;
  other.bind(other_table);
  libmap::set_from_yaml(other_table, libmap::to_yaml(table), "printed");
  EXPECT_EQ(other.size_m, options.size_m);
  EXPECT_EQ(other.layers, options.layers);
  EXPECT_EQ(other.fill, options.fill);
  EXPECT_EQ(other.name, options.name);
  EXPECT_EQ(other.shape, options.shape);
  EXPECT_EQ(other.overrides, options.overrides);
  EXPECT_EQ(libmap::to_yaml(other_table), libmap::to_yaml(table));
}

TEST_F(ParametersYaml, AwkwardTextsReadBack) {
  for (const char* text : {"", " ", "~", "null", "1e5", "-", "a\nb", "#", "'", "{", "*x", "!t"}) {
    options.name = text;
    const std::string yaml = libmap::to_yaml(table);
    options.name = "changed";
    read(yaml);
    EXPECT_EQ(options.name, text) << yaml;
    options.overrides.clear();
  }
}

TEST_F(ParametersYaml, EachLineCarriesItsDescription) {
  EXPECT_NE(libmap::to_yaml(table).find("size_m: 0.01  # edge, m\n"), std::string::npos);
}

}  // namespace parameters_yaml_test
