#include "libmap/report/report_reader.h"

#include <gtest/gtest.h>

#include "libmap/core/file_output.h"
#include "libmap/image/image_codec.h"
#include "libmap/report/found_outline.h"
#include "libmap/report/outline_io.h"
#include "tests/support/lower_limit.h"
#include "tests/support/sanitizers.h"
#include "tests/support/test_support.h"

namespace report_reader_test {

namespace fs = std::filesystem;
using graspmap_test::error_of;
using graspmap_test::scratch_folder;
using libmap::Outline;
using libmap::ReportContent;

void put(const std::string& name, const std::string& text) {
  fs::create_directories((scratch_folder() / name).parent_path());
  graspmap_test::write_text(scratch_folder() / name, text);
}

void put_manifest(const std::string& output, const std::string& command,
                  const std::vector<libmap::ManifestInput>& inputs = {}, bool is_map = false) {
  libmap::Manifest manifest;
  manifest.command = command;
  manifest.version = "0";
  manifest.inputs = inputs;
  manifest.timings_s = {{"read", 0.5}};
  if (is_map) manifest.results.emplace_back("scored_voxels", std::int64_t{9});
  put(output + ".json", libmap::to_json(manifest));
}

const libmap::MapLoader no_map = [](const fs::path&, const auto&) -> libmap::MapView {
  throw libmap::Error("not a map");
};

libmap::ReportScene triangle(const fs::path& path) {
  if (path.filename() != "good.ply") throw libmap::Error("is no scene");
  libmap::ReportScene scene;
  scene.mesh.vertices = {{0.0, 0.0, 0.0}, {2.0, 0.0, 0.0}, {0.0, 1.0, 0.0}};
  scene.mesh.triangles = {{0, 1, 2}};
  return scene;
}

ReportContent read(const Outline& outline, const libmap::MapLoader& loader = no_map) {
  return libmap::read_report_content(outline, {.folder = scratch_folder()}, loader, triangle)
      .content;
}

ReportContent read(const std::string& items) {
  return read(libmap::parse_outline("title: t\nitems:\n" + items, "o.yaml"));
}

TEST(ReportReader, WhatIsMissingIsAGap) {
  put("a.csv", "x\n1\n");
  const ReportContent content = read(
      "  - picture: [no.png, none.svg]\n"
      "  - table: no.csv\n"
      "  - map: no.pcd\n"
      "  - parameters: no.pcd\n"
      "  - values: [{label: a, file: no.json, at: /a}]\n"
      "  - timings: [{name: a, folder: no}]\n"
      "  - listing: no.txt\n"
      "  - table: $GRASPMAP_NONE/a.csv\n"
      "  - table: a.csv\n");
  for (std::size_t n = 0; n < 8; ++n) {
    ASSERT_FALSE(content.items[n].gaps.empty()) << n;
    EXPECT_EQ(content.items[n].gaps[0].reason, "") << n;
  }
  EXPECT_EQ(content.items[0].gaps.size(), 2U);
  EXPECT_EQ(content.items[0].gaps[1].file, "none.svg");
  EXPECT_EQ(content.items[3].gaps[0].file, "no.pcd.json");
  EXPECT_TRUE(content.items[8].gaps.empty());
}

TEST(ReportReader, ASectionWithoutWhatItRequiresIsOneGap) {
  const ReportContent content =
      read(libmap::parse_outline("title: t\nsections:\n  - {heading: h, folder: real, requires: "
                                 "map.pcd, items: [{note: n}]}\n",
                                 "o.yaml"));
  EXPECT_TRUE(content.sections[0].items.empty());
  ASSERT_EQ(content.sections[0].gaps.size(), 1U);
  EXPECT_EQ(content.sections[0].gaps[0].file, "real/map.pcd");
}

TEST(ReportReader, WhatIsBrokenSaysWhy) {
  const std::string png = libmap::encode_png(libmap::ColorImage(20, 20, {1, 2, 3}));
  put("broken.png", png.substr(0, png.size() - 20));
  put("ragged.csv", "a,b\n1\n");
  put("map.pcd", "no map");
  put("map.pcd.json", "{\"version\": ");
  put("s.json", "{\"a\": 1}");
  const ReportContent content = read(
      "  - picture: broken.png\n"
      "  - table: ragged.csv\n"
      "  - map: map.pcd\n"
      "  - parameters: map.pcd\n"
      "  - values: [{label: a, file: s.json, at: /b}, {label: a, file: s.json, at: no pointer}]\n");
  for (const libmap::ReportItem& item : content.items) {
    ASSERT_FALSE(item.gaps.empty());
    EXPECT_NE(item.gaps[0].reason, "");
  }
  EXPECT_EQ(content.items[2].gaps[0].reason, "not a map");
  EXPECT_EQ(content.items[4].gaps.size(), 2U);
  ASSERT_EQ(content.sources.size(), 1U);
  EXPECT_NE(content.sources[0].error, "");
}

TEST(ReportReader, ListingsOfLongLines) {
  const std::string long_line(9000, 'n');
  put("a.txt", "first\n\n" + long_line + "\n" + std::string(4095, 'm') + "\nlast");
  const auto text_of = [](const std::string& file) {
    return std::get<libmap::ReportListing>(read("  - listing: " + file + "\n").items[0].body);
  };
  EXPECT_EQ(text_of("a.txt").text, "first\n\n" + std::string(400, 'n') + " ...\n" +
                                       std::string(400, 'm') + " ...\nlast\n");
  put("endless.txt", "a");
  fs::resize_file(scratch_folder() / "endless.txt", std::uintmax_t{160} << 20U);
  const graspmap_test::LowerLimit limit(
      graspmap_test::memory_can_be_limited ? RLIMIT_DATA : RLIMIT_CORE, std::uint64_t{1} << 28U);
  EXPECT_EQ(text_of("endless.txt").text.substr(0, 1), "a");
}

TEST(ReportReader, ValuesAndTimesOfManifests) {
  put("one/map.pcd", "");
  put_manifest("one/map.pcd", "score");
  put("one/top.png", "");
  put_manifest("one/top.png", "render");
  const ReportContent content = read(
      "  - values: [{label: v, file: one/map.pcd.json, at: /run/timings_s/read, unit: s}]\n"
      "  - timings: [{name: a, folder: one}, {name: b, files: one/map.pcd}]\n"
      "  - parameters: one/map.pcd\n");
  EXPECT_EQ(std::get<libmap::ReportValues>(content.items[0].body)[0].value, "0.5");
  const auto& times = std::get<libmap::TimingTable>(content.items[1].body);
  ASSERT_EQ(times.rows.size(), 1U);  // pictures are not timed
  EXPECT_EQ(times.rows[0].seconds[0], 0.5);
  EXPECT_EQ(times.rows[0].seconds[1], 0.5);
  EXPECT_EQ(content.sources.size(), 2U);
}

TEST(ReportReader, MarkersHaveTheNamesAndVerdictsOfTheirRows) {
  put("map.pcd", "");
  put("look.csv",
      "place,x,y,z,graspable,score,map_graspable\nA,0,0,0,1,0.9,0\nB,1,0,0,0,0.1,0\nC,2,0,0,,0.5,"
      "1\n");
  // Here it is the map's own: no verdict.
  put("plain.csv", "place,x,y,z,graspable,score\nA,0,0,0,1,0.9\n");
  const Outline outline = libmap::parse_outline(
      "title: t\nitems:\n  - {map: map.pcd, lookup: look.csv, columns: [place, score]}\n"
      "  - {map: map.pcd, lookup: plain.csv}\n  - {map: map.pcd, lookup: plain.csv, verdict: "
      "graspable}\n",
      "o");
  const ReportContent content = read(outline, [](const fs::path& map, const auto& lookup) {
    EXPECT_EQ(map.filename(), "map.pcd");
    EXPECT_TRUE(lookup);
    libmap::MapView view;
    view.markers.resize(3);
    return view;
  });
  const auto& map = std::get<libmap::ReportMap>(content.items[0].body);
  EXPECT_EQ(map.view.markers[0].label, "A");
  EXPECT_EQ(map.view.markers[0].verdict, true);
  EXPECT_EQ(map.view.markers[1].verdict, false);
  EXPECT_FALSE(map.view.markers[2].verdict);
  EXPECT_FALSE(std::get<libmap::ReportMap>(content.items[1].body).view.markers[0].verdict);
  EXPECT_TRUE(std::get<libmap::ReportMap>(content.items[2].body).view.markers[0].verdict);
  EXPECT_EQ(map.locations->table.rows[2], (std::vector<std::string>{"C", "0.5"}));
}

TEST(FoundOutline, OfAFolder) {
  put("scene.png", "");
  put("2_b/map.pcd", "");
  put("10_c/table.csv", "a\n1\n");
  put_manifest("2_b/map.pcd", "convert", {{"tiles/1-of-1.pcd", "", 1}}, true);
  put("2_b/cloud.pcd", "");
  put_manifest("2_b/cloud.pcd", "convert", {{"cloud.ply", "", 1}});
  put("2_b/map.ply", "");
  put_manifest("2_b/map.ply", "convert", {{"map.pcd", "", 1}}, true);
  put("2_b/lookup.csv", "place,graspable,score\nA,1,0.5\n");
  put_manifest("2_b/lookup.csv", "lookup", {{"elsewhere/map.pcd", "", 1}});
  put("2_b/oblique.png", "");
  put("2_b/roc.png", "");
  put("2_b/evaluation/roc.svg", "");
  put("2_b/evaluation/roc.png", "");
  put("2_b/tiles/1-of-2.pcd", "");
  put_manifest("2_b/tiles/1-of-2.pcd", "score");
  put("2_b/.hidden/a.png", "");
  fs::create_directory_symlink(scratch_folder(), scratch_folder() / "2_b/loop");
  const Outline outline = libmap::outline_of_folder(scratch_folder());
  ASSERT_EQ(outline.sections.size(), 3U);
  EXPECT_EQ(outline.sections[0].heading, "2 B");
  EXPECT_EQ(outline.sections[1].heading, "10 C");
  EXPECT_EQ(outline.sections[2].heading, "Running times");
  const auto& section = outline.sections[0];
  ASSERT_EQ(section.items.size(), 2U);  // one map, and its pictures without roc.png
  EXPECT_EQ(section.items[0].files[0], "map.pcd");
  EXPECT_EQ(section.items[0].lookup, "lookup.csv");
  EXPECT_EQ(section.items[0].picture, "oblique.png");
  EXPECT_EQ(section.items[0].columns.size(), 3U);
  EXPECT_EQ(section.items[1].files, std::vector<std::string>{"oblique.png"});
  ASSERT_EQ(section.sections.size(), 1U);  // not the tiles, not the loop
  EXPECT_EQ(section.sections[0].items[0].files, std::vector<std::string>{"roc.svg"});
  // The shares' times are those of the map.
  const ReportContent content = read(outline);
  const auto& times = std::get<libmap::TimingTable>(content.sections[2].items[0].body);
  EXPECT_EQ(times.rows[0].command, "score");
}

// Of several maps in one folder and below it: each manifest's time counts once.
TEST(FoundOutline, OfMapsTogether) {
  for (const char* map : {"a.pcd", "b.pcd", "sub/map.pcd", "sub/second.pcd", "sub/c/deep.pcd"}) {
    put(map, "");
    put_manifest(map, "score");
  }
  put("oblique.png", "");
  put_manifest("oblique.png", "render", {{"a.pcd", "", 1}});
  put("sub/top.png", "");
  put("sub/evaluation/roc.csv", "a\n1\n");
  put_manifest("sub/evaluation", "evaluate");
  const Outline outline = libmap::outline_of_folder(scratch_folder());
  EXPECT_EQ(outline.items[0].labels,
            (std::vector<std::string>{"a.pcd", "b.pcd", "sub/map.pcd", "sub/second.pcd", "sub/c"}));
  EXPECT_EQ(outline.items[1].picture, "oblique.png");
  EXPECT_EQ(outline.items[2].picture, "");
  EXPECT_EQ(outline.sections[0].items[0].picture, "") << "of which of the two maps?";
  const auto& cases = outline.sections.back().items[0].cases;
  ASSERT_EQ(cases.size(), 3U);
  EXPECT_EQ(cases[0].name, scratch_folder().filename().string());
  EXPECT_EQ(cases[0].files.size(), 3U);
  EXPECT_EQ(cases[1].name, "sub");
  EXPECT_EQ(cases[1].files,
            (std::vector<std::string>{"sub/evaluation", "sub/map.pcd", "sub/second.pcd"}));
  EXPECT_EQ(cases[2].name, "sub/c");
  EXPECT_EQ(cases[2].files, std::vector<std::string>{"sub/c/deep.pcd"});
}

TEST(ReportReader, Scenes) {
  put("good.ply", "");
  put("bad.ply", "");
  const ReportContent content =
      read("  - scene: good.ply\n  - scene: bad.ply\n  - scene: none.ply\n");
  EXPECT_EQ(std::get<libmap::ReportScene>(content.items[0].body).mesh.vertices.size(), 3U);
  EXPECT_EQ(content.items[1].gaps.at(0).reason, "is no scene");
  EXPECT_EQ(content.items[2].gaps.at(0).reason, "");
}

TEST(FoundOutline, ScenesOfGrasp) {
  libmap::Manifest manifest;
  manifest.command = "grasp";
  manifest.version = "0";
  manifest.results = {{"locations", std::int64_t{2}}, {"P10.ply", "holds"}, {"P2.ply", "fails"}};
  put("scenes.json", libmap::to_json(manifest));
  for (const char* name : {"P10.ply", "P2.ply", "other.ply", "locations"})
    put(std::string("scenes/") + name, "");
  const Outline outline = libmap::outline_of_folder(scratch_folder());
  const auto& items = outline.sections.at(0).items;
  ASSERT_EQ(items.size(), 2U);
  EXPECT_EQ(items[0].kind, libmap::ItemKind::scene);
  EXPECT_EQ(items[0].files, std::vector<std::string>{"P2.ply"});
  EXPECT_EQ(items[0].caption, "P2: fails.");
  EXPECT_EQ(items[1].caption, "P10: holds.");
}

TEST(FoundOutline, OfNothing) {
  EXPECT_NE(std::string(error_of([] { libmap::outline_of_folder(scratch_folder()); }).what())
                .find("nothing that a report could show"),
            std::string::npos);
  EXPECT_NE(std::string(error_of([] { libmap::outline_of_folder(scratch_folder() / "no"); }).what())
                .find("no such folder"),
            std::string::npos);
  put("file", "");
  EXPECT_THROW(libmap::outline_of_folder(scratch_folder() / "file"), libmap::Error);
  EXPECT_THROW(
      libmap::read_report_content({}, {.folder = scratch_folder() / "file"}, no_map, triangle),
      libmap::Error);
}

}  // namespace report_reader_test
