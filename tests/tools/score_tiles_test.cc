// The bytes of a map do not depend on the number of threads and the size of the tiles.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/tools/tool_test_support.h"

namespace score_tiles_test {

using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::ProgramResult;
using graspmap_test::succeeded;
using Words = std::vector<std::string>;

ProgramResult score_to(const std::string& output, Words more) {
  Words words = {"score", "terrain.pcd", "-o", output, "--zero-plane", "-0.01"};
  // Small tiles, unless the test says how large.
  if (std::find(more.begin(), more.end(), "--tile-size") == more.end())
    words.insert(words.end(), {"--tile-size", "0.15"});
  words.insert(words.end(), more.begin(), more.end());
  return graspmap(words);
}

struct Case {
  const char* method;
  const char* format;
};

void PrintTo(const Case& given, std::ostream* out) { *out << given.method << given.format; }

class ScoreTiles : public testing::TestWithParam<Case> {
 protected:
  ScoreTiles() { graspmap_test::write_terrain(); }
  std::string file(const std::string& stem) const { return stem + GetParam().format; }
  ProgramResult score(const std::string& stem, Words more) const {
    more.insert(more.end(), {"--method", GetParam().method});
    return score_to(file(stem), more);
  }
};

TEST_P(ScoreTiles, ThreadsAndTilesChangeNothing) {
  ASSERT_TRUE(succeeded(score("first", {"--threads", "1"})));
  const std::string map = content(file("first"));
  for (const Words& flags :
       {Words{"--threads", "2"}, Words{"--threads", "8"}, Words{"--tile-size", "0.05"},
        Words{"--tile-size", "0.37"}, Words{"--tile-size", "5"}}) {
    ASSERT_TRUE(succeeded(score("other", flags)));
    EXPECT_EQ(content(file("other")), map) << flags[0] << " " << flags[1];
  }
}

INSTANTIATE_TEST_SUITE_P(All, ScoreTiles,
                         testing::Values(Case{"thesis", ".pcd"}, Case{"thesis", ".csv"},
                                         Case{"envelope", ".pcd"}, Case{"envelope", ".csv"},
                                         Case{"climblab", ".pcd"}, Case{"climblab", ".csv"},
                                         Case{"corrected", ".pcd"}, Case{"corrected", ".csv"}),
                         [](const auto& one) {
                           return std::string(one.param.method) + "_" +
                                  std::string(one.param.format).substr(1);
                         });

}  // namespace score_tiles_test
