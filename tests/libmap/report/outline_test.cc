#include <gtest/gtest.h>

#include "libmap/report/outline_io.h"
#include "tests/support/test_support.h"

namespace outline_test {

using graspmap_test::error_of;
using libmap::ItemKind;
using libmap::Outline;
using libmap::parse_outline;

TEST(OutlineFile, AllKinds) {
  const Outline outline = parse_outline(R"(
title: "A <study>"
text: one
items:
  - note: before all
sections:
  - heading: Scenario 1
    folder: one
    requires: map.pcd
    items:
      - map: map.pcd
        lookup: lookup.csv
        verdict: graspable
        columns: [place, {score: "score, %"}]
        picture: oblique.png
      - picture: [a.png, b.png]
        labels: [raw, interpolated]
        caption: In situ.
      - chart: roc.svg
      - table: table.csv
        rows: 7
      - parameters: map.pcd
      - values:
          - {label: AUC, file: s.json, at: /auc, published: 0.84}
      - timings:
          - {name: pre-scanned, folder: prescan}
          - {name: in situ, files: [a.pcd, b.csv]}
        commands: [score]
        published: {file: $GRASPMAP_DATA/t.csv, columns: {cpp_us: thesis}, rows: {a: b}}
      - listing: spot_check.txt
    sections:
      - heading: Inner
)",
                                        "study.yaml");
  EXPECT_EQ(outline.title, "A <study>");
  ASSERT_EQ(outline.sections.size(), 1U);
  const auto& section = outline.sections.front();
  EXPECT_EQ(section.required_file, "map.pcd");
  ASSERT_EQ(section.items.size(), 8U);
  const auto& map = section.items[0];
  EXPECT_EQ(map.kind, ItemKind::map);
  EXPECT_EQ(map.picture, "oblique.png");
  EXPECT_EQ(map.columns[1].name, "score");
  EXPECT_EQ(map.columns[1].heading, "score, %");
  EXPECT_EQ(section.items[1].files, (std::vector<std::string>{"a.png", "b.png"}));
  EXPECT_EQ(section.items[2].kind, ItemKind::picture);
  EXPECT_EQ(section.items[3].rows, 7U);
  EXPECT_EQ(section.items[5].values[0].published, "0.84");
  EXPECT_EQ(section.items[6].cases[1].files.size(), 2U);
  EXPECT_EQ(section.items[6].published.columns[0].second, "thesis");
  EXPECT_EQ(section.sections[0].heading, "Inner");
}

TEST(OutlineFile, WhatIsWrongIsNamedWithItsLine) {
  const auto error = [](const std::string& yaml) {
    return std::string(error_of([&] { parse_outline(yaml, "o.yaml"); }).what());
  };
  const std::string head = "title: a\nsections:\n  - heading: b\n";
  EXPECT_NE(error(head + "    item: []\n").find("o.yaml: line 4, key 'item'"), std::string::npos);
  EXPECT_NE(error(head + "    item: []\n").find("did you mean 'items'?"), std::string::npos);
  EXPECT_NE(error("text: a\n").find("has no 'title'"), std::string::npos);
  EXPECT_NE(
      error(head + "    items:\n      - {picture: a.png, table: b.csv}\n").find("is of two kinds"),
      std::string::npos);
  EXPECT_NE(error(head + "    items:\n      - {caption: c}\n").find("is of no kind"),
            std::string::npos);
  EXPECT_NE(error(head + "    items:\n      - {picture: [a], labels: [b, c]}\n").find("labels"),
            std::string::npos);
  EXPECT_NE(error(head + "    items:\n      - {table: a.csv, rows: many}\n").find("rows"),
            std::string::npos);
  EXPECT_NE(error(head + "    items:\n      - timings: [{name: a}]\n").find("a folder or files"),
            std::string::npos);
  EXPECT_NE(error(head + "    items:\n      - table: [a.csv, b.csv]\n").find("more than one file"),
            std::string::npos);
  for (const char* item :
       {"{table: a.csv, lookup: b.csv}", "{table: a.csv, verdict: c}", "{picture: a.png, rows: 3}",
        "{note: a, labels: [b]}", "{map: a.pcd, commands: [score]}", "{values: [], columns: [a]}"})
    EXPECT_NE(error(head + "    items:\n      - " + item + "\n").find("is not known in a item"),
              std::string::npos)
        << item;
  EXPECT_NE(error("title: [a\n").find("line 2: not valid YAML"), std::string::npos);
  EXPECT_NE(error("- a\n").find("no map of keys"), std::string::npos);
  EXPECT_NE(error("title: a\ntitle: b\n").find("is a duplicate"), std::string::npos);
  std::string deep = "title: a\n";
  std::string indent;
  for (int level = 0; level < 20; ++level) {
    deep += indent + (level == 0 ? "" : "  ") + "sections:\n" + indent + "  - heading: h\n";
    indent += "  ";
    if (level == 0) indent = "  ";
  }
  EXPECT_FALSE(error(deep).empty());
}

}  // namespace outline_test
