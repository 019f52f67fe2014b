#include "libmap/core/yaml_document.h"

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include "tests/support/test_support.h"

namespace yaml_document_test {

using graspmap_test::is_error;

libmap::Error fault_of(const std::string& text) {
  return graspmap_test::error_of([&] {
    libmap::read_yaml(text, "given.yaml",
                      [](const YAML::Node& root) { (void)root["a"].as<double>(); });
  });
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
  EXPECT_TRUE(is_error(fault_of("b: 1\na: [1\n"), {.file = "given.yaml", .field = "line 3"}));
  EXPECT_TRUE(is_error(fault_of("b: 1\na: high\n"), {.file = "given.yaml", .field = "line 2"}));
  EXPECT_TRUE(is_error(fault_of("a: 1\n---\na: 2\n"), {.file = "given.yaml"}));
  EXPECT_TRUE(is_error(graspmap_test::error_of([] {
                         libmap::read_yaml("a: 1\n", "given.yaml", [](const YAML::Node&) {
                           throw libmap::Error("is too small", {.field = "a"});
                         });
                       }),
                       {.file = "given.yaml", .field = "a"}));
}

// yaml-cpp finds an infinite number of documents in these texts.
TEST(YamlDocument, WhatBelongsToNoDocumentIsRefused) {
  for (const char* text : {"{a: 1}, b", "{a: 1},", ", a", "[a]\n, b"})
    EXPECT_TRUE(is_error(fault_of(text), {.file = "given.yaml"})) << text;
}

// Each node takes a hundred times the memory of its text.
TEST(YamlDocument, NodesAreCounted) {
  std::string list = "a: [1";
  for (int n = 0; n < 500'000; ++n) list += ",1";
  EXPECT_TRUE(is_error(fault_of(list + "]\n"), {.file = "given.yaml", .about = "500000"}));
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
  EXPECT_TRUE(is_error(fault_of(bomb), {.file = "given.yaml", .about = "500000"}));
  EXPECT_TRUE(is_error(fault_of("a: &a [1, *a]\n"), {.file = "given.yaml", .about = "500000"}));
}

// Errors without a position in the text have no line.
TEST(YamlDocument, FaultsWithoutAPlace) {
  const libmap::Error fault = fault_of("b: 1\n");
  EXPECT_TRUE(is_error(fault, {.file = "given.yaml"}));
  EXPECT_EQ(fault.context().field, "");
}

TEST(YamlDocument, KeysAreKnownAndThereOnce) {
  const auto fault = [](const std::string& text) {
    const YAML::Node map = YAML::Load(text);
    return graspmap_test::error_of([&] {
      libmap::check_keys(map, {"radius", "name"}, " of a ball");
    });
  };
  EXPECT_TRUE(is_error(fault("{name: a, radus: 1}"), {.field = "radus", .about = "'radius'"}));
  EXPECT_TRUE(is_error(fault("{name: a, name: b}"), {.field = "name"}));
  EXPECT_TRUE(is_error(fault("{[1]: a}"), {.field = "key of a mapping"}));
  EXPECT_NO_THROW(libmap::check_keys(YAML::Load("{name: a}"), {"radius", "name"}));
}

TEST(YamlDocument, ErrorsNameTheLineOfTheirNode) {
  const YAML::Node list = YAML::Load("- a\n- b\n");
  const libmap::Error error("missing", {.field = "x"});
  EXPECT_TRUE(
      is_error(libmap::at_node(error, "list[1]", list[1]), {.field = "list[1].x (line 2)"}));
}

}  // namespace yaml_document_test
