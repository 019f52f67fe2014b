#include "libmap/report/html.h"

#include <gtest/gtest.h>
#include <sys/mman.h>

#include <string_view>

#include "libmap/report/report_reader.h"
#include "tests/support/test_support.h"

namespace table_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::scratch_folder;
using libmap::Manifest;
using libmap::number_style;
using libmap::ReportTable;
using libmap::shown_number;

std::vector<std::string> shown(const std::vector<std::string>& cells) {
  const libmap::NumberStyle style = number_style(cells);
  std::vector<std::string> texts;
  for (const std::string& cell : cells) texts.push_back(shown_number(cell, style));
  return texts;
}

TEST(Html, Escapes) {
  EXPECT_EQ(libmap::escape_html("<script>alert(\"a\" & 'b')</script>"),
            "&lt;script&gt;alert(&quot;a&quot; &amp; &#39;b&#39;)&lt;/script&gt;");
  EXPECT_EQ(libmap::escape_html(std::string("a\0b\x1b", 4)),
            "a\xEF\xBF\xBD"
            "b\xEF\xBF\xBD");
  EXPECT_EQ(libmap::escape_json_in_script(R"({"a":"</script><!--"})"),
            R"({"a":"\u003c/script>\u003c!--"})");
  EXPECT_EQ(libmap::escape_code("a = '</script>';\r\n"), "a = '<\\/script>';\n");
  EXPECT_EQ(libmap::attribute("title", "a\"b"), " title=\"a&quot;b\"");
  EXPECT_EQ(libmap::attribute("title", ""), "");
}

TEST(Html, Base64OfTheStandard) {
  // RFC 4648, section 10.
  const std::vector<std::pair<std::string, std::string>> vectors = {{"", ""},
                                                                    {"f", "Zg=="},
                                                                    {"fo", "Zm8="},
                                                                    {"foo", "Zm9v"},
                                                                    {"foob", "Zm9vYg=="},
                                                                    {"fooba", "Zm9vYmE="},
                                                                    {"foobar", "Zm9vYmFy"}};
  for (const auto& [bytes, text] : vectors) EXPECT_EQ(libmap::to_base64(bytes), text);
  // The example of Content Security Policy Level 3, section 6.7.2.
  EXPECT_EQ(libmap::csp_hash("alert('Hello, world.');"),
            "'sha256-qznLcsROx4GACP2dm0UCKCzCG+HiZ1guq6ZZDob/Tng='");
}

TEST(Html, Base64IsOfLessThanAGigabyte) {
  // Memory pages that are not accessed are not allocated.
  constexpr std::size_t size = std::size_t{1} << 30;
  void* const pages = mmap(nullptr, size, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(pages, MAP_FAILED);
  const std::string_view bytes(static_cast<const char*>(pages), size);
  EXPECT_TRUE(is_error(error_of([&] { libmap::to_base64(bytes); }),
                       {.value = "1073741824 bytes", .bound = "<= 1073741823"}));
  munmap(pages, size);
}

TEST(Table, NumbersOfAColumnHaveTheirPointsInOneLine) {
  EXPECT_EQ(shown({"0.98214889", "1", "", "0.5"}),
            (std::vector<std::string>{"0.982", "1.000", "", "0.500"}));
  EXPECT_EQ(shown({"0.1", "12.25"}), (std::vector<std::string>{"0.10", "12.25"}));
  EXPECT_EQ(shown({"17", "383035"}), (std::vector<std::string>{"17", "383035"}));
  EXPECT_EQ(shown({"0.00012345", "0"}), (std::vector<std::string>{"0.000123", "0"}));
  EXPECT_EQ(shown({"1.5", "nan"}), (std::vector<std::string>{"1.5", "\xE2\x80\x93"}));
  EXPECT_EQ(shown({"1.23456", "P1"}), (std::vector<std::string>{"1.23456", "P1"}));
}

ReportTable table_of(std::size_t rows) {
  ReportTable table;
  table.table.columns = table.headings = {"place", "score"};
  for (std::size_t n = 0; n < rows; ++n)
    table.table.rows.push_back({"P" + std::to_string(n), "0.12345"});
  return table;
}

TEST(Table, WhatIsMoreIsFolded) {
  EXPECT_EQ(libmap::table_html(table_of(45)).find("<details"), std::string::npos);
  const std::string html = libmap::table_html(table_of(60));
  EXPECT_NE(html.find("20 more rows"), std::string::npos);
  EXPECT_LT(html.find(">P39<"), html.find("<details"));
  EXPECT_GT(html.find(">P40<"), html.find("<details"));
  // Rows that belong to markers are all there.
  const std::string rows = libmap::table_html(table_of(60), "data-place");
  EXPECT_EQ(rows.find("<details"), std::string::npos);
  EXPECT_NE(rows.find("data-place=\"59\""), std::string::npos);
  EXPECT_NE(html.find("<td class=\"number\" title=\"0.12345\">0.123</td>"), std::string::npos);
  EXPECT_NE(html.find("<th scope=\"row\">P59</th>"), std::string::npos);
}

TEST(Table, CellsCannotBeTags) {
  ReportTable table = table_of(1);
  table.headings[1] = "<b>";
  table.table.rows[0] = {"<script>alert(1)</script>", "<img src=x onerror=alert(1)>"};
  const std::string html = libmap::table_html(table);
  EXPECT_EQ(html.find("<script"), std::string::npos);
  EXPECT_EQ(html.find("<img"), std::string::npos);
  EXPECT_EQ(html.find("<b>"), std::string::npos);
}

TEST(Table, OfAMillionRowsOnlyTheFirstAreRead) {
  std::string text = "name,value\n";
  for (int n = 0; n < 1'000'000; ++n) text += "\"line,\nbreak\"," + std::to_string(n) + "\n";
  graspmap_test::write_text(scratch_folder() / "large.csv", text);
  const ReportTable table =
      libmap::read_report_table(scratch_folder() / "large.csv", {{"value", "v"}}, 1000);
  EXPECT_EQ(table.table.rows.size(), 1000U);
  EXPECT_EQ(table.table.rows[999], std::vector<std::string>{"999"});
  EXPECT_EQ(table.lines, 2'000'001U);
  graspmap_test::write_text(scratch_folder() / "unended.csv", text.substr(0, text.size() - 1));
  EXPECT_EQ(libmap::read_report_table(scratch_folder() / "unended.csv", {}, 1).lines, 2'000'001U);
  EXPECT_EQ(error_of([] {
              libmap::read_report_table(scratch_folder() / "large.csv", {{"valu", ""}}, 1);
            })
                .context()
                .field,
            "column 'valu'");
}

Manifest manifest_of(const std::string& command,
                     const std::vector<std::pair<std::string, double>>& timings) {
  Manifest manifest;
  manifest.command = command;
  manifest.timings_s = timings;
  manifest.threads = 2;
  return manifest;
}

TEST(Timings, EachStepByEachCase) {
  const Manifest first = manifest_of("score", {{"read", 0.5}, {"voxel matching", 0.25}});
  const Manifest second = manifest_of("score", {{"read", 0.5}, {"convexity", 1.0}});
  const Manifest look = manifest_of("lookup", {{"look-up", 0.125}});
  const libmap::TimingTable table =
      libmap::timing_table({{"a", {first, look, second}}, {"b", {first}}});
  ASSERT_EQ(table.rows.size(), 4U);
  EXPECT_EQ(table.rows[0].step, "read");
  EXPECT_EQ(table.rows[0].seconds[0], 1.0);
  EXPECT_EQ(table.rows[0].seconds[1], 0.5);
  EXPECT_EQ(table.rows[2].step, "convexity");  // with its command, though it came later
  EXPECT_FALSE(table.rows[2].seconds[1]);
  EXPECT_TRUE(table.sums);

  const std::string html = libmap::timings_html(table);
  EXPECT_NE(html.find(">250.0</td>"), std::string::npos);
  EXPECT_NE(html.find(">2250.0</td>"), std::string::npos);
  EXPECT_NE(html.find(">2375.0</td>"), std::string::npos);
}

// A linear search per name would take minutes.
TEST(Timings, ManySteps) {
  std::vector<std::pair<std::string, std::vector<Manifest>>> cases;
  for (int n = 0; n < 10; ++n) {
    std::vector<std::pair<std::string, double>> steps;
    for (int step = 0; step < 10000; ++step)
      steps.emplace_back("step " + std::to_string(step) + " of " + std::to_string(n), 1.0);
    cases.emplace_back(std::to_string(n), std::vector{manifest_of("score", steps)});
  }
  const libmap::TimingTable table = libmap::timing_table(cases);
  ASSERT_EQ(table.rows.size(), 100'000U);
  EXPECT_EQ(table.rows[10'001].step, "step 1 of 1");
  double sum = 0.0;
  for (const libmap::TimingRow& row : table.rows) sum += row.seconds[9].value_or(0.0);
  EXPECT_EQ(sum, 10'000.0);
}

TEST(Parameters, ManyOfSeveralOutputs) {
  libmap::ReportParameters parameters;
  for (std::int64_t n = 0; n < 10; ++n) {
    Manifest manifest;
    manifest.parameters.emplace_back("command", "one more of this name");
    for (std::int64_t k = 0; k < 5000; ++k) {
      manifest.parameters.emplace_back("p" + std::to_string(5000 * n + k), k);
      manifest.results.emplace_back("r" + std::to_string(k), k);
    }
    parameters.outputs.emplace_back("output " + std::to_string(n), manifest);
  }
  const std::string html = libmap::parameters_html(parameters);
  const std::size_t row = html.find("<th scope=\"row\">p49999</th>");
  ASSERT_NE(row, std::string::npos);
  EXPECT_NE(html.substr(row, html.find("</tr>", row) - row).find(">4999</td>"), std::string::npos);
  const std::size_t same = html.find("Equal in all");
  ASSERT_NE(same, std::string::npos);
  EXPECT_GT(html.find("<th scope=\"row\">r4999</th>"), same);
}

}  // namespace table_test
