#include "libmap/core/table.h"

#include <gtest/gtest.h>

#include "tests/support/test_support.h"

namespace table_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using libmap::parse_csv;
using libmap::Table;
using Cells = std::vector<std::string>;
using Rows = std::vector<Cells>;

libmap::Error message_of(std::string_view text) {
  return error_of([&] { parse_csv(text, "t.csv"); });
}

TEST(TableTest, PlainTable) {
  const Table table = parse_csv("x,y,name\n1,2,rock\n3,4.5,\n", "t.csv");
  EXPECT_EQ(table.columns, (Cells{"x", "y", "name"}));
  EXPECT_EQ(table.rows, (Rows{{"1", "2", "rock"}, {"3", "4.5", ""}}));
  EXPECT_EQ(table.file, "t.csv");
}

TEST(TableTest, QuotesAsInRfc4180) {
  const Table table = parse_csv(
      "a,b\n\"1,5\",\"say \"\"hi\"\"\"\n\"two\nlines\",\"\"\n\"\"\"\",\"#no comment\"\n", "");
  EXPECT_EQ(table.rows, (Rows{{"1,5", "say \"hi\""}, {"two\nlines", ""}, {"\"", "#no comment"}}));
}

TEST(TableTest, ByteOrderMarkAndLineEndings) {
  const Rows rows = {{"1", "2"}, {"3", "4"}};
  for (const std::string& text :
       std::initializer_list<std::string>{"a,b\n1,2\n3,4\n", "a,b\r\n1,2\r\n3,4\r\n",
                                          std::string("\xEF\xBB\xBF") + "a,b\n1,2\n3,4",
                                          "a,b\r\n1,2\n3,4\r\n", "a , b\n1,2\n\n\r\n3,4\n\n"}) {
    const Table table = parse_csv(text, "");
    EXPECT_EQ(table.columns, (Cells{"a", "b"})) << text;
    EXPECT_EQ(table.rows, rows) << text;
  }
}

TEST(TableTest, CarriageReturnsAloneEndLines) {
  const Table table = parse_csv("x,y\r1,2\r# no row\r3,4\r", "");
  EXPECT_EQ(table.columns, (std::vector<std::string>{"x", "y"}));
  EXPECT_EQ(table.rows, (Rows{{"1", "2"}, {"3", "4"}}));
}

TEST(TableTest, OtherSeparatorsAreNamed) {
  for (const auto& [text, name] : {std::pair{"x;y\n1,5;2\n", "';'"}, {"x\ty\n1\t2\n", "tab"}}) {
    const libmap::Error error = error_of([&, text = text] { parse_csv(text, "t.csv"); });
    EXPECT_EQ(error.context().file, "t.csv");
    EXPECT_EQ(error.context().value, name);
    EXPECT_EQ(error.context().bound, "','");
  }
}

TEST(TableTest, LineEndingsInQuotesAreKept) {
  EXPECT_EQ(parse_csv("a\r\n\"1\r\n2\"\r\n", "").rows, (Rows{{"1\r\n2"}}));
}

TEST(TableTest, CommentsAndEmptyLinesArePassedOver) {
  const Table table = parse_csv("# made by hand\n\n  # twice\na,b\n#1,2\n3,4\n   \n", "");
  EXPECT_EQ(table.columns, (Cells{"a", "b"}));
  EXPECT_EQ(table.rows, (Rows{{"3", "4"}}));
}

TEST(TableTest, RaggedRowNamesItsLine) {
  EXPECT_TRUE(is_error(message_of("a,b\n1,2\n3\n"),
                       {.file = "t.csv", .field = "line 3", .value = "1 cells long"}));
  EXPECT_TRUE(is_error(message_of("# c\r\n\r\na,b\r\n\"x\r\ny\",2\r\n3,4,5\r\n"),
                       {.file = "t.csv", .field = "line 6", .value = "3 cells long"}));
}

TEST(TableTest, UnclosedQuoteNulAndNothing) {
  EXPECT_TRUE(is_error(message_of("a,b\n1,\"2\n3,4\n"), {.file = "t.csv", .field = "line 4"}));
  EXPECT_TRUE(is_error(message_of(std::string_view("a,b\n1,\0002\n", 9)), {.file = "t.csv"}));
  for (const std::string_view empty : {"", "\n\n", "# only\n", "\xEF\xBB\xBF"})
    EXPECT_TRUE(is_error(message_of(empty), {.file = "t.csv"}));
}

TEST(TableTest, HeaderAloneHasNoRows) { EXPECT_TRUE(parse_csv("a,b", "").rows.empty()); }

TEST(TableTest, MissingColumnNamesTheNearest) {
  const Table table = parse_csv("x,heigth\n", "points.csv");
  EXPECT_EQ(table.find_column("heigth"), 1U);
  EXPECT_EQ(table.find_column("X"), std::nullopt) << "names are as they stand";
  EXPECT_TRUE(is_error(error_of([&] { table.column("height"); }),
                       {.file = "points.csv", .field = "column 'height'", .about = "'heigth'"}));
}

TEST(TableTest, NumberNamesItsCell) {
  const Table table = parse_csv("x,y\n1, 2.5 \n3,four\n5,\n", "p.csv");
  EXPECT_EQ(table.number(0, 1), 2.5);
  EXPECT_TRUE(is_error(error_of([&] { table.number(1, 1); }),
                       {.file = "p.csv", .field = "row 2, column 'y'", .value = "'four'"}));
  EXPECT_EQ(table.optional_number(2, 1), std::nullopt);
  EXPECT_EQ(table.optional_number(2, 0), 5.0);
  EXPECT_TRUE(is_error(error_of([&] { table.number(2, 1); }),
                       {.file = "p.csv", .field = "row 3, column 'y'", .value = "''"}));
  EXPECT_TRUE(is_error(error_of([&] { table.optional_number(1, 1); }),
                       {.file = "p.csv", .field = "row 2, column 'y'", .value = "'four'"}));
}

TEST(TableTest, AwkwardCellsComeBack) {
  Table table;
  table.columns = {"plain", "with,comma", "with \"quote\""};
  table.rows = {{"", " spaces ", "#"},
                {"a\nb", "a\r\nb", "\r"},
                {"\"", ",,", "#begins"},
                {"\xC3\xA4", "1.5", "x\"y"}};
  const Table read = parse_csv(libmap::to_csv(table), "");
  EXPECT_EQ(read.columns, table.columns);
  EXPECT_EQ(read.rows, table.rows);
}

TEST(TableTest, RandomCellsComeBack) {
  const std::string letters = "ab,\"\n\r #\t'";
  for (int round = 0; round < 300; ++round) {
    Table table;
    const auto columns = static_cast<std::size_t>(graspmap_test::uniform(1, 5));
    for (std::size_t c = 0; c < columns; ++c) table.columns.push_back("c" + std::to_string(c));
    table.rows.resize(4, Cells(columns));
    for (Cells& row : table.rows)
      for (std::string& cell : row)
        for (int n = static_cast<int>(graspmap_test::uniform(0, 6)); n > 0; --n)
          cell += letters[static_cast<std::size_t>(
              graspmap_test::uniform(0, static_cast<double>(letters.size())))];
    ASSERT_EQ(parse_csv(libmap::to_csv(table), "").rows, table.rows) << libmap::to_csv(table);
  }
}

TEST(TableTest, ReadsAFileAndNamesIt) {
  const auto path = graspmap_test::scratch_folder() / "t.csv";
  graspmap_test::write_text(path, "a\n1\n");
  EXPECT_EQ(libmap::read_csv(path).rows, (Rows{{"1"}}));
  EXPECT_EQ(libmap::read_csv(path).file, path.string());
  graspmap_test::write_text(path, "a,a2\n1\n");
  EXPECT_EQ(error_of([&] { libmap::read_csv(path); }).context().file, path.string());
}

TEST(TableTest, MoreColumnsThanATableHasAreAnError) {
  std::string header = "c0";
  for (int n = 1; n < 10000; ++n) header += ",c" + std::to_string(n);
  EXPECT_EQ(libmap::parse_csv(header + "\n", "t.csv").columns.size(), 10000U);
  const libmap::Error error = error_of([&] { libmap::parse_csv(header + ",c\n", "t.csv"); });
  EXPECT_EQ(error.context().value, "10001 cells long");
  EXPECT_EQ(error.context().file, "t.csv");
}

}  // namespace table_test
