#include <gtest/gtest.h>

#include <set>

#include "libmap/core/table.h"
#include "libmap/io/cloud_io.h"
#include "tests/tools/tool_test_support.h"

namespace lookup_test {

using graspmap_test::bad_input;
using graspmap_test::ended_with;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::ProgramResult;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::write_text;
using libmap::Table;
using Words = std::vector<std::string>;

// Three voxels of 1 cm along x.
void write_small_map() {
  write_text(scratch("map.csv"),
             "x,y,z,score,ssv,graspable\n"
             "0.005,0.005,0.005,0.5,200,0\n"
             "0.015,0.005,0.005,0.9,210,1\n"
             "0.025,0.005,0.005,0.25,220,0\n");
}

Table looked_up(const Words& more) {
  Words words = {"lookup", "map.csv", "points.csv", "-o", "answers.csv"};
  words.insert(words.end(), more.begin(), more.end());
  const ProgramResult result = graspmap(words);
  EXPECT_TRUE(succeeded(result));
  return result.exit_code == 0 ? libmap::read_csv(scratch("answers.csv")) : Table{};
}

std::string cell(const Table& table, std::size_t row, const std::string& column) {
  return table.rows.at(row).at(table.column(column));
}

TEST(Lookup, EveryPointIsAnswered) {
  write_small_map();
  write_text(scratch("points.csv"),
             "name,x,y,z\n"
             "on,0.015,0.005,0.005\n"
             "beside,0.025,0.005,0.035\n"
             "\"far, off\",1,2,3\n"
             "farther,-1e6,0,0\n");
  const Table answers = looked_up({});
  ASSERT_EQ(answers.rows.size(), 4U);
  EXPECT_EQ(cell(answers, 0, "name"), "on");
  EXPECT_EQ(cell(answers, 0, "found"), "1");
  EXPECT_EQ(answers.number(0, answers.column("distance_m")), 0);
  EXPECT_EQ(cell(answers, 0, "score"), "0.9");
  EXPECT_EQ(cell(answers, 0, "ssv"), "210");
  EXPECT_EQ(cell(answers, 0, "graspable"), "1");
  EXPECT_EQ(cell(answers, 1, "found"), "1");
  EXPECT_NEAR(answers.number(1, answers.column("distance_m")), 0.03, 1e-7);
  EXPECT_EQ(cell(answers, 1, "score"), "0.25");
  EXPECT_EQ(cell(answers, 2, "name"), "far, off");
  for (const std::size_t row : {2U, 3U}) {
    EXPECT_EQ(cell(answers, row, "found"), "0");
    EXPECT_EQ(cell(answers, row, "score"), "");
    EXPECT_EQ(cell(answers, row, "graspable"), "");
    EXPECT_GT(answers.number(row, answers.column("distance_m")), 3);
  }
  const nlohmann::json manifest = graspmap_test::json_of("answers.csv.json");
  EXPECT_EQ(manifest.at("results").at("points"), 4);
  EXPECT_EQ(manifest.at("results").at("found"), 2);
  EXPECT_EQ(manifest.at("inputs").size(), 2U);
}

TEST(Lookup, MaxDistanceIsABound) {
  write_small_map();
  write_text(scratch("points.csv"), "x,y,z\n0.025,0.005,0.035\n");
  EXPECT_EQ(cell(looked_up({"--max-distance", "0.031"}), 0, "found"), "1");
  EXPECT_EQ(cell(looked_up({"--max-distance", "0.029"}), 0, "found"), "0");
}

TEST(Lookup, MaximumAndMeanWithinTheRadius) {
  write_small_map();
  write_text(scratch("points.csv"), "x,y,z\n0.0251,0.005,0.005\n0.5,0.005,0.005\n");
  const Table best = looked_up({"--mode", "maximum", "--radius", "0.012"});
  EXPECT_EQ(cell(best, 0, "score"), "0.9");
  EXPECT_EQ(cell(best, 0, "ssv"), "210");
  EXPECT_EQ(cell(best, 1, "found"), "0");
  const Table mean = looked_up({"--mode", "mean", "--radius", "0.012"});
  EXPECT_NEAR(mean.number(0, mean.column("score")), 0.575, 1e-6);
  EXPECT_NEAR(mean.number(0, mean.column("ssv")), 215, 1e-4);
  EXPECT_EQ(cell(mean, 1, "score"), "");
}

TEST(Lookup, ColumnsOfThePointsKeepTheirNames) {
  write_small_map();
  write_text(scratch("points.csv"), "id,graspable,x,y,z\n7,yes,0.015,0.005,0.005\n");
  const Table answers = looked_up({});
  EXPECT_EQ(cell(answers, 0, "graspable"), "yes") << "the verdict of the field test";
  EXPECT_EQ(cell(answers, 0, "map_graspable"), "1");
  EXPECT_EQ(cell(answers, 0, "id"), "7");
}

TEST(Lookup, AnswersCanBeLookedUpAgainAndAgain) {
  write_small_map();
  write_text(scratch("points.csv"), "x,y,z,score\n0.015,0.005,0.005,0.1\n");
  for (int round = 0; round < 3; ++round) {
    const Table answers = looked_up({});
    EXPECT_EQ(cell(answers, 0, "score"), "0.1");
    const std::set<std::string> names(answers.columns.begin(), answers.columns.end());
    EXPECT_EQ(names.size(), answers.columns.size()) << "a column is a duplicate";
    std::filesystem::copy_file(scratch("answers.csv"), scratch("points.csv"),
                               std::filesystem::copy_options::overwrite_existing);
  }
}

TEST(Lookup, FramesOfMapAndPointsMeet) {
  const libmap::PointCloud terrain = libmap::transform_cloud(
      graspmap_test::bumpy_terrain(), libmap::make_pose_from_rpy({4, -7, 2}, {12, -20, 35}));
  libmap::write_cloud(scratch("tilted.pcd"), terrain);
  for (const std::string frame : {"terrain", "input"}) {
    ASSERT_TRUE(succeeded(graspmap({"score", "tilted.pcd", "--curvature-radius", "0", "--up",
                                    "0,0,1", "--frame", frame, "-o", frame + ".csv"})));
  }
  const Table scores = libmap::read_csv(scratch("terrain.csv"));
  for (const std::string map : {"terrain.csv", "input.csv"})
    for (const std::string points : {"terrain", "input"}) {
      ASSERT_TRUE(succeeded(graspmap(
          {"lookup", map, points + ".csv", "--points-frame", points, "-o", "answers.csv"})));
      // The points' manifest says as much.
      ASSERT_TRUE(succeeded(graspmap({"lookup", map, points + ".csv", "-o", "by_manifest.csv"})));
      EXPECT_EQ(graspmap_test::content("by_manifest.csv"), graspmap_test::content("answers.csv"));
      EXPECT_EQ(json_of("by_manifest.csv.json").at("parameters").at("points_frame"), points);
      ASSERT_TRUE(succeeded(graspmap({"lookup", map, "answers.csv", "-o", "again.csv"})));
      EXPECT_EQ(json_of("again.csv.json").at("parameters").at("points_frame"), points);
      const Table answers = libmap::read_csv(scratch("answers.csv"));
      ASSERT_EQ(answers.rows.size(), scores.rows.size());
      std::size_t wrong = 0;
      for (std::size_t row = 0; row < scores.rows.size(); ++row) {
        wrong += answers.number(row, answers.column("distance_m")) > 1e-5 ? 1 : 0;
        wrong += cell(answers, row, "map_score") != cell(scores, row, "score") ? 1 : 0;
        wrong += cell(answers, row, "map_i") != cell(scores, row, "i") ? 1 : 0;
      }
      EXPECT_EQ(wrong, 0U) << map << " looked up at points in the frame " << points;
    }
}

TEST(Lookup, PointsInTheTerrainFrameOfAnotherMapAreRefused) {
  graspmap_test::write_terrain();
  ASSERT_TRUE(succeeded(graspmap({"score", "terrain.pcd", "-o", "map.csv"})));
  libmap::write_cloud(
      scratch("moved.pcd"),
      libmap::transform_cloud(graspmap_test::bumpy_terrain(),
                              libmap::make_pose_from_rpy({4, -7, 2}, {12, -20, 35})));
  ASSERT_TRUE(succeeded(graspmap({"score", "moved.pcd", "-o", "other.pcd"})));
  EXPECT_TRUE(bad_input(graspmap({"lookup", "other.pcd", "map.csv", "-o", "answers.csv"}),
                        {.file = "map.csv", .field = "--points-frame", .value = "auto"}));
  // Neither by way of a look-up, nor on a cloud that was never scored.
  ASSERT_TRUE(succeeded(graspmap({"lookup", "map.csv", "map.csv", "-o", "own.csv"})));
  for (const char* map : {"other.pcd", "terrain.pcd"})
    EXPECT_TRUE(bad_input(graspmap({"lookup", map, "own.csv", "-o", "answers.csv"}),
                          {.file = "own.csv", .field = "--points-frame", .value = "auto"}))
        << map;
  EXPECT_TRUE(succeeded(graspmap(
      {"lookup", "other.pcd", "map.csv", "--points-frame", "terrain", "-o", "answers.csv"})));
}

TEST(Lookup, ConvertedMapStillKnowsItsFrame) {
  libmap::write_cloud(scratch("shifted.pcd"),
                      libmap::transform_cloud(graspmap_test::bumpy_terrain(),
                                              libmap::make_pose_from_rpy({40, 0, 0}, {0, 0, 0})));
  ASSERT_TRUE(
      succeeded(graspmap({"score", "shifted.pcd", "--curvature-radius", "0", "-o", "scored.pcd"})));
  ASSERT_TRUE(succeeded(graspmap({"convert", "scored.pcd", "-o", "map.csv"})));
  write_text(scratch("points.csv"), "x,y,z\n40,0,0\n0,0,0\n");
  const Table answers = looked_up({});
  EXPECT_EQ(cell(answers, 0, "found"), "1");
  EXPECT_EQ(cell(answers, 1, "found"), "0");
}

TEST(Lookup, NamedColumnsAlone) {
  write_small_map();
  write_text(scratch("points.csv"),
             "name,x,y,z\na,0.015,0.005,0.005\nb,0.025,0.005,0.005\nc,1,2,3\n");
  const Table answers = looked_up(
      {"--column", "first=score, held=graspable,good=score >= 0.9,seen=found,off=distance_m"});
  EXPECT_EQ(answers.columns,
            (Words{"name", "x", "y", "z", "first", "held", "good", "seen", "off"}));
  ASSERT_EQ(answers.rows.size(), 3U);
  EXPECT_EQ(answers.rows[0], (Words{"a", "0.015", "0.005", "0.005", "0.9", "1", "1", "1", "0"}));
  EXPECT_EQ(answers.rows[1], (Words{"b", "0.025", "0.005", "0.005", "0.25", "0", "0", "1", "0"}));
  EXPECT_EQ(cell(answers, 2, "first"), "");
  EXPECT_EQ(cell(answers, 2, "good"), "") << "no answer is no refusal";
  EXPECT_EQ(cell(answers, 2, "seen"), "0");
  EXPECT_GT(answers.number(2, answers.column("off")), 3);
}

TEST(Lookup, ScoreInSinglePrecisionReachesItsCutoff) {
  write_small_map();
  write_text(scratch("points.csv"), "x,y,z\n0.015,0.005,0.005\n");
  libmap::PointCloud map = libmap::read_cloud(scratch("map.csv")).cloud;
  for (libmap::ScalarField& field : map.fields) field.type = libmap::ScalarType::float32;
  libmap::write_cloud(scratch("map.pcd"), map);
  ASSERT_TRUE(succeeded(graspmap({"lookup", "map.pcd", "points.csv", "-o", "answers.csv",
                                  "--column", "good=score>=0.9,better=score>=0.9001"})));
  EXPECT_EQ(libmap::read_csv(scratch("answers.csv")).rows[0],
            (Words{"0.015", "0.005", "0.005", "1", "0"}));
}

TEST(Lookup, OnlyWhatWasMeasuredIsVisible) {
  write_small_map();
  write_text(scratch("points.csv"), "name,x,y,z\na,0.015,0.005,0.005\nb,0.025,0.005,0.005\n");
  // The map has voxels at both, measured is 3 mm beside the first.
  write_text(scratch("seen.csv"), "x,y,z\n0.015,0.008,0.005\n0.9,0.9,0.9\n");
  const Table near_by =
      looked_up({"--visible", "seen.csv", "--visible-radius", "0.004", "--column", "s=score"});
  EXPECT_EQ(cell(near_by, 0, "s"), "0.9");
  EXPECT_EQ(cell(near_by, 1, "s"), "");
  EXPECT_EQ(graspmap_test::json_of("answers.csv.json").at("results").at("visible"), 1);
  EXPECT_EQ(graspmap_test::json_of("answers.csv.json").at("results").at("found"), 1);
  EXPECT_EQ(graspmap_test::json_of("answers.csv.json").at("inputs").size(), 3U);
  EXPECT_EQ(cell(looked_up({"--visible", "seen.csv", "--visible-radius", "0.002"}), 0, "score"),
            "");
  const Table farther = looked_up({"--visible", "seen.csv", "--visible-radius", "0.011"});
  EXPECT_EQ(cell(farther, 1, "score"), "0.25");
  EXPECT_EQ(cell(farther, 1, "found"), "1");
}

TEST(Lookup, VisibleIsInTheFrameOfTheScoredCloud) {
  const libmap::PointCloud terrain = libmap::transform_cloud(
      graspmap_test::bumpy_terrain(), libmap::make_pose_from_rpy({4, -7, 2}, {12, -20, 35}));
  libmap::write_cloud(scratch("tilted.pcd"), terrain);
  for (const std::string frame : {"terrain", "input"})
    ASSERT_TRUE(succeeded(graspmap({"score", "tilted.pcd", "--curvature-radius", "0", "--up",
                                    "0,0,1", "--frame", frame, "-o", frame + ".csv"})));
  for (const std::string map : {"terrain.csv", "input.csv"})
    for (const std::string points : {"terrain", "input"}) {
      ASSERT_TRUE(succeeded(graspmap({"lookup", map, points + ".csv", "--points-frame", points,
                                      "--visible", "tilted.pcd", "-o", "answers.csv"})));
      const nlohmann::json results = graspmap_test::json_of("answers.csv.json").at("results");
      EXPECT_EQ(results.at("visible"), results.at("points")) << map << " in the frame " << points;
    }
}

class LookupBadInput : public testing::Test {
 protected:
  LookupBadInput() { write_small_map(); }
  static ProgramResult lookup(const std::string& points) {
    write_text(scratch("points.csv"), points);
    const ProgramResult result = graspmap({"lookup", "map.csv", "points.csv", "-o", "out.csv"});
    EXPECT_FALSE(std::filesystem::exists(scratch("out.csv")));
    EXPECT_FALSE(std::filesystem::exists(scratch("out.csv.json")));
    return result;
  }
};

TEST_F(LookupBadInput, MissingColumn) {
  EXPECT_TRUE(
      bad_input(lookup("x,y,hight\n1,2,3\n"), {.file = "points.csv", .field = "column 'z'"}));
  EXPECT_TRUE(bad_input(lookup("X,Y,Z\n1,2,3\n"), {.file = "points.csv", .field = "column 'x'"}));
  EXPECT_TRUE(bad_input(lookup(""), {.file = "points.csv"}));
}

TEST_F(LookupBadInput, TextInANumber) {
  EXPECT_TRUE(bad_input(lookup("x,y,z\n1,2,3\n4,five,6\n"),
                        {.file = "points.csv", .field = "row 2, column 'y'", .value = "'five'"}));
  EXPECT_TRUE(bad_input(lookup("x,y,z\n1,,3\n"),
                        {.file = "points.csv", .field = "row 1, column 'y'", .value = "''"}));
  EXPECT_TRUE(bad_input(lookup("x,y,z\n1,nan,3\n"), {.file = "points.csv", .field = "row 1"}));
  EXPECT_TRUE(bad_input(lookup("x,y,z\n1,inf,3\n"), {.file = "points.csv", .field = "row 1"}));
}

TEST_F(LookupBadInput, BrokenTable) {
  EXPECT_TRUE(bad_input(lookup("x,y,z\n1,2\n"),
                        {.file = "points.csv", .field = "line 2", .value = "2 cells long"}));
  EXPECT_TRUE(bad_input(lookup("x,y,z\n1,\"2,3\n"), {.file = "points.csv", .field = "line 3"}));
  EXPECT_TRUE(bad_input(lookup(std::string("x,y,z\n1,\0002,3\n", 13)), {.file = "points.csv"}));
}

TEST_F(LookupBadInput, MapsThatCannotBe) {
  write_text(scratch("points.csv"), "x,y,z\n1,2,3\n");
  write_text(scratch("empty.csv"), "x,y,z,score\n");
  EXPECT_TRUE(bad_input(graspmap({"lookup", "none.pcd", "points.csv", "-o", "out.csv"}),
                        {.file = "none.pcd"}));
  EXPECT_TRUE(bad_input(graspmap({"lookup", "map.csv", "none.csv", "-o", "out.csv"}),
                        {.file = "none.csv"}));
  EXPECT_TRUE(bad_input(graspmap({"lookup", "map.csv", "points.csv", "-o", "out.pcd"}),
                        {.file = "out.pcd"}));
  EXPECT_TRUE(bad_input(graspmap({"lookup", "empty.csv", "points.csv", "-o", "out.csv"}),
                        {.file = "empty.csv", .field = "points of the map"}));
  write_text(scratch("map.csv.json"), "{broken");
  EXPECT_TRUE(bad_input(graspmap({"lookup", "map.csv", "points.csv", "-o", "out.csv"}),
                        {.file = "map.csv.json"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("out.csv")));
}

TEST_F(LookupBadInput, ColumnsThatCannotBe) {
  write_text(scratch("points.csv"), "name,x,y,z\na,0.015,0.005,0.005\n");
  const auto column = [](const std::string& text) {
    return graspmap({"lookup", "map.csv", "points.csv", "-o", "out.csv", "--column", text});
  };
  for (const std::string text :
       {"score", "=score", "a=", "a=score>=much", "a=>=0.5", "a=score>=", "score>=0.5"})
    EXPECT_TRUE(bad_input(
        column(text),
        {.field = "--column", .value = text, .bound = "NAME=FIELD or NAME=FIELD>=VALUE"}));
  // After a word on the manifest that the map has not.
  EXPECT_TRUE(
      ended_with(column("a=scor"),
                 {.file = "map.csv", .field = "--column", .value = "scor", .about = "'score'"}));
  EXPECT_TRUE(ended_with(column("name=score"),
                         {.file = "points.csv", .field = "--column", .value = "name"}));
  EXPECT_TRUE(ended_with(column("a=score,a=ssv"),
                         {.file = "points.csv", .field = "--column", .value = "a"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("out.csv")));
}

TEST_F(LookupBadInput, CloudsThatCannotHaveBeenMeasured) {
  write_text(scratch("points.csv"), "x,y,z\n1,2,3\n");
  write_text(scratch("empty.csv"), "x,y,z\n");
  const auto visible = [](const std::string& cloud) {
    return graspmap({"lookup", "map.csv", "points.csv", "-o", "out.csv", "--visible", cloud});
  };
  EXPECT_TRUE(ended_with(visible("none.pcd"), {.file = "none.pcd"}));
  EXPECT_TRUE(
      ended_with(visible("empty.csv"), {.file = "empty.csv", .field = "points of the cloud"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("out.csv")));
}

TEST_F(LookupBadInput, TablesWithoutRows) {
  write_small_map();
  write_text(scratch("points.csv"), "x,y,z\n");
  const ProgramResult result = graspmap({"lookup", "map.pcd", "points.csv", "-o", "out.csv"});
  EXPECT_TRUE(bad_input(result, {.file = "points.csv"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("out.csv")));
}

// CSV of Excel for the Macintosh.
TEST(Lookup, CarriageReturnsEndRows) {
  write_small_map();
  write_text(scratch("points.csv"), "x,y,z\n0,0,0\n1,0,0\n");
  const auto rows = looked_up({}).rows;
  write_text(scratch("points.csv"), "x,y,z\r0,0,0\r1,0,0\r");
  EXPECT_EQ(looked_up({}).rows, rows);
  EXPECT_EQ(rows.size(), 2U);
}

}  // namespace lookup_test
