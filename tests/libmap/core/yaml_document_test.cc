#include "libmap/core/yaml_document.h"

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include "tests/support/test_support.h"

namespace yaml_document_test {

std::string fault_of(const std::string& text) {
  return graspmap_test::error_of([&] {
           libmap::read_yaml(text, "given.yaml",
                             [](const YAML::Node& root) { (void)root["a"].as<double>(); });
         })
      .what();
}

TEST(YamlDocument, GivesTheOneDocument) {
  double value = 0.0;
  libmap::read_yaml("a: 1.5\n", "given.yaml",
                    [&](const YAML::Node& root) { value = root["a"].as<double>(); });
  EXPECT_EQ(value, 1.5);
  bool is_null = false;
  libmap::read_yaml("# nothing\n", "given.yaml",
                    [&](const YAML::Node& root) { is_null = root.IsNull(); });
  EXPECT_TRUE(is_null);
}

TEST(YamlDocument, FaultsNameFileAndLine) {
  EXPECT_EQ(fault_of("b: 1\na: [1\n").find("given.yaml: line 3: not valid YAML: "), 0U);
  EXPECT_EQ(fault_of("b: 1\na: high\n").find("given.yaml: line 2: not valid YAML: "), 0U);
  EXPECT_EQ(fault_of("a: 1\n---\na: 2\n"), "given.yaml: contains more than one YAML document");
  EXPECT_EQ(graspmap_test::error_of([] {
              libmap::read_yaml("a: 1\n", "given.yaml", [](const YAML::Node&) {
                throw libmap::Error("is too small", {.field = "a"});
              });
            }).what(),
            std::string("given.yaml: a: is too small"));
}

// yaml-cpp finds an infinite number of documents in these texts.
TEST(YamlDocument, WhatBelongsToNoDocumentIsRefused) {
  for (const char* text : {"{a: 1}, b", "{a: 1},", ", a", "[a]\n, b"})
    EXPECT_EQ(fault_of(text), "given.yaml: contains more than one YAML document") << text;
}

// Each node takes a hundred times the memory of its text.
TEST(YamlDocument, NodesAreCounted) {
  std::string list = "a: [1";
  for (int n = 0; n < 500'000; ++n) list += ",1";
  EXPECT_EQ(fault_of(list + "]\n"), "given.yaml: contains more than 500000 values");
}

// Readers visit the nodes of an alias each time.
TEST(YamlDocument, AliasesCountAsWhatTheyStandFor) {
  std::string bomb = "l0: &l0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n";
  const auto add_level = [&](int level) {
    const std::string below = "*l" + std::to_string(level - 1);
    bomb += "l" + std::to_string(level) + ": &l" + std::to_string(level) + " [" + below;
    for (int n = 0; n < 9; ++n) bomb += ", " + below;
    bomb += "]\n";
  };
  for (int level = 1; level <= 4; ++level) add_level(level);
  double value = 0.0;
  libmap::read_yaml(bomb + "a: 1.5\n", "given.yaml",
                    [&](const YAML::Node& root) { value = root["a"].as<double>(); });
  EXPECT_EQ(value, 1.5);
  add_level(5);
  EXPECT_EQ(fault_of(bomb), "given.yaml: contains more than 500000 values");
  EXPECT_EQ(fault_of("a: &a [1, *a]\n"), "given.yaml: contains more than 500000 values");
}

// Errors without a position in the text have no line.
TEST(YamlDocument, FaultsWithoutAPlace) {
  const std::string fault = fault_of("b: 1\n");
  EXPECT_EQ(fault.find("given.yaml: not valid YAML: "), 0U) << fault;
}

TEST(YamlDocument, KeysAreKnownAndThereOnce) {
  const auto fault = [](const std::string& text) {
    const YAML::Node map = YAML::Load(text);
    return std::string(graspmap_test::error_of([&] {
                         libmap::check_keys(map, {"radius", "name"}, " of a ball");
                       }).what());
  };
  EXPECT_EQ(fault("{name: a, radus: 1}"), "radus: unknown key of a ball (did you mean 'radius'?)");
  EXPECT_EQ(fault("{name: a, name: b}"), "name: is a duplicate");
  EXPECT_EQ(fault("{[1]: a}"), "a key is not a scalar");
  EXPECT_NO_THROW(libmap::check_keys(YAML::Load("{name: a}"), {"radius", "name"}));
}

TEST(YamlDocument, ErrorsNameTheLineOfTheirNode) {
  const YAML::Node list = YAML::Load("- a\n- b\n");
  const libmap::Error error("missing", {.field = "x"});
  EXPECT_STREQ(libmap::at_node(error, "list[1]", list[1]).what(), "list[1].x (line 2): missing");
}

}  // namespace yaml_document_test
