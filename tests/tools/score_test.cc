// The data in the maps that `graspmap score` writes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <set>
#include <tuple>

#include "libmap/core/score_color.h"
#include "libmap/io/cloud_io.h"
#include "tests/tools/tool_test_support.h"

namespace score_test {

using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::ProgramResult;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using libmap::PointCloud;
using Words = std::vector<std::string>;

PointCloud scored(const std::string& output, Words more, const std::string& terrain) {
  Words words = {"score", terrain, "-o", output};
  words.insert(words.end(), more.begin(), more.end());
  const ProgramResult result = graspmap(words);
  EXPECT_TRUE(succeeded(result));
  return result.exit_code == 0 ? libmap::read_cloud(scratch(output)).cloud : PointCloud{};
}

PointCloud scored(const std::string& output, const Words& more) {
  return scored(output, more, graspmap_test::write_terrain());
}

double value(const PointCloud& map, const char* field, std::size_t point) {
  return map.find_field(field)->values[point];
}

TEST(Score, DefaultsOfTheMethodAreInTheManifest) {
  scored("map.pcd", {"--load", "4"});
  const nlohmann::json forces = graspmap_test::json_of("map.pcd.json").at("parameters");
  EXPECT_EQ(forces.at("load_n"), 4.0);
  EXPECT_EQ(forces.at("zero_plane_m"), "auto");
  EXPECT_EQ(forces.at("graspability_threshold"), 0.5);
  scored("map.pcd", {"--method", "corrected"});
  const nlohmann::json shapes = graspmap_test::json_of("map.pcd.json").at("parameters");
  EXPECT_EQ(shapes.at("zero_plane_m"), 0.0);
  EXPECT_EQ(shapes.at("graspability_threshold"), 0.8);
}

TEST(Score, MapKeepsItsPromises) {
  const PointCloud map = scored("map.pcd", {"--zero-plane", "-0.005", "--method", "corrected"});
  ASSERT_GT(map.size(), 4000U);
  ASSERT_TRUE(map.has_colors());
  const nlohmann::json manifest = graspmap_test::json_of("map.pcd.json");
  const nlohmann::json origin = manifest.at("results").at("lattice_origin_m");
  std::size_t graspable = 0;
  std::size_t falling = 0;
  for (std::size_t n = 0; n < map.size(); ++n) {
    const double score = value(map, "score", n);
    const double ssv = value(map, "ssv", n);
    const Eigen::Vector3d voxel(value(map, "i", n), value(map, "j", n), value(map, "k", n));
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(map.positions[n][axis],
                  origin[static_cast<std::size_t>(axis)].get<double>() + 0.01 * (voxel[axis] + 0.5),
                  1e-6);
    EXPECT_GE(score, 0);
    EXPECT_LE(score, 1);
    EXPECT_GE(ssv, 1) << "the pivot itself is solid";
    EXPECT_LE(value(map, "gsv", n), ssv);
    const double quotient = value(map, "gsv", n) / ssv;
    const double matched =
        ssv > 120 || quotient < 0.6 ? quotient : std::max(0.0, quotient - (120 - ssv) / 120);
    const double azimuths = 16.0 * value(map, "falling_share", n);
    EXPECT_EQ(azimuths, std::round(azimuths));
    EXPECT_NEAR(score, matched * azimuths / 16.0, 1e-6);
    falling += score > 0.1 ? 1 : 0;
    const bool above = map.positions[n].z() > -0.005;
    EXPECT_EQ(value(map, "graspable", n) != 0,
              score >= 0.8 && above && value(map, "convex", n) != 0);
    EXPECT_EQ(map.colors[n], above ? libmap::score_color(score) : libmap::below_plane_color);
    graspable += value(map, "graspable", n) != 0 ? 1 : 0;
    if (n > 0) {
      EXPECT_LT(
          std::make_tuple(value(map, "i", n - 1), value(map, "j", n - 1), value(map, "k", n - 1)),
          std::make_tuple(voxel.x(), voxel.y(), voxel.z()));
    }
  }
  EXPECT_GT(falling, 0U);
  EXPECT_EQ(manifest.at("results").at("graspable_voxels"), graspable);
  EXPECT_EQ(manifest.at("results").at("scored_voxels"), map.size());
}

TEST(Score, EveryFormatHoldsTheSameMap) {
  const Words quick = {"--curvature-radius", "0"};
  const PointCloud pcd = scored("map.pcd", quick);
  for (const char* name : {"map.ply", "map.csv"}) {
    const PointCloud other = scored(name, quick);
    ASSERT_EQ(other.size(), pcd.size()) << name;
    EXPECT_EQ(other.colors, pcd.colors) << name;
    ASSERT_EQ(other.fields.size(), pcd.fields.size()) << name;
    for (std::size_t n = 0; n < pcd.size(); ++n)
      EXPECT_LT((other.positions[n] - pcd.positions[n]).norm(), 1e-6);
    for (const libmap::ScalarField& field : pcd.fields) {
      const libmap::ScalarField* found = other.find_field(field.name);
      ASSERT_NE(found, nullptr) << field.name;
      for (std::size_t n = 0; n < pcd.size(); ++n)
        ASSERT_EQ(static_cast<float>(found->values[n]), static_cast<float>(field.values[n]));
    }
  }
}

TEST(Score, FramesOfTheMapAreATransformApart) {
  PointCloud terrain = graspmap_test::bumpy_terrain();
  terrain = libmap::transform_cloud(terrain, libmap::make_pose_from_rpy({4, -7, 2}, {12, -20, 35}));
  libmap::write_cloud(scratch("tilted.pcd"), terrain);
  const Words quick = {"--curvature-radius", "0", "--up", "0,0,1"};
  const PointCloud in_terrain = scored("terrain_map.pcd", quick, "tilted.pcd");
  const auto numbers = graspmap_test::json_of("terrain_map.pcd.json")
                           .at("transforms")
                           .at("terrain_from_input")
                           .get<std::vector<double>>();
  libmap::Pose terrain_from_input = libmap::Pose::Identity();
  for (int cell = 0; cell < 12; ++cell)
    terrain_from_input.matrix()(cell / 4, cell % 4) = numbers[static_cast<std::size_t>(cell)];
  Words input = quick;
  input.insert(input.end(), {"--frame", "input"});
  const PointCloud in_input = scored("input_map.pcd", input, "tilted.pcd");
  ASSERT_EQ(in_input.size(), in_terrain.size());
  EXPECT_EQ(in_input.fields, in_terrain.fields);
  for (std::size_t n = 0; n < in_input.size(); ++n)
    EXPECT_LT((terrain_from_input * in_input.positions[n] - in_terrain.positions[n]).norm(), 1e-5);
  // The map lies on the terrain: its middle is the terrain's.
  const auto middle = [](const PointCloud& cloud) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& point : cloud.positions) sum += point;
    return Eigen::Vector3d(sum / static_cast<double>(cloud.size()));
  };
  EXPECT_LT((middle(in_input) - middle(terrain)).norm(), 0.01);
  EXPECT_LT(middle(in_terrain).norm(), 0.01);
}

TEST(Score, CloudOfTheTerrainFrameIsTakenAsItIs) {
  const PointCloud map = scored("map.pcd", {"--plane", "none", "--curvature-radius", "0"});
  const PointCloud terrain = graspmap_test::bumpy_terrain();
  std::set<std::array<int, 3>> occupied;
  for (const Eigen::Vector3d& point : terrain.positions)
    occupied.insert({static_cast<int>(std::floor(point.x() / 0.01)),
                     static_cast<int>(std::floor(point.y() / 0.01)),
                     static_cast<int>(std::floor(point.z() / 0.01))});
  ASSERT_EQ(map.size(), occupied.size());
  std::size_t n = 0;
  for (const auto& [i, j, k] : occupied) {
    EXPECT_EQ(value(map, "i", n), i);
    EXPECT_EQ(value(map, "j", n), j);
    EXPECT_EQ(value(map, "k", n), k);
    ++n;
  }
}

TEST(Score, OverriddenGripperIsTheGripperOfAFile) {
  const Words quick = {"--curvature-radius", "0"};
  scored("plain.csv", quick);
  Words set = quick;
  set.insert(set.end(), {"--set", "gripper.opening_angle_deg=80"});
  scored("set.csv", set);
  std::string text =
      graspmap_test::read_text(graspmap_test::source_folder() / "data/grippers/scar-e.yaml");
  text.replace(text.find("opening_angle_deg: 85"), 21, "opening_angle_deg: 80");
  graspmap_test::write_text(scratch("gripper.yaml"), text);
  Words file = quick;
  file.insert(file.end(), {"--gripper", "gripper.yaml"});
  scored("file.csv", file);
  EXPECT_EQ(content("set.csv"), content("file.csv"));
  EXPECT_NE(content("set.csv"), content("plain.csv"));
}

TEST(Score, PointsWithoutAPositionAreDroppedAndCounted) {
  PointCloud terrain = graspmap_test::bumpy_terrain();
  libmap::write_cloud(scratch("clean.pcd"), terrain);
  terrain.positions.insert(terrain.positions.begin() + 100, {NAN, NAN, NAN});
  terrain.positions.push_back({0, INFINITY, 0});
  libmap::write_cloud(scratch("holes.pcd"), terrain);
  scored("clean_map.csv", {"--curvature-radius", "0"}, "clean.pcd");
  const ProgramResult result =
      graspmap({"score", "holes.pcd", "--curvature-radius", "0", "-o", "holes_map.csv"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_NE(result.standard_error.find("holes.pcd: 2 points"), std::string::npos);
  EXPECT_EQ(content("holes_map.csv"), content("clean_map.csv"));
}

TEST(Score, TerrainSmallerThanTheMaskGivesAnEmptyMapAndSaysSo) {
  libmap::write_cloud(scratch("small.pcd"), graspmap_test::bumpy_terrain(0.1));
  const ProgramResult result = graspmap(
      {"score", "small.pcd", "--method", "thesis", "--curvature-radius", "0", "-o", "map.pcd"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_NE(result.standard_error.find("gripper mask"), std::string::npos);
  EXPECT_TRUE(libmap::read_cloud(scratch("map.pcd")).cloud.empty());
}

// Domes on a plane, in the frame of a camera that looks at them along z.
TEST(Score, ReliefBelowThePlaneIsSaid) {
  PointCloud terrain;
  for (int i = -40; i <= 40; ++i)
    for (int j = -40; j <= 40; ++j) {
      const double x = 0.01 * i;
      const double y = 0.01 * j;
      const double height = std::max(0.0, 0.1 - 8.0 * (x * x + y * y));
      terrain.positions.emplace_back(x, y, 1.0 - height);
    }
  libmap::write_cloud(scratch("camera.pcd"), terrain);
  const auto said = [](Words more) {
    Words words = {"score", "camera.pcd", "--curvature-radius", "0"};
    words.insert(words.end(), more.begin(), more.end());
    const ProgramResult result = graspmap(words);
    EXPECT_TRUE(succeeded(result));
    return result.standard_error;
  };
  const std::string warning = "camera.pcd: the relief";
  EXPECT_THAT(said({"-o", "a.pcd"}), testing::HasSubstr(warning));
  EXPECT_THAT(said({"-o", "a.tiles"}), testing::HasSubstr(warning));
  EXPECT_THAT(said({"-o", "b.pcd", "--up=0,0,-1"}), testing::Not(testing::HasSubstr("relief")));
  // The right way up nothing is said.
  for (Eigen::Vector3d& position : terrain.positions) position.z() = 1.0 - position.z();
  libmap::write_cloud(scratch("camera.pcd"), terrain);
  EXPECT_THAT(said({"-o", "c.pcd"}), testing::Not(testing::HasSubstr("relief")));
}

}  // namespace score_test
