#include "libgtd/evaluate/roc_tables.h"

#include <gmock/gmock.h>

#include <clocale>
#include <locale>

#include "libmap/core/text.h"
#include "tests/support/test_support.h"

namespace roc_tables_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using libgtd::evaluate_table;
using libgtd::TableEvaluation;
using libgtd::TableEvaluationOptions;
using libmap::parse_csv;
using libmap::Table;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

const char* const small_table =
    "point,x_m,x,graspable,map,other\n"
    "1,0.5,0.5,1,0.9,0.1\n"
    "2,0.5,0.5,0,0.4,0.1\n"
    "3,0.5,0.5,yes,0.8,\n"
    "4,0.5,0.5,not graspable,0.8,0.3\n"
    "5,0.5,0.5,,0.7,0.9\n";

TableEvaluation evaluate_small(const std::string& text = small_table) {
  TableEvaluationOptions options;
  options.roc.bootstrap_replicates = 100;
  return evaluate_table(parse_csv(text, "lookup.csv"), options);
}

TEST(RocTables, LabelsInAnyUsualWriting) {
  for (const char* text : {"1", "true", "Yes", " on ", "1.0", "graspable", "Graspable"})
    EXPECT_EQ(libgtd::parse_label(text), true) << text;
  for (const char* text : {"0", "FALSE", "no", "off", "0.0", "not graspable", "not_graspable",
                           "non-graspable", "Ungraspable"})
    EXPECT_EQ(libgtd::parse_label(text), false) << text;
  for (const char* text : {"", "2", "0.5", "nan", "maybe", "grasp", "graspable\xC3\xA9"})
    EXPECT_EQ(libgtd::parse_label(text), std::nullopt) << text;
}

TEST(RocTables, DefaultColumnsAreTheNumbersThatAreNeitherIdentityNorPlace) {
  const Table table = parse_csv(
      "found,hold,place,i,x,y,z,distance_m,name,graspable,empty,score,mixed,ssv,edge,border\n"
      "1,1,1,1,1,1,1,1,a,1,,0.5,1,20,0,1\n2,2,2,2,2,2,2,2,b,0,,,b,30,1,0\n",
      "t.csv");
  EXPECT_THAT(libgtd::default_score_columns(table, "graspable"), ElementsAre("score", "ssv"));
  EXPECT_THAT(libgtd::default_score_columns(table, "score"), ElementsAre("graspable", "ssv"));
}

TEST(RocTables, EvaluatesEachColumnOnItsOwnLocations) {
  const TableEvaluation evaluation = evaluate_small();
  ASSERT_EQ(evaluation.columns.size(), 2u);
  EXPECT_EQ(evaluation.columns[0].name, "map");
  EXPECT_EQ(evaluation.columns[0].result.auc->trapezoid, 3.5 / 4);
  EXPECT_EQ(evaluation.columns[0].result.without_label, 1u);
  EXPECT_EQ(evaluation.columns[1].result.without_score, 1u);
  EXPECT_EQ(evaluation.columns[1].result.auc->trapezoid, 0.25);
}

TEST(RocTables, RocTableHasTheCutoffsThenTheScores) {
  const Table table = libgtd::roc_table(evaluate_small());
  EXPECT_EQ(table.rows.size(), (10u + 3u) + (10u + 2u));
  EXPECT_THAT(table.rows[7],
              ElementsAre("map", "cutoff", "0.8", "3", "1", "2", "1", "1", "0", "1", "0.5", "0.5"));
  EXPECT_THAT(table.rows[11],
              ElementsAre("map", "score", "0.8", "3", "1", "2", "1", "1", "0", "1", "0.5", ""));
  // Round trip of the written table.
  const Table again = parse_csv(libmap::to_csv(table), "roc.csv");
  EXPECT_EQ(again.rows, table.rows);
}

TEST(RocTables, UndefinedRatesAreEmptyCellsAndNulls) {
  const TableEvaluation evaluation = evaluate_small("graspable,score\n1,0.2\n1,0.3\n");
  const Table rates = libgtd::rates_table(evaluation);
  ASSERT_EQ(rates.rows.size(), 6u);
  EXPECT_THAT(rates.rows[1],
              ElementsAre("score", "0.8", "true_negative_rate", "0", "0", "", "", ""));
  EXPECT_THAT(rates.rows[4],
              ElementsAre("score", "0.8", "positive_predictive_value", "0", "0", "", "", ""));
  const std::string json = libgtd::to_json(evaluation);
  EXPECT_THAT(json, HasSubstr("\"trapezoid\": null"));
  EXPECT_THAT(json, HasSubstr("all 2 locations are labeled true"));
  EXPECT_THAT(json, Not(HasSubstr("nan")));
  const std::string markdown = libgtd::to_markdown(evaluation, "");
  EXPECT_THAT(markdown, HasSubstr("| score | 2 | 2 | 0 | not defined | not defined |"));
  EXPECT_THAT(markdown, HasSubstr("score: all 2 locations are labeled true"));
}

TEST(RocTables, MarkdownSaysWhichAreaThePublishedOneIs) {
  const std::string markdown = libgtd::to_markdown(evaluate_small(), "Site | 1");
  EXPECT_THAT(markdown, HasSubstr("# Site \\| 1\n"));
  EXPECT_THAT(markdown, HasSubstr("The AUC that the thesis published (0.84, 0.75, 0.72) is the "
                                  "upper sum"));
  EXPECT_THAT(markdown, HasSubstr("1 locations have a score and no label"));
  EXPECT_THAT(markdown, Not(HasSubstr("cover")));
  const std::string outside =
      libgtd::to_markdown(evaluate_small("graspable,score\n1,0.2\n0,0.05\n"), "");
  EXPECT_THAT(outside, HasSubstr("| 0.000 (incomplete, see below) |"));
  EXPECT_THAT(outside, HasSubstr("can be below the trapezoid"));
  EXPECT_THAT(markdown, Not(HasSubstr("incomplete")));
}

TEST(RocTables, TextsDoNotDependOnTheLocale) {
  struct Comma : std::numpunct<char> {
    char do_decimal_point() const override { return ','; }
    char do_thousands_sep() const override { return '.'; }
    std::string do_grouping() const override { return "\3"; }
  };
  const TableEvaluation evaluation = evaluate_small();
  const auto texts = [&] {
    return libgtd::to_json(evaluation) + libgtd::to_markdown(evaluation, "t") +
           libmap::to_csv(libgtd::roc_table(evaluation)) +
           libmap::to_csv(libgtd::rates_table(evaluation));
  };
  const std::string plain = texts();
  const std::string c_before = std::setlocale(LC_ALL, nullptr);
  const std::locale before = std::locale::global(std::locale(std::locale(), new Comma));
  std::setlocale(LC_ALL, "de_DE.UTF-8");  // if installed
  const std::string comma = texts();
  std::locale::global(before);
  std::setlocale(LC_ALL, c_before.c_str());
  EXPECT_EQ(comma, plain);
}

TEST(RocTables, WrongTablesNameFileRowAndColumn) {
  const auto error_for = [](const std::string& text, std::vector<std::string> scores = {}) {
    return error_of([&] {
      TableEvaluationOptions options;
      options.score_columns = std::move(scores);
      evaluate_table(parse_csv(text, "lookup.csv"), options);
    });
  };
  EXPECT_TRUE(
      is_error(error_for("grapsable,score\n1,0.5\n"),
               {.file = "lookup.csv", .field = "column 'graspable'", .about = "'grapsable'"}));
  const libmap::Error label = error_for("graspable,score\n1,0.5\nmaybe,0.5\n");
  EXPECT_EQ(label.context().file, "lookup.csv");
  EXPECT_EQ(label.context().field, "row 2, column 'graspable'");
  EXPECT_EQ(label.context().value, "'maybe'");
  EXPECT_EQ(error_for("graspable,score\n1,high\n", {"score"}).context().field,
            "row 1, column 'score'");
  EXPECT_TRUE(is_error(error_for("graspable,name\n1,a\n"),
                       {.file = "lookup.csv", .field = "score columns"}));
  EXPECT_TRUE(is_error(error_for("graspable,score\n1,0.5\n", {"score", "score"}),
                       {.file = "lookup.csv", .field = "column 'score'"}));
  EXPECT_TRUE(is_error(error_for("graspable,score\n", {}),
                       {.file = "lookup.csv", .field = "score columns"}));
  EXPECT_TRUE(is_error(error_for("graspable,score\n1,0.5\n", {"scor"}),
                       {.file = "lookup.csv", .field = "column 'scor'", .about = "'score'"}));
}

}  // namespace roc_tables_test
