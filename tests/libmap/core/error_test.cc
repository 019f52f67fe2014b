#include "libmap/core/error.h"

#include <gtest/gtest.h>

#include <type_traits>

#include "tests/support/expected_error.h"

namespace error_test {

using libmap::Error;
using libmap::ErrorKind;

TEST(ErrorTest, SaysFileFieldValueReasonAndBound) {
  const Error error("out of range",
                    {.file = "a.yaml", .field = "size_m", .value = "0", .bound = "> 0"});
  EXPECT_STREQ(error.what(), "a.yaml: size_m is 0: out of range (must be > 0)");
  EXPECT_EQ(error.reason(), "out of range");
  EXPECT_EQ(error.context().file, "a.yaml");
  EXPECT_EQ(error.context().field, "size_m");
  EXPECT_EQ(error.context().value, "0");
  EXPECT_EQ(error.context().bound, "> 0");
  EXPECT_EQ(error.kind(), ErrorKind::bad_input);
}

TEST(ErrorTest, LeavesOutWhatIsEmpty) {
  EXPECT_STREQ(Error("broken").what(), "broken");
  EXPECT_STREQ(Error("no such file", {.file = "a.pcd"}).what(), "a.pcd: no such file");
  EXPECT_STREQ(Error("missing", {.field = "name"}).what(), "name: missing");
  EXPECT_STREQ(Error("unknown", {.value = "x"}).what(), "'x': unknown");
  EXPECT_STREQ(Error("too large", {.bound = "< 3"}).what(), "too large (must be < 3)");
}

TEST(ErrorTest, IsAStandardException) {
  static_assert(std::is_base_of_v<std::runtime_error, Error>);
  try {
    throw Error("full", {}, ErrorKind::failed);
  } catch (const std::exception& caught) {
    EXPECT_STREQ(caught.what(), "full");
  }
}

TEST(ErrorTest, InFileNamesAFileOnce) {
  const Error error("missing", {.field = "x"}, ErrorKind::failed);
  const Error named = error.in_file("points.csv");
  EXPECT_STREQ(named.what(), "points.csv: x: missing");
  EXPECT_EQ(named.kind(), ErrorKind::failed);
  EXPECT_STREQ(named.in_file("other.csv").what(), "points.csv: x: missing");
  EXPECT_STREQ(error.what(), "x: missing") << "the original stays as it was";
}

TEST(ErrorTest, InFieldNamesThePlaceAroundAField) {
  const Error error("missing", {.field = "x"}, ErrorKind::failed);
  EXPECT_STREQ(error.in_field("point 3").what(), "point 3: x: missing");
  EXPECT_STREQ(error.in_field("points[3]", ".").what(), "points[3].x: missing");
  EXPECT_STREQ(Error("missing").in_field("point 3").what(), "point 3: missing");
  EXPECT_EQ(error.in_field("point 3").kind(), ErrorKind::failed);
}

using graspmap_test::is_error;
using graspmap_test::is_error_text;

// The comparisons of the tests themselves: each other part is another error.
TEST(ExpectedError, EachPartIsCompared) {
  const Error error("out of range", {"a.yaml", "size_m", "0", "> 0"});
  EXPECT_TRUE(is_error(error, {"a.yaml", "size_m", "0", "> 0", "range"}));
  EXPECT_TRUE(is_error_text(error.what(), {"a.yaml", "size_m", "0", "> 0", "range"}));
  EXPECT_TRUE(is_error_text(error.what(), {.field = "size_m"}));
  for (const graspmap_test::ExpectedError& other : {graspmap_test::ExpectedError{.file = "b.yaml"},
                                                    {.field = "size"},
                                                    {.field = "m"},
                                                    {.value = "0."},
                                                    {.bound = ">= 0"},
                                                    {.about = "missing"},
                                                    {.file = "yaml"}}) {
    EXPECT_FALSE(is_error(error, other));
    EXPECT_FALSE(is_error_text(error.what(), other));
  }
  EXPECT_FALSE(is_error(error, {.kind = ErrorKind::failed}));
  EXPECT_TRUE(is_error_text("'x': unknown", {.value = "x"}));
  EXPECT_TRUE(is_error_text("a.csv: row 1: missing", {.field = "row 1"}));
  EXPECT_FALSE(is_error_text("a.csv: row 12: missing", {.field = "row 1"}));
}

}  // namespace error_test
