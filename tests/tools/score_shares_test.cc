// Merged shares of a map, scored in separate processes, equal the map byte for byte, for any number
// of threads and tiles.
#include <gtest/gtest.h>

#include <algorithm>

#include "libmap/core/pose.h"
#include "libmap/io/cloud_io.h"
#include "tests/tools/tool_test_support.h"

namespace score_shares_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::ProgramResult;
using graspmap_test::scratch;
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

class ScoreShares : public testing::TestWithParam<Case> {
 protected:
  ScoreShares() { graspmap_test::write_terrain(); }
  std::string file(const std::string& stem) const { return stem + GetParam().format; }
  ProgramResult score(const std::string& stem, Words more) const {
    more.insert(more.end(), {"--method", GetParam().method});
    return score_to(file(stem), more);
  }
};

TEST_P(ScoreShares, MergedAreTheWholeMap) {
  ASSERT_TRUE(succeeded(score("whole", {})));
  for (const char* number : {"1", "2", "3"})
    ASSERT_TRUE(
        succeeded(score("part" + std::string(number), {"--tile", std::string(number) + "/3"})));
  EXPECT_NE(content(file("part1")), content(file("whole")));
  // In any order.
  ASSERT_TRUE(succeeded(
      graspmap({"convert", file("part3"), file("part1"), file("part2"), "-o", file("merged")})));
  EXPECT_EQ(content(file("merged")), content(file("whole")));
}

TEST_P(ScoreShares, MoreSharesThanTilesAreTheWholeMap) {
  ASSERT_TRUE(succeeded(score("whole", {"--tile-size", "0.4"})));
  Words merge = {"convert", "-o", file("merged")};
  for (int number = 1; number <= 5; ++number) {
    const std::string part = "part" + std::to_string(number);
    ASSERT_TRUE(
        succeeded(score(part, {"--tile-size", "0.4", "--tile", std::to_string(number) + "/5"})));
    merge.push_back(file(part));
  }
  ASSERT_TRUE(succeeded(graspmap(merge)));
  EXPECT_EQ(content(file("merged")), content(file("whole")));
}

TEST_P(ScoreShares, ThreadsAndTilesChangeNothing) {
  ASSERT_TRUE(succeeded(score("first", {"--threads", "1"})));
  const std::string map = content(file("first"));
  for (const Words& flags :
       {Words{"--threads", "2"}, Words{"--threads", "8"}, Words{"--tile-size", "0.05"},
        Words{"--tile-size", "0.37"}, Words{"--tile-size", "5"}}) {
    ASSERT_TRUE(succeeded(score("other", flags)));
    EXPECT_EQ(content(file("other")), map) << flags[0] << " " << flags[1];
  }
}

INSTANTIATE_TEST_SUITE_P(All, ScoreShares,
                         testing::Values(Case{"thesis", ".pcd"}, Case{"thesis", ".csv"},
                                         Case{"envelope", ".pcd"}, Case{"envelope", ".csv"},
                                         Case{"climblab", ".pcd"}, Case{"climblab", ".csv"},
                                         Case{"corrected", ".pcd"}, Case{"corrected", ".csv"}),
                         [](const auto& one) {
                           return std::string(one.param.method) + "_" +
                                  std::string(one.param.format).substr(1);
                         });

class Merge : public testing::Test {
 protected:
  Merge() {
    graspmap_test::write_terrain();
    EXPECT_TRUE(succeeded(share("a.pcd", "1/2", {})));
    EXPECT_TRUE(succeeded(share("b.pcd", "2/2", {})));
  }
  // Convexity is not evaluated: quick.
  static ProgramResult share(const std::string& output, const std::string& tile, Words more) {
    more.insert(more.end(), {"--tile", tile, "--curvature-radius", "0"});
    return score_to(output, more);
  }
  static ProgramResult merge(Words parts) {
    parts.insert(parts.begin(), "convert");
    parts.insert(parts.end(), {"-o", "merged.pcd"});
    const ProgramResult result = graspmap(parts);
    EXPECT_EQ(std::filesystem::exists(scratch("merged.pcd")), result.exit_code == 0);
    EXPECT_EQ(std::filesystem::exists(scratch("merged.pcd.json")), result.exit_code == 0);
    return result;
  }
};

TEST_F(Merge, KeepsWhatTheSharesHaveInCommon) {
  ASSERT_TRUE(succeeded(merge({"a.pcd", "b.pcd"})));
  const nlohmann::json part = graspmap_test::json_of("a.pcd.json");
  const nlohmann::json whole = graspmap_test::json_of("merged.pcd.json");
  EXPECT_EQ(whole.at("command"), "convert");
  EXPECT_EQ(whole.at("frame"), part.at("frame"));
  EXPECT_EQ(whole.at("transforms"), part.at("transforms"));
  EXPECT_EQ(whole.at("parameters").at("method"), "calibrated");
  EXPECT_FALSE(whole.at("parameters").contains("tile"));
  // The terrain and the gripper behind the parts, then the two parts.
  ASSERT_EQ(whole.at("inputs").size(), 4U);
  EXPECT_EQ(whole.at("inputs").at(0), part.at("inputs").at(0));
  EXPECT_EQ(whole.at("inputs").at(3).at("path"), "b.pcd");
  EXPECT_EQ(whole.at("results").at("scored_voxels"),
            part.at("results").at("scored_voxels").get<int>() +
                graspmap_test::json_of("b.pcd.json").at("results").at("scored_voxels").get<int>());
}

// Coordinates from 256 m on are stored in double precision, those of some shares alone here.
TEST(MergeOfShares, AcrossTheBoundOfSinglePrecisionIsTheWholeMap) {
  libmap::write_cloud(
      scratch("terrain.pcd"),
      libmap::transform_cloud(graspmap_test::bumpy_terrain(),
                              libmap::make_pose_from_rpy({255.93, 255.97, 0.0}, {0, 0, 0})));
  for (const std::string format : {".pcd", ".csv", ".ply"})
    for (const std::string method : {"corrected", "thesis", "envelope", "climblab"}) {
      const Words more = {"--plane", "none", "--method", method, "--curvature-radius", "0"};
      ASSERT_TRUE(succeeded(score_to("whole" + format, more)));
      Words merge = {"convert", "-o", "merged" + format};
      for (const char* number : {"1", "2", "3", "4"}) {
        Words share = more;
        share.insert(share.end(), {"--tile", std::string(number) + "/4"});
        merge.push_back(std::string("part") + number + format);
        ASSERT_TRUE(succeeded(score_to(merge.back(), share)));
      }
      ASSERT_TRUE(succeeded(graspmap(merge)));
      EXPECT_TRUE(content("merged" + format) == content("whole" + format)) << format << method;
    }
}

TEST_F(Merge, MissingShare) {
  EXPECT_TRUE(bad_input(merge({"a.pcd"}), {.field = "tile"}));
  EXPECT_TRUE(bad_input(merge({"a.pcd", "none.pcd"}), {.file = "none.pcd", .about = "manifest"}));
}

TEST_F(Merge, ShareTwice) {
  EXPECT_TRUE(
      bad_input(merge({"a.pcd", "a.pcd"}), {.file = "a.pcd", .field = "tile", .value = "1/2"}));
  EXPECT_TRUE(bad_input(merge({"a.pcd", "b.pcd", "b.pcd"}),
                        {.file = "b.pcd", .field = "tile", .value = "2/2"}));
  // By another name.
  std::filesystem::copy_file(scratch("a.pcd"), scratch("b.pcd"),
                             std::filesystem::copy_options::overwrite_existing);
  EXPECT_TRUE(bad_input(merge({"a.pcd", "b.pcd"}),
                        {.file = "a.pcd", .field = "i, j, k", .value = "-30, -30, -3"}));
}

TEST_F(Merge, SharesOfDifferentScenarios) {
  ASSERT_TRUE(succeeded(share("other.pcd", "2/2", {"--extra-void-layers", "2"})));
  EXPECT_TRUE(bad_input(merge({"a.pcd", "other.pcd"}),
                        {.file = "other.pcd", .field = "extra_void_layers"}));
  ASSERT_TRUE(succeeded(share("other.pcd", "2/2", {"--set", "gripper.opening_angle_deg=80"})));
  EXPECT_TRUE(bad_input(merge({"a.pcd", "other.pcd"}),
                        {.file = "other.pcd", .field = "gripper.opening_angle_deg"}));
  ASSERT_TRUE(succeeded(share("first.pcd", "1/2", {"--set", "gripper.opening_angle_deg=80"})));
  EXPECT_TRUE(bad_input(merge({"first.pcd", "b.pcd"}),
                        {.file = "b.pcd", .field = "gripper.opening_angle_deg"}));
  ASSERT_TRUE(succeeded(share("third.pcd", "3/3", {})));
  EXPECT_TRUE(bad_input(merge({"a.pcd", "third.pcd"}),
                        {.file = "third.pcd", .field = "tile", .value = "3/3"}));
}

TEST_F(Merge, SharesOfDifferentInputs) {
  const std::string gripper =
      graspmap_test::read_text(graspmap_test::source_folder() / "data/grippers/scar-e.yaml");
  graspmap_test::write_text(scratch("g.yaml"), gripper);
  ASSERT_TRUE(succeeded(share("c.pcd", "1/2", {"--gripper", "g.yaml"})));
  graspmap_test::write_text(scratch("g.yaml"), gripper + "# changed\n");
  ASSERT_TRUE(succeeded(share("d.pcd", "2/2", {"--gripper", "g.yaml"})));
  EXPECT_TRUE(bad_input(merge({"c.pcd", "d.pcd"}), {.file = "d.pcd", .about = "other inputs"}));
  ASSERT_TRUE(
      succeeded(graspmap({"convert", "terrain.pcd", "-o", "t2.pcd", "--encoding", "ascii"})));
  std::filesystem::rename(scratch("t2.pcd"), scratch("terrain.pcd"));
  ASSERT_TRUE(succeeded(share("e.pcd", "2/2", {})));
  EXPECT_TRUE(bad_input(merge({"a.pcd", "e.pcd"}), {.file = "e.pcd", .about = "other inputs"}));
}

TEST_F(Merge, SharesOfDifferentVersions) {
  const std::string manifest = content("b.pcd.json");
  const std::string version = graspmap_test::json_of("b.pcd.json").at("version");
  const std::string with = "\"version\": \"" + version + "\"";
  const std::size_t at = manifest.find(with);
  ASSERT_NE(at, std::string::npos);
  graspmap_test::write_text(scratch("b.pcd.json"), std::string(manifest).replace(
                                                       at, with.size(), "\"version\": \"9.8.7\""));
  EXPECT_TRUE(bad_input(merge({"a.pcd", "b.pcd"}),
                        {.file = "b.pcd", .field = "version", .value = "9.8.7", .bound = version}));
}

TEST_F(Merge, CloudsThatAreNoShares) {
  EXPECT_TRUE(
      bad_input(merge({"a.pcd", "terrain.pcd"}), {.file = "terrain.pcd", .about = "no manifest"}));
  graspmap_test::write_text(scratch("b.pcd.json"), "{");
  EXPECT_TRUE(bad_input(merge({"a.pcd", "b.pcd"}), {.file = "b.pcd.json", .about = "manifest"}));
  EXPECT_TRUE(bad_input(graspmap({"convert", "a.pcd", "-o", "merged.xyz"}),
                        {.file = "merged.xyz",
                         .field = "extension",
                         .value = ".xyz",
                         .bound = ".pcd, .ply, .csv or .vtp"}));
}

}  // namespace score_shares_test
