#include <gtest/gtest.h>

#include "libmap/core/table.h"
#include "tests/support/file_names.h"
#include "tests/tools/tool_test_support.h"

namespace evaluate_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::names_in;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::write_text;
using Words = std::vector<std::string>;

const Words files = {"accuracy.csv", "rates.csv",    "roc.csv",   "roc.png",
                     "roc.svg",      "summary.json", "summary.md"};

void write_table() {
  write_text(scratch("t.csv"),
             "id,graspable,good,bad\n1,1,0.9,0.1\n2,yes,0.8,0.2\n3,0,0.3,0.8\n4,no,0.2,0.9\n");
}

TEST(Evaluate, PerfectAndReversedScores) {
  write_table();
  ASSERT_TRUE(succeeded(graspmap({"evaluate", "t.csv", "-o", "out"})));
  EXPECT_EQ(names_in(scratch("out")), files);
  const nlohmann::json results = graspmap_test::json_of("out.json").at("results");
  EXPECT_EQ(results.at("rows"), 4);
  EXPECT_EQ(results.at("good.auc_trapezoid"), 1.0);
  EXPECT_EQ(results.at("bad.auc_trapezoid"), 0.0);
  EXPECT_FALSE(results.contains("id.auc_trapezoid"));
  EXPECT_TRUE(content("out/roc.png").starts_with("\x89PNG"));
  EXPECT_NE(content("out/roc.svg").find("<svg"), std::string::npos);
  EXPECT_FALSE(libmap::read_csv(scratch("out/roc.csv")).rows.empty());
  EXPECT_TRUE(nlohmann::json::parse(content("out/summary.json")).is_object());
}

TEST(Evaluate, AccuracyHasARowACase) {
  write_table();
  ASSERT_TRUE(succeeded(graspmap({"evaluate", "t.csv", "-o", "out", "--cutoff", "0.3"})));
  const libmap::Table table = libmap::read_csv(scratch("out/accuracy.csv"));
  EXPECT_EQ(table.columns,
            (Words{"case", "locations", "cutoff", "tpr", "tnr", "fpr", "fnr", "ppv", "acc"}));
  ASSERT_EQ(table.rows.size(), 2U);
  EXPECT_EQ(table.rows[0], (Words{"good", "4", "0.3", "1.0000", "0.5000", "0.5000", "0.0000",
                                  "0.6667", "0.7500"}));
  EXPECT_EQ(table.rows[1],
            (Words{"bad", "4", "0.3", "0.0000", "0.0000", "1.0000", "1.0000", "0.0000", "0.0000"}));
}

TEST(Evaluate, AccuracyIsThatOfTheThesis) {
  GRASPMAP_REQUIRE_DATA();
  const auto thesis = graspmap_test::data_folder() / "thesis";
  ASSERT_TRUE(succeeded(
      graspmap({"evaluate", (thesis / "bouldering_wall_scenario3.csv").string(), "-o", "wall",
                "--label", "prescan", "--score", "prescan_combined,realtime_interpolated"})));
  const libmap::Table ours = libmap::read_csv(scratch("wall/accuracy.csv"));
  const libmap::Table published = libmap::read_csv(thesis / "accuracy.csv");
  for (std::size_t row = 0; row < 2; ++row) {
    ASSERT_EQ(published.rows[row][0], "bouldering_wall");
    EXPECT_EQ(published.rows[row][1], ours.rows[row][0]);
    for (const std::string rate : {"tpr", "tnr", "fpr", "fnr", "ppv", "acc"})
      EXPECT_EQ(ours.rows[row][ours.column(rate)], published.rows[row][published.column(rate)])
          << ours.rows[row][0] << " " << rate;
  }
}

TEST(Evaluate, SameSeedSameBytes) {
  write_table();
  ASSERT_TRUE(succeeded(graspmap({"evaluate", "t.csv", "-o", "one", "--threads", "1"})));
  ASSERT_TRUE(succeeded(graspmap({"evaluate", "t.csv", "-o", "two", "--threads", "2"})));
  for (const std::string& name : files)
    EXPECT_EQ(content("one/" + name), content("two/" + name)) << name;
}

TEST(Evaluate, ForeignFolderIsKept) {
  write_table();
  std::filesystem::create_directory(scratch("mine"));
  write_text(scratch("mine/roc.csv"), "precious");
  EXPECT_TRUE(bad_input(graspmap({"evaluate", "t.csv", "-o", "mine"}),
                        {.file = "mine", .about = "--force"}));
  EXPECT_EQ(content("mine/roc.csv"), "precious");
  EXPECT_TRUE(succeeded(graspmap({"evaluate", "t.csv", "-o", "mine", "--force"})));
  EXPECT_NE(content("mine/roc.csv"), "precious");
  write_text(scratch("other.json"), "{\"mine\": 1}");
  EXPECT_TRUE(bad_input(graspmap({"evaluate", "t.csv", "-o", "other"}),
                        {.file = "other.json", .about = "--force"}));
  EXPECT_EQ(content("other.json"), "{\"mine\": 1}");
}

TEST(Evaluate, BadInputLeavesNothing) {
  write_table();
  write_text(scratch("text.csv"), "graspable,score\n1,high\n0,0.2\n");
  write_text(scratch("label.csv"), "graspable,score\nperhaps,0.5\n0,0.2\n");
  const Words before = graspmap_test::names_in_scratch();
  EXPECT_TRUE(bad_input(graspmap({"evaluate", "none.csv", "-o", "out"}), {.file = "none.csv"}));
  EXPECT_TRUE(bad_input(graspmap({"evaluate", "t.csv", "-o", "out", "--label", "graspabel"}),
                        {.file = "t.csv", .field = "column 'graspabel'", .about = "'graspable'"}));
  EXPECT_TRUE(bad_input(graspmap({"evaluate", "t.csv", "-o", "out", "--score", "gud"}),
                        {.file = "t.csv", .field = "column 'gud'"}));
  EXPECT_TRUE(bad_input(graspmap({"evaluate", "text.csv", "-o", "out", "--score", "score"}),
                        {.file = "text.csv", .field = "row 1, column 'score'", .value = "'high'"}));
  EXPECT_TRUE(
      bad_input(graspmap({"evaluate", "label.csv", "-o", "out"}),
                {.file = "label.csv", .field = "row 1, column 'graspable'", .value = "'perhaps'"}));
  EXPECT_TRUE(bad_input(graspmap({"evaluate", "t.csv", "-o", "t.csv"}), {.file = "t.csv"}));
  EXPECT_EQ(graspmap_test::names_in_scratch(), before);
}

TEST(Evaluate, DryRunWritesNothing) {
  write_table();
  EXPECT_TRUE(succeeded(graspmap({"evaluate", "t.csv", "-o", "out", "--dry-run"})));
  EXPECT_EQ(graspmap_test::names_in_scratch(), Words{"t.csv"});
}

TEST(Evaluate, PublishedFieldTest) {
  GRASPMAP_REQUIRE_DATA();
  const std::string table =
      (graspmap_test::data_folder() / "thesis" / "field_test_scenario4.csv").string();
  ASSERT_TRUE(succeeded(graspmap({"evaluate", table, "-o", "out", "--score", "prescan"})));
  const nlohmann::json manifest = graspmap_test::json_of("out.json");
  EXPECT_EQ(manifest.at("results").at("prescan.locations"), 30);
  EXPECT_GT(manifest.at("results").at("prescan.auc_upper_sum"),
            manifest.at("results").at("prescan.auc_trapezoid"))
      << "the published area is the upper sum";
}

}  // namespace evaluate_test
