#include "libmap/core/text.h"

#include <gtest/gtest.h>

#include <bit>
#include <clocale>
#include <cmath>
#include <limits>
#include <locale>

#include "tests/support/test_support.h"

namespace text_test {

using libmap::nearest_name;
using libmap::parse_bool;
using libmap::parse_double;
using libmap::parse_integer;
using libmap::to_text;

TEST(TextTest, NumbersTakeTheShortestText) {
  EXPECT_EQ(to_text(0.1), "0.1");
  EXPECT_EQ(to_text(0.1F), "0.1");
  EXPECT_EQ(to_text(3.0), "3");
  EXPECT_EQ(to_text(-0.0), "-0");
  EXPECT_EQ(to_text(1e300), "1e+300");
  EXPECT_EQ(to_text(std::int64_t{-42}), "-42");
  EXPECT_EQ(to_text(std::numeric_limits<std::int64_t>::min()), "-9223372036854775808");
  EXPECT_EQ(to_text(std::numeric_limits<double>::infinity()), "inf");
  EXPECT_EQ(to_text(-std::numeric_limits<double>::infinity()), "-inf");
  EXPECT_EQ(to_text(std::numeric_limits<double>::quiet_NaN()), "nan");
}

TEST(TextTest, FixedDigitsAtAnySize) {
  using libmap::to_fixed_text;
  EXPECT_EQ(to_fixed_text(0.125, 2), "0.12");
  EXPECT_EQ(to_fixed_text(-2.0, 0), "-2");
  EXPECT_EQ(to_fixed_text(0.7449, 3), "0.745");
  EXPECT_EQ(to_fixed_text(std::numeric_limits<double>::max(), 3).size(), 309u + 4u);
  EXPECT_EQ(to_fixed_text(std::numeric_limits<double>::quiet_NaN(), 3), "nan");
}

TEST(TextTest, EveryDoubleReadsBackAsItself) {
  int tried = 0;
  while (tried < 20000) {
    const auto value = std::bit_cast<double>(graspmap_test::random_engine()());
    if (!std::isfinite(value)) continue;
    ++tried;
    const auto read = parse_double(to_text(value));
    ASSERT_TRUE(read) << to_text(value);
    ASSERT_EQ(std::bit_cast<std::uint64_t>(*read), std::bit_cast<std::uint64_t>(value));
  }
  for (const double value :
       {std::numeric_limits<double>::denorm_min(), 5e-324, 2.2250738585072e-308,
        std::numeric_limits<double>::max(), std::numeric_limits<double>::lowest()})
    EXPECT_EQ(parse_double(to_text(value)), value);
}

TEST(TextTest, EveryFloatReadsBackAsItself) {
  int tried = 0;
  while (tried < 20000) {
    const auto value =
        std::bit_cast<float>(static_cast<std::uint32_t>(graspmap_test::random_engine()()));
    if (!std::isfinite(value)) continue;
    ++tried;
    ASSERT_EQ(static_cast<float>(parse_double(to_text(value)).value()), value) << to_text(value);
  }
}

TEST(TextTest, ParsesNumbers) {
  EXPECT_EQ(parse_double("1.5"), 1.5);
  EXPECT_EQ(parse_double("  -2e-3\t"), -2e-3);
  EXPECT_EQ(parse_double("+4"), 4.0);
  EXPECT_EQ(parse_double(".5"), 0.5);
  EXPECT_EQ(parse_double("5."), 5.0);
  EXPECT_EQ(parse_double("1\r\n"), 1.0);
  for (const char* infinite : {"inf", "INF", ".inf", ".Inf", "+inf", "infinity"})
    EXPECT_EQ(parse_double(infinite), std::numeric_limits<double>::infinity()) << infinite;
  EXPECT_EQ(parse_double("-.inf"), -std::numeric_limits<double>::infinity());
  for (const char* nan : {"nan", "NaN", ".nan", ".NaN"})
    EXPECT_TRUE(std::isnan(parse_double(nan).value())) << nan;
}

TEST(TextTest, RefusesWhatIsNotWhollyANumber) {
  for (const char* text :
       {"",    " ",   "+",   "-",   ".",   "e5",    "1,5",   "1.5m",     "1 2", "0x10", "1e",
        "--1", "+-1", "-+1", "++1", "+ 1", "1e999", "1_000", "\xD9\xA1", "one", "1.2.3"})
    EXPECT_FALSE(parse_double(text)) << text;
  EXPECT_FALSE(parse_double(std::string_view("1\0", 2))) << "a NUL behind the number";
}

TEST(TextTest, ParsesIntegers) {
  EXPECT_EQ(parse_integer("9223372036854775807"), std::numeric_limits<std::int64_t>::max());
  EXPECT_EQ(parse_integer("-9223372036854775808"), std::numeric_limits<std::int64_t>::min());
  EXPECT_EQ(parse_integer(" +7 "), 7);
  for (const char* text : {"", "1.0", "1e3", "9223372036854775808", "0x1", "+-1", "1 2", "seven"})
    EXPECT_FALSE(parse_integer(text)) << text;
}

TEST(TextTest, ParsesIntegersOf32Bits) {
  EXPECT_EQ(libmap::parse_int("-2147483648"), std::numeric_limits<int>::min());
  EXPECT_EQ(libmap::parse_int("2147483647"), std::numeric_limits<int>::max());
  for (const char* text : {"2147483648", "-2147483649", "1.0", ""})
    EXPECT_FALSE(libmap::parse_int(text)) << text;
}

TEST(TextTest, SmallLettersOfAsciiAlone) {
  EXPECT_EQ(libmap::lower_case(".PnG \xC3\x84"), ".png \xC3\x84");
}

TEST(TextTest, ParsesSwitches) {
  for (const char* yes : {"true", "TRUE", "yes", "on", "1", " On "})
    EXPECT_EQ(parse_bool(yes), true) << yes;
  for (const char* no : {"false", "No", "off", "0"}) EXPECT_EQ(parse_bool(no), false) << no;
  for (const char* text : {"", "2", "y", "truee"}) EXPECT_FALSE(parse_bool(text)) << text;
}

TEST(TextTest, TrimsAsciiSpaceAlone) {
  EXPECT_EQ(libmap::trim(" \t a b\r\n"), "a b");
  EXPECT_EQ(libmap::trim(" \n"), "");
  EXPECT_EQ(libmap::trim("\xC2\xA0x"), "\xC2\xA0x") << "a no-break space is not blank";
}

TEST(TextTest, NearestNameCountsEdits) {
  const std::vector<std::string> names = {"score", "merge", "lookup", "evaluate"};
  EXPECT_EQ(nearest_name("scor", names), "score");
  EXPECT_EQ(nearest_name("SCORE", names), "score") << "case does not count";
  EXPECT_EQ(nearest_name("megre", names), "merge");
  EXPECT_EQ(nearest_name("evalute", names), "evaluate");
  EXPECT_EQ(nearest_name("score", {}), std::nullopt);
  EXPECT_EQ(nearest_name("zzzzz", names), std::nullopt) << "all of it would have to change";
  EXPECT_EQ(nearest_name("", names), std::nullopt);
}

TEST(TextTest, NearestNameNeverChangesMoreThanHalf) {
  // kitten -> sitting takes three edits of six letters; a shorter name of three edits is too far.
  EXPECT_EQ(nearest_name("kitten", {"sitting"}), "sitting");
  EXPECT_EQ(nearest_name("kite", {"sitting"}), std::nullopt);
  EXPECT_EQ(nearest_name("ab", {"ab1", "ab", "b"}), "ab") << "the nearest and not the first";
}

// The edit distance of two names of 100,000 letters would take minutes.
TEST(TextTest, NearestNameOfVeryLongOnesIsNone) {
  const std::string name(100'000, 'a');
  EXPECT_EQ(libmap::nearest_name(name, {name + "b"}), std::nullopt);
  EXPECT_EQ(libmap::nearest_name("slope", {name, "slop"}), "slop");
}

TEST(TextTest, DidYouMean) {
  EXPECT_EQ(libmap::did_you_mean("scor", {"score"}), " (did you mean 'score'?)");
  EXPECT_EQ(libmap::did_you_mean("xyz", {"score"}), "");
}

class CommaPunctuation : public std::numpunct<char> {
  char do_decimal_point() const override { return ','; }
  char do_thousands_sep() const override { return '.'; }
  std::string do_grouping() const override { return "\3"; }
};

void expect_plain_numbers() {
  EXPECT_EQ(to_text(1234567.25), "1234567.25");
  EXPECT_EQ(to_text(0.5F), "0.5");
  EXPECT_EQ(to_text(std::int64_t{1234567}), "1234567");
  EXPECT_EQ(parse_double("0.25"), 0.25);
  EXPECT_FALSE(parse_double("0,25"));
  EXPECT_EQ(parse_bool("FALSE"), false);
  // In Turkish, I is not the capital of i.
  EXPECT_EQ(nearest_name("INFO", {"info"}), "info");
  EXPECT_EQ(parse_double(".INF"), std::numeric_limits<double>::infinity());
}

TEST(TextTest, StandardLibraryLocaleChangesNothing) {
  const std::locale before =
      std::locale::global(std::locale(std::locale::classic(), new CommaPunctuation));
  expect_plain_numbers();
  std::locale::global(before);
}

class ForeignLocale : public testing::TestWithParam<const char*> {};

TEST_P(ForeignLocale, ChangesNothing) {
  if (std::setlocale(LC_ALL, GetParam()) == nullptr)
    GTEST_SKIP() << GetParam() << " is not installed";
  expect_plain_numbers();
  std::setlocale(LC_ALL, "C");
}

INSTANTIATE_TEST_SUITE_P(TextTest, ForeignLocale, testing::Values("de_DE.UTF-8", "tr_TR.UTF-8"),
                         [](const auto& one) { return std::string(one.param).substr(0, 5); });

}  // namespace text_test
