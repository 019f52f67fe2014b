// The author's program, through the command line: the same score of every voxel.
#include <gtest/gtest.h>

#include "libmap/core/table.h"
#include "libmap/io/cloud_io.h"
#include "tests/support/reference_data.h"
#include "tests/tools/tool_test_support.h"

namespace score_reference_test {

using graspmap_test::scratch;
using graspmap_test::succeeded;

struct Case {
  const char* set;
  const char* method;
  const char* opening_angle;
};

void PrintTo(const Case& given, std::ostream* out) { *out << given.set << "." << given.method; }

class ScoreReference : public testing::TestWithParam<Case> {};

TEST_P(ScoreReference, SameScoreOfEveryVoxel) {
  GRASPMAP_REQUIRE_REFERENCE();
  const Case& given = GetParam();
  const std::string stem =
      (graspmap_test::reference_folder() / "gtd" / given.set).string() + "." + given.method;
  libmap::PointCloud cloud;
  for (const Eigen::Vector3f& point :
       graspmap_test::read_points_f32_gz(stem + ".transformed.f32.gz"))
    cloud.positions.push_back(point.cast<double>());
  libmap::write_cloud(scratch("terrain.pcd"), cloud);
  const std::string angle = std::string("gripper.opening_angle_deg=") + given.opening_angle;
  ASSERT_TRUE(succeeded(graspmap_test::graspmap({"score",
                                                 "terrain.pcd",
                                                 "--plane",
                                                 "none",
                                                 "--method",
                                                 given.method,
                                                 "--gripper",
                                                 "scar-e",
                                                 "--set",
                                                 angle,
                                                 "--voxel-size",
                                                 "0.01",
                                                 "--extra-void-layers",
                                                 "1",
                                                 "--solid-voxel-threshold",
                                                 "120",
                                                 "--curvature-radius",
                                                 "0",
                                                 "-o",
                                                 "m.csv"})));
  const libmap::Table map = libmap::read_csv(scratch("m.csv"));
  const auto reference = graspmap_test::read_scores_gz(stem + ".scores.csv.gz");
  ASSERT_EQ(map.rows.size(), reference.rows.size());
  const char* const names[] = {"i", "j", "k", "ssv", "gsv"};
  const std::size_t score = map.column("score");
  std::size_t differences = 0;
  for (std::size_t row = 0; row < map.rows.size(); ++row) {
    for (std::size_t c = 0; c < 5; ++c)
      differences += map.number(row, map.column(names[c])) != reference.rows[row][c] ? 1 : 0;
    // The map holds the score as float32, the reference nine digits of the percentage.
    const auto wanted = static_cast<float>(reference.score_percent[row] / 100.0);
    const auto got = static_cast<float>(map.number(row, score));
    differences += std::abs(got - wanted) > 1e-7F * std::max(1.0F, std::abs(wanted)) ? 1 : 0;
  }
  EXPECT_EQ(differences, 0U);
}

INSTANTIATE_TEST_SUITE_P(All, ScoreReference,
                         testing::Values(Case{"artificial_rocks", "thesis", "85"},
                                         Case{"artificial_rocks", "envelope", "80"},
                                         Case{"leaning_holds_scare", "thesis", "85"}),
                         [](const auto& one) {
                           return std::string(one.param.set) + "_" + one.param.method;
                         });

}  // namespace score_reference_test
