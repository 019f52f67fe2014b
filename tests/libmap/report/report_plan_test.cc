#include "libmap/report/report_reader.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/libmap/report/report_test_support.h"

namespace report_plan_test {

namespace fs = std::filesystem;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::scratch_folder;
using libmap::PlannedSection;
using report_test_support::put;
using report_test_support::put_manifest;

TEST(ReportPlan, OfAFolder) {
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
  const PlannedSection plan = libmap::plan_report(scratch_folder());
  ASSERT_EQ(plan.sections.size(), 3U);
  EXPECT_EQ(plan.sections[0].heading, "2 B");
  EXPECT_EQ(plan.sections[1].heading, "10 C");
  EXPECT_EQ(plan.sections[2].heading, "Running times");
  const auto& section = plan.sections[0];
  const fs::path folder = scratch_folder() / "2_b";
  ASSERT_EQ(section.items.size(), 2U);  // one map, and its images without roc.png
  EXPECT_EQ(section.items[0].files[0], folder / "map.pcd");
  EXPECT_EQ(section.items[0].lookup, folder / "lookup.csv");
  EXPECT_EQ(section.items[0].image, folder / "oblique.png");
  EXPECT_EQ(section.items[0].columns.size(), 3U);
  EXPECT_EQ(section.items[1].files, std::vector<fs::path>{folder / "oblique.png"});
  ASSERT_EQ(section.sections.size(), 1U);  // not the tiles, not the loop
  EXPECT_EQ(section.sections[0].items[0].files,
            std::vector<fs::path>{folder / "evaluation/roc.svg"});
  // The shares' times are those of the map.
  const auto& cases = plan.sections[2].items[0].cases;
  ASSERT_EQ(cases.size(), 1U);
  EXPECT_NE(std::find(cases[0].second.begin(), cases[0].second.end(), folder / "tiles/1-of-2.pcd"),
            cases[0].second.end());
  EXPECT_EQ(plan.count(libmap::ItemKind::map), 1U);
  EXPECT_EQ(plan.count(libmap::ItemKind::table), 1U);
}

// Several maps in a folder and its subfolders: the time of each manifest is counted once.
TEST(ReportPlan, OfMapsTogether) {
  for (const char* map : {"a.pcd", "b.pcd", "sub/map.pcd", "sub/second.pcd", "sub/c/deep.pcd"}) {
    put(map, "");
    put_manifest(map, "score");
  }
  put("oblique.png", "");
  put_manifest("oblique.png", "render", {{"a.pcd", "", 1}});
  put("sub/top.png", "");
  put("sub/evaluation/roc.csv", "a\n1\n");
  put_manifest("sub/evaluation", "evaluate");
  const PlannedSection plan = libmap::plan_report(scratch_folder());
  EXPECT_EQ(plan.items[0].labels,
            (std::vector<std::string>{"a.pcd", "b.pcd", "sub/map.pcd", "sub/second.pcd", "sub/c"}));
  EXPECT_EQ(plan.items[1].image, scratch_folder() / "oblique.png");
  EXPECT_EQ(plan.items[2].image, "");
  EXPECT_EQ(plan.sections[0].items[0].image, "") << "of which of the two maps?";
  const auto& cases = plan.sections.back().items[0].cases;
  ASSERT_EQ(cases.size(), 3U);
  EXPECT_EQ(cases[0].first, scratch_folder().filename().string());
  EXPECT_EQ(cases[0].second.size(), 3U);
  EXPECT_EQ(cases[1].first, "sub");
  const fs::path sub = scratch_folder() / "sub";
  EXPECT_EQ(cases[1].second,
            (std::vector<fs::path>{sub / "evaluation", sub / "map.pcd", sub / "second.pcd"}));
  EXPECT_EQ(cases[2].first, "sub/c");
  EXPECT_EQ(cases[2].second, std::vector<fs::path>{sub / "c/deep.pcd"});
}

TEST(ReportPlan, ScenesOfGrasp) {
  libmap::Manifest manifest;
  manifest.command = "grasp";
  manifest.version = "0";
  manifest.results = {{"locations", std::int64_t{2}}, {"P10.ply", "holds"}, {"P2.ply", "fails"}};
  put("scenes.json", libmap::to_json(manifest));
  for (const char* name : {"P10.ply", "P2.ply", "other.ply", "locations"})
    put(std::string("scenes/") + name, "");
  const PlannedSection plan = libmap::plan_report(scratch_folder());
  const auto& items = plan.sections.at(0).items;
  ASSERT_EQ(items.size(), 2U);
  EXPECT_EQ(items[0].kind, libmap::ItemKind::scene);
  EXPECT_EQ(items[0].files, std::vector<fs::path>{scratch_folder() / "scenes/P2.ply"});
  EXPECT_EQ(items[0].caption, "P2: fails.");
  EXPECT_EQ(items[1].caption, "P10: holds.");
}

// File names do not depend on the notation of the folder.
TEST(ReportPlan, OfTheCurrentFolder) {
  put("run/a.csv", "x\n1\n");
  put("run/b/c.txt", "");
  const fs::path before = fs::current_path();
  fs::current_path(scratch_folder() / "run");
  const PlannedSection here = libmap::plan_report(".");
  const PlannedSection there = libmap::plan_report("../run/");
  fs::current_path(before);
  EXPECT_EQ(here.heading, "Run");
  EXPECT_EQ(there.heading, "Run");
  EXPECT_EQ(here.items.at(0).files, std::vector<fs::path>{"./a.csv"});
  EXPECT_EQ(there.items.at(0).files, std::vector<fs::path>{"../run/a.csv"});
  EXPECT_EQ(here.sections.at(0).items.at(0).files, std::vector<fs::path>{"./b/c.txt"});
}

TEST(ReportPlan, OfNothing) {
  EXPECT_TRUE(is_error(error_of([] { libmap::plan_report(scratch_folder()); }),
                       {.file = scratch_folder()}));
  EXPECT_TRUE(is_error(error_of([] { libmap::plan_report(scratch_folder() / "no"); }),
                       {.file = graspmap_test::scratch_folder() / "no"}));
  put("file", "");
  EXPECT_TRUE(is_error(error_of([&] { libmap::plan_report(scratch_folder() / "file"); }),
                       {.file = graspmap_test::scratch_folder() / "file"}));
}

TEST(ReportPlan, NaturalOrder) {
  EXPECT_TRUE(libmap::natural_less("2_slopes", "10_walls"));
  EXPECT_FALSE(libmap::natural_less("10_walls", "2_slopes"));
  EXPECT_TRUE(libmap::natural_less("a", "a1"));
  EXPECT_TRUE(libmap::natural_less("a01", "a2"));
  EXPECT_NE(libmap::natural_less("a01", "a1"), libmap::natural_less("a1", "a01"));
  EXPECT_FALSE(libmap::natural_less("a1", "a1"));
}

}  // namespace report_plan_test
