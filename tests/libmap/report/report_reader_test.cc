#include "libmap/report/report_reader.h"

#include <gtest/gtest.h>

#include "libmap/camera/image_codec.h"
#include "tests/libmap/report/report_test_support.h"
#include "tests/support/lower_limit.h"
#include "tests/support/sanitizers.h"

namespace report_reader_test {

namespace fs = std::filesystem;
using graspmap_test::scratch_folder;
using libmap::ReportContent;
using report_test_support::put;
using report_test_support::put_manifest;

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

ReportContent read(const libmap::MapLoader& loader = no_map) {
  return libmap::read_report_content(libmap::plan_report(scratch_folder()),
                                     {.folder = scratch_folder()}, loader, triangle)
      .content;
}

TEST(ReportReader, WhatIsBrokenSaysWhy) {
  const std::string png = libmap::encode_png(libmap::ColorImage(20, 20, {1, 2, 3}));
  put("broken.png", png.substr(0, png.size() - 20));
  put("ragged.csv", "a,b\n1\n");
  put("map.pcd", "no map");
  put_manifest("map.pcd", "score");
  put("note.txt", "text");
  put("note.txt.json", "{\"version\": ");
  const ReportContent content = read();
  ASSERT_EQ(content.items.size(), 5U);  // first the parameters of the map
  EXPECT_TRUE(content.items[0].gaps.empty());
  ASSERT_EQ(content.items[1].gaps.size(), 1U);
  EXPECT_EQ(content.items[1].gaps[0].file, "map.pcd");
  EXPECT_EQ(content.items[1].gaps[0].reason, "not a map");
  EXPECT_EQ(content.items[2].gaps.at(0).file, "broken.png");
  EXPECT_EQ(content.items[3].gaps.at(0).reason.substr(0, 7), "line 2:");
  EXPECT_TRUE(content.items[4].gaps.empty());
  ASSERT_EQ(content.sources.size(), 2U);
  EXPECT_EQ(content.sources[0].error, "");
  EXPECT_EQ(content.sources[1].output, "note.txt");
  EXPECT_NE(content.sources[1].error, "");
}

// Includes an image of a map, and a file that the run did not write.
TEST(ReportReader, FilesAreNamedOnceInTheirOrder) {
  put("inner/map.pcd", "");
  put_manifest("inner/map.pcd", "score");
  put("a.csv", "x\n1\n");
  const libmap::ReportReadResult result = libmap::read_report_content(
      libmap::plan_report(scratch_folder() / "."), {.folder = scratch_folder()},
      [](const fs::path&, const auto&) { return libmap::MapView{}; }, triangle);
  EXPECT_EQ(result.files, (std::vector<fs::path>{scratch_folder() / "inner/map.pcd.json",
                                                 scratch_folder() / "a.csv",
                                                 scratch_folder() / "inner/map.pcd"}));
  EXPECT_EQ(result.content.items[1].source, "a.csv");
  EXPECT_EQ(result.content.sections[0].folder, "inner");
}

TEST(ReportReader, ListingsOfLongLines) {
  const std::string long_line(9000, 'n');
  put("a.txt", "first\n\n" + long_line + "\n" + std::string(4095, 'm') + "\nlast");
  const auto text_of = [](const std::string& file) {
    for (const libmap::ReportItem& item : read().items)
      if (item.source == file) return std::get<libmap::ReportListing>(item.body);
    throw libmap::Error("no listing of " + file);
  };
  EXPECT_EQ(text_of("a.txt").text, "first\n\n" + std::string(400, 'n') + " ...\n" +
                                       std::string(400, 'm') + " ...\nlast\n");
  put("endless.txt", "a");
  fs::resize_file(scratch_folder() / "endless.txt", std::uintmax_t{160} << 20U);
  const graspmap_test::LowerLimit limit(
      graspmap_test::memory_can_be_limited ? RLIMIT_DATA : RLIMIT_CORE, std::uint64_t{1} << 28U);
  EXPECT_EQ(text_of("endless.txt").text.substr(0, 1), "a");
}

TEST(ReportReader, TimesOfManifests) {
  put("one/map.pcd", "");
  put_manifest("one/map.pcd", "score");
  put("one/top.png", "");
  put_manifest("one/top.png", "render");
  put("one/look.csv", "a\n");
  put_manifest("one/look.csv", "lookup");
  put("one/cloud.ply", "");
  put_manifest("one/cloud.ply", "fuse");
  const ReportContent content = read();
  const auto& times = std::get<libmap::TimingTable>(content.sections.back().items.at(0).body);
  ASSERT_EQ(times.rows.size(), 3U);  // images are not timed
  EXPECT_EQ(times.rows[0].command, "fuse");
  EXPECT_EQ(times.rows[1].command, "score");
  EXPECT_EQ(times.rows[2].command, "lookup");
  EXPECT_EQ(times.rows[0].seconds[0], 0.5);
  EXPECT_EQ(content.sources.size(), 4U);
}

TEST(ReportReader, MarkersHaveTheNamesAndVerdictsOfTheirRows) {
  for (const char* folder : {"1", "2"}) {
    put(folder + std::string("/map.pcd"), "");
    put_manifest(folder + std::string("/map.pcd"), "score");
    put_manifest(folder + std::string("/look.csv"), "lookup", {{"map.pcd", "", 1}});
  }
  put("1/look.csv",
      "place,x,y,z,graspable,score,map_graspable\nA,0,0,0,1,0.9,0\nB,1,0,0,0,0.1,0\nC,2,0,0,,0.5,"
      "1\n");
  // Here it is the map's own: no verdict.
  put("2/look.csv", "place,x,y,z,graspable,score\nA,0,0,0,1,0.9\n");
  const ReportContent content = read([](const fs::path& map, const auto& lookup) {
    EXPECT_EQ(map.filename(), "map.pcd");
    EXPECT_TRUE(lookup);
    libmap::MapView view;
    view.markers.resize(3);
    return view;
  });
  const auto& map = std::get<libmap::ReportMap>(content.sections.at(0).items.at(0).body);
  EXPECT_EQ(map.view.markers[0].label, "A");
  EXPECT_EQ(map.view.markers[0].verdict, true);
  EXPECT_EQ(map.view.markers[1].verdict, false);
  EXPECT_FALSE(map.view.markers[2].verdict);
  EXPECT_EQ(map.locations->headings,
            (std::vector<std::string>{"place", "verdict", "score", "graspable on the map"}));
  EXPECT_EQ(map.locations->table.rows[2], (std::vector<std::string>{"C", "", "0.5", "1"}));
  const auto& other = std::get<libmap::ReportMap>(content.sections.at(1).items.at(0).body);
  EXPECT_EQ(other.view.markers[0].label, "A");
  EXPECT_FALSE(other.view.markers[0].verdict);
  EXPECT_EQ(other.locations->headings[1], "graspable on the map");
}

TEST(ReportReader, Scenes) {
  libmap::Manifest manifest;
  manifest.command = "grasp";
  manifest.version = "0";
  manifest.results = {{"bad.ply", "fails"}, {"good.ply", "holds"}};
  put("scenes.json", libmap::to_json(manifest));
  put("scenes/good.ply", "");
  put("scenes/bad.ply", "");
  const ReportContent content = read();
  const auto& items = content.sections.at(0).items;
  EXPECT_EQ(items.at(0).gaps.at(0).reason, "is no scene");
  EXPECT_EQ(std::get<libmap::ReportScene>(items.at(1).body).mesh.vertices.size(), 3U);
}

}  // namespace report_reader_test
