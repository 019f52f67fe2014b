#include "libgtd/evaluate/expected_map.h"
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "libgtd/evaluate/map_summary.h"
#include "tests/support/test_support.h"

namespace expected_map_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::uniform;
using libgtd::evaluate_expected_map;
using libgtd::ExpectedMap;
using libgtd::ExpectedMapResult;
using libgtd::ExpectedRegion;

const std::string header = "region,x,y,z,to_x,to_y,to_z,radius,graspable,why\n";

ExpectedMap parse(const std::string& rows) {
  return libgtd::parse_expected_map(libmap::parse_csv(header + rows, "e.csv"));
}

libmap::Error parse_error(const std::string& rows) {
  return error_of([&] { parse(rows); });
}

// One point per voxel with `score`; all are graspable without `flags`.
libmap::PointCloud map_of(const std::vector<Eigen::Vector3d>& positions,
                          const std::vector<double>& scores, const std::vector<double>& flags) {
  libmap::PointCloud map;
  map.positions = positions;
  map.add_field("score", libmap::ScalarType::float32).values = scores;
  if (!flags.empty()) map.add_field("graspable", libmap::ScalarType::uint8).values = flags;
  return map;
}

TEST(ExpectedMap, CountsByHand) {
  const ExpectedMap expected =
      parse("yes,0,0,0,,,,0.1,1,\nno,1,0,0,1,1,0,0.1,0,\nopen,0.05,0,0,,,,0.02,,\n");
  const ExpectedMapResult result = evaluate_expected_map(
      map_of({{0, 0, 0},       // yes, reaches
              {0, 0.09, 0},    // yes, does not
              {0, 0, 0.1},     // yes, on the border, reaches
              {0.05, 0, 0},    // undecided, also inside yes
              {1.05, 0.5, 0},  // no, beside the segment's middle, does not
              {1, 1.09, 0},    // no, beyond its end, reaches
              {1, 1.11, 0},    // in no region
              {1, 0, 0}},      // no, without a score
             {0.9, 0.79, 0.8, 1.0, 0.1, 0.85, 1.0, std::nan("")}, {0, 0, 1, 1, 0, 1, 1, 1}),
      expected, 0.8);
  EXPECT_EQ(result.voxels_by_score.true_positives, 2U);
  EXPECT_EQ(result.voxels_by_score.false_negatives, 1U);
  EXPECT_EQ(result.voxels_by_score.true_negatives, 1U);
  EXPECT_EQ(result.voxels_by_score.false_positives, 1U);
  EXPECT_EQ(result.voxels_by_flag->true_positives, 1U);
  EXPECT_EQ(result.voxels_by_flag->false_negatives, 2U);
  EXPECT_EQ(result.voxels_by_flag->false_positives, 1U);
  EXPECT_EQ(result.undecided_voxels, 1U);
  EXPECT_EQ(result.unlisted_voxels, 2U);
  EXPECT_DOUBLE_EQ(*libgtd::youden_index(result.voxels_by_score), 2.0 / 3.0 + 0.5 - 1.0);
  // Pairs of a positive and a negative: 0.9, 0.79, 0.8 against 0.1, 0.85.
  EXPECT_DOUBLE_EQ(result.auc->trapezoid, 4.0 / 6.0);
  ASSERT_EQ(result.regions.size(), 3U);
  EXPECT_EQ(result.regions[0].voxels, 3U);
  EXPECT_EQ(result.regions[0].reaching_cutoff, 2U);
  EXPECT_EQ(result.regions[0].graspable, 1U);
  EXPECT_DOUBLE_EQ(*result.regions[0].median_score, 0.8);
  EXPECT_DOUBLE_EQ(*result.regions[1].mean_score, 0.475);
  EXPECT_EQ(result.regions[2].voxels, 1U);
  // "no" is predicted graspable: one of its two voxels reaches the cutoff.
  EXPECT_EQ(result.region_confusion.true_positives, 1U);
  EXPECT_EQ(result.region_confusion.false_positives, 1U);
  EXPECT_EQ(result.region_confusion.size(), 2U);
}

// As in all other counts, an obstacle is not graspable, even with the flag.
TEST(ExpectedMap, ObstaclesAreNotFlagged) {
  libmap::PointCloud map =
      map_of({{0, 0, 0}, {0, 0.05, 0}, {0, 0, 0.05}}, {0.9, 0.9, 0.9}, {1, 1, std::nan("")});
  map.add_field("obstacle", libmap::ScalarType::uint8).values = {0, 2, 0};
  const ExpectedMapResult result = evaluate_expected_map(map, parse("yes,0,0,0,,,,0.1,1,\n"), 0.8);
  EXPECT_EQ(result.voxels_by_score.true_positives, 3U);
  EXPECT_EQ(result.voxels_by_flag->true_positives, 1U);
  EXPECT_EQ(result.regions[0].graspable, 1U);
}

// Oracle: the nearest of a thousand positions along each segment.
bool holds(const ExpectedRegion& region, const Eigen::Vector3d& point) {
  constexpr int steps = 1000;
  double nearest = 1e9;
  for (int k = 0; k <= steps; ++k)
    nearest =
        std::min(nearest, (region.from + (region.to - region.from) * k / steps - point).norm());
  return nearest <= region.radius_m;
}

TEST(ExpectedMap, AgreesWithASlowOracle) {
  const ExpectedMap expected = parse(
      "a,0,0,0,0.4,0.1,0.2,0.11,1,\nb,0.2,0.2,0.1,0.3,0.2,0.1,0.2,1,\n"
      "c,-0.4,-0.4,0,-0.4,-0.1,0,0.15,0,\nd,0.1,0,0,,,,0.07,,\n");
  std::vector<Eigen::Vector3d> positions;
  std::vector<double> scores, flags;
  for (int n = 0; n < 3000; ++n) {
    positions.emplace_back(uniform(-0.6, 0.6), uniform(-0.6, 0.6), uniform(-0.2, 0.4));
    scores.push_back(uniform(0.0, 1.0));
    flags.push_back(uniform(0.0, 1.0) < 0.5 ? 1.0 : 0.0);
  }
  libgtd::Confusion counts;
  std::size_t undecided = 0;
  for (std::size_t n = 0; n < positions.size(); ++n) {
    const auto in = [&](std::size_t r) { return holds(expected.regions[r], positions[n]); };
    if (in(3)) {
      ++undecided;
      continue;
    }
    const bool reaching_cutoff = scores[n] >= 0.6;
    if (in(0) || in(1)) ++(reaching_cutoff ? counts.true_positives : counts.false_negatives);
    if (in(2)) ++(reaching_cutoff ? counts.false_positives : counts.true_negatives);
  }
  const ExpectedMapResult result =
      evaluate_expected_map(map_of(positions, scores, flags), expected, 0.6);
  EXPECT_GT(counts.positives(), 100U);
  EXPECT_GT(counts.negatives(), 30U);
  // The steps of the oracle are 0.4 mm; no point here is that near to a border.
  EXPECT_EQ(result.voxels_by_score.true_positives, counts.true_positives);
  EXPECT_EQ(result.voxels_by_score.false_negatives, counts.false_negatives);
  EXPECT_EQ(result.voxels_by_score.false_positives, counts.false_positives);
  EXPECT_EQ(result.voxels_by_score.true_negatives, counts.true_negatives);
  EXPECT_EQ(result.undecided_voxels, undecided);
}

TEST(ExpectedMap, DoesNotDependOnFrameOrOrder) {
  const ExpectedMap expected = parse("a,0,0,0,0.4,0.1,0.2,0.11,1,\nc,-0.4,-0.4,0,,,,0.15,0,\n");
  std::vector<Eigen::Vector3d> positions;
  std::vector<double> scores;
  for (int n = 0; n < 500; ++n) {
    positions.emplace_back(uniform(-0.6, 0.6), uniform(-0.6, 0.6), uniform(-0.2, 0.4));
    scores.push_back(uniform(0.0, 1.0));
  }
  libmap::Pose pose = libmap::Pose::Identity();
  pose.rotate(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  pose.pretranslate(Eigen::Vector3d(5, -3, 1));
  libmap::PointCloud moved = map_of(positions, scores, {});
  for (Eigen::Vector3d& position : moved.positions) position = pose * position;
  std::reverse(moved.positions.begin(), moved.positions.end());
  std::vector<double>& values = moved.find_field("score")->values;
  std::reverse(values.begin(), values.end());
  const auto here = evaluate_expected_map(map_of(positions, scores, {}), expected, 0.5);
  const auto there = evaluate_expected_map(moved, libgtd::transformed(expected, pose), 0.5);
  EXPECT_GT(here.voxels_by_score.size(), 10U);
  EXPECT_EQ(here.voxels_by_score.true_positives, there.voxels_by_score.true_positives);
  EXPECT_EQ(here.voxels_by_score.false_positives, there.voxels_by_score.false_positives);
  EXPECT_EQ(here.regions[0].mean_score, there.regions[0].mean_score);
  EXPECT_FALSE(here.voxels_by_flag.has_value());
}

TEST(ExpectedMap, HostileTables) {
  EXPECT_TRUE(
      is_error(parse_error("a,0,0,0,,,,-0.1,1,\n"),
               {.file = "e.csv", .field = "region 'a', radius", .value = "-0.1", .bound = "> 0"}));
  EXPECT_TRUE(
      is_error(parse_error("a,0,0,0,,,,0,1,\n"),
               {.file = "e.csv", .field = "region 'a', radius", .value = "0", .bound = "> 0"}));
  EXPECT_TRUE(
      is_error(parse_error("a,0,nan,0,,,,0.1,1,\n"), {.file = "e.csv", .field = "region 'a'"}));
  EXPECT_TRUE(is_error(parse_error("a,0,0,0,1,,,0.1,1,\n"),
                       {.file = "e.csv", .field = "row 1, columns to_x, to_y, to_z"}));
  EXPECT_TRUE(
      is_error(parse_error("a,0,0,0,,,,0.1,maybe,\n"),
               {.file = "e.csv", .field = "row 1, column 'graspable'", .value = "'maybe'"}));
  EXPECT_TRUE(is_error(parse_error("a,0,0,0,,,,0.1,1,\na,1,0,0,,,,0.1,1,\n"),
                       {.file = "e.csv", .field = "region 'a'"}));
  EXPECT_TRUE(is_error(parse_error(",0,0,0,,,,0.1,1,\n"), {.file = "e.csv", .field = "region"}));
  EXPECT_TRUE(is_error(parse_error("a,0,0,0,,,,0.1,,\n"), {.file = "e.csv", .field = "graspable"}));
  EXPECT_TRUE(is_error(parse_error(""), {.file = "e.csv", .field = "graspable"}));
  const auto of_text = [](const std::string& text) {
    return error_of([&] { libgtd::parse_expected_map(libmap::parse_csv(text, "e.csv")); });
  };
  EXPECT_TRUE(is_error(of_text("region,x,y,z,to_x,to_y,to_z,radius,graspable,why,raduis\n"),
                       {.file = "e.csv", .field = "raduis"}));
  EXPECT_TRUE(is_error(of_text("region,x,y,z,radius,graspable,why\na,0,0,0,1,1,\n"),
                       {.file = "e.csv", .field = "column 'to_x'"}));
  EXPECT_TRUE(is_error(of_text("region,x,y,z,to_x,to_y,to_z,radius,graspable,why,y\n"),
                       {.file = "e.csv", .field = "y"}));
}

// Overlapping regions of different verdicts: balls, a ball on a segment, crossing and passing
// segments.
TEST(ExpectedMap, ContradictionsAreErrors) {
  EXPECT_TRUE(is_error(parse_error("a,0,0,0,,,,0.1,1,\nb,0.19,0,0,,,,0.1,0,\n"),
                       {.file = "e.csv", .field = "regions 'a' and 'b'"}));
  EXPECT_TRUE(is_error(parse_error("a,0,0,0,2,0,0,0.1,1,\nb,1,0.15,0,,,,0.1,0,\n"),
                       {.file = "e.csv", .field = "regions 'a' and 'b'"}));
  EXPECT_TRUE(is_error(parse_error("a,-1,-1,0,1,1,0,0.1,1,\nb,-1,1,0.15,1,-1,0.15,0.1,0,\n"),
                       {.file = "e.csv", .field = "regions 'a' and 'b'"}));
  EXPECT_NO_THROW(parse("a,0,0,0,,,,0.1,1,\nb,0.21,0,0,,,,0.1,0,\n"));
  EXPECT_NO_THROW(parse("a,-1,-1,0,1,1,0,0.1,1,\nb,-1,1,0.25,1,-1,0.25,0.1,0,\n"));
  EXPECT_NO_THROW(parse("a,0,0,0,,,,0.1,1,\nb,0.1,0,0,,,,0.1,1,\nc,0,0,0,,,,0.1,,\n"));
}

TEST(ExpectedMap, NoMap) {
  const ExpectedMap expected = parse("a,0,0,0,,,,0.1,1,\n");
  EXPECT_TRUE(is_error(error_of([&] { evaluate_expected_map({}, expected, 0.8); }),
                       {.field = "points of the map"}));
  libmap::PointCloud cloud;
  cloud.positions.emplace_back(0, 0, 0);
  EXPECT_TRUE(
      is_error(error_of([&] { evaluate_expected_map(cloud, expected, 0.8); }), {.field = "score"}));
}

// The regions of scenario 1 are on its shapes and agree with its list of places.
TEST(ExpectedMap, OfPrimitiveShapes) {
  const auto data = graspmap_test::source_folder() / "data";
  const ExpectedMap expected =
      libgtd::parse_expected_map(libmap::read_csv(data / "expected/primitive_shapes.csv"));
  const libmap::Table places = libmap::read_csv(data / "field_test/primitive_shapes.csv");
  for (std::size_t row = 0; row < places.rows.size(); ++row) {
    const std::string& name = places.rows[row][0];
    const Eigen::Vector3d place(places.number(row, 1), places.number(row, 2),
                                places.number(row, 3));
    if (name == "G") continue;
    std::size_t found = 0;
    for (const ExpectedRegion& region : expected.regions) {
      if (!region.graspable || !region.contains(place)) continue;
      ++found;
      EXPECT_EQ(*region.graspable, places.rows[row][4] == "1") << name;
    }
    EXPECT_EQ(found, 1U) << name;
  }
}

TEST(MapSummary, CountsByHand) {
  libmap::PointCloud map;
  const std::vector<double> scores = {0.1, 0.85, 0.95, 0.5, 0.9};
  for (int n = 0; n < 5; ++n) map.positions.emplace_back(0.01 * n + 0.005, 0.005, 0.005);
  map.positions[4].z() = -0.095;
  map.add_field("score", libmap::ScalarType::float32).values = scores;
  map.add_field("graspable", libmap::ScalarType::uint8).values = {0, 1, 0, 0, 1};
  map.add_field("border", libmap::ScalarType::uint8).values = {0, 0, 0, 1, 0};
  map.add_field("ssv", libmap::ScalarType::uint32).values = {10, 200, 119, 120, 5};
  map.add_field("i", libmap::ScalarType::int32).values = {0, 1, 2, 3, 4};
  map.add_field("j", libmap::ScalarType::int32).values = {0, 0, 0, 0, 0};
  map.add_field("k", libmap::ScalarType::int32).values = {0, 0, 0, 0, -10};
  libgtd::MapInfo info;
  info.zero_plane_m = 0.0;
  const auto summary =
      libgtd::summarize_map(map, libgtd::voxel_map_of(map, info),
                            {.graspability_threshold = 0.8, .solid_voxel_threshold = 120.0});
  EXPECT_EQ(summary.voxels, 5U);
  EXPECT_EQ(summary.evaluated, 3U);  // one at the edge, one below the zero plane
  EXPECT_EQ(summary.reaching_cutoff, 2U);
  EXPECT_EQ(summary.graspable, 1U);
  EXPECT_EQ(*summary.below_solid_threshold, 2U);
  ASSERT_EQ(summary.scores.size(), libgtd::summary_quantiles.size());
  EXPECT_NEAR(summary.scores[0], 0.1, 1e-6);
  EXPECT_NEAR(summary.scores[2], 0.85, 1e-6);
  EXPECT_NEAR(summary.scores[4], 0.95, 1e-6);
  EXPECT_EQ(summary.solid_voxels[2], 119.0);

  std::vector<libgtd::SummarizedMap> maps(2);
  maps[0].name = "a";
  maps[0].summary = summary;
  maps[1].name = "b";
  const libmap::Table table = libgtd::summary_table(maps);
  ASSERT_EQ(table.rows.size(), 2U);
  EXPECT_EQ(table.rows[0][table.column("reached_share")], "0.666667");
  EXPECT_EQ(table.rows[1][table.column("reached_share")], "");
  EXPECT_FALSE(table.find_column("voxel_youden"));
  std::size_t counted = 0;
  const libmap::Table bins = libgtd::histogram_table(maps);
  for (std::size_t row = 0; row < bins.rows.size(); ++row)
    counted += static_cast<std::size_t>(bins.number(row, bins.column("voxels")));
  EXPECT_EQ(counted, 3U);
}

}  // namespace expected_map_test
