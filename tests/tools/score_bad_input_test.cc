// Invalid inputs of `graspmap score`: exit code 3, one line that names the input, no output.
#include <gtest/gtest.h>

#include <cmath>

#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "tests/tools/tool_test_support.h"

namespace score_bad_input_test {

using graspmap_test::bad_input;
using graspmap_test::graspmap;
using graspmap_test::ProgramResult;
using graspmap_test::read_text;
using graspmap_test::scratch;
using graspmap_test::write_text;
using Words = std::vector<std::string>;

class ScoreBadInput : public testing::Test {
 protected:
  // Runs `graspmap score WORDS... -o out.pcd`; nothing new may be left beside the inputs.
  ProgramResult score(Words words) {
    words.insert(words.begin(), "score");
    words.insert(words.end(), {"-o", "out.pcd"});
    const Words before = graspmap_test::names_in_scratch();
    const ProgramResult result = graspmap(words);
    EXPECT_EQ(graspmap_test::names_in_scratch(), before) << "something was left";
    return result;
  }

  std::string gripper_with(const std::string& from, const std::string& to) {
    std::string text =
        read_text(graspmap_test::source_folder() / "data" / "grippers" / "scar-e.yaml");
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
    write_text(scratch("gripper.yaml"), text);
    return "gripper.yaml";
  }

  static std::string cloud_of(const std::vector<Eigen::Vector3d>& positions) {
    libmap::PointCloud cloud;
    cloud.positions = positions;
    libmap::write_cloud(scratch("cloud.pcd"), cloud);
    return "cloud.pcd";
  }
};

TEST_F(ScoreBadInput, NoSuchFile) {
  EXPECT_TRUE(bad_input(score({"none.pcd"}), {.file = "none.pcd"}));
}

TEST_F(ScoreBadInput, EmptyFileAndFolder) {
  write_text(scratch("empty.pcd"), "");
  EXPECT_TRUE(bad_input(score({"empty.pcd"}), {.file = "empty.pcd"}));
  std::filesystem::create_directory(scratch("folder.pcd"));
  EXPECT_TRUE(bad_input(score({"folder.pcd"}), {.file = "folder.pcd"}));
}

TEST_F(ScoreBadInput, EmptyCloud) {
  EXPECT_TRUE(bad_input(score({cloud_of({})}), {.file = "cloud.pcd"}));
  write_text(scratch("empty.csv"), "x,y,z\n");
  EXPECT_TRUE(bad_input(score({"empty.csv"}), {.file = "empty.csv"}));
}

TEST_F(ScoreBadInput, OnePointTwoPointsOnePlace) {
  for (const char* method : {"thesis", "corrected"}) {
    EXPECT_TRUE(bad_input(score({cloud_of({{1, 2, 3}}), "--method", method}),
                          {.file = "cloud.pcd", .field = "points", .value = "1", .bound = ">= 3"}));
    EXPECT_TRUE(bad_input(score({cloud_of({{1, 2, 3}, {2, 2, 3}}), "--method", method}),
                          {.file = "cloud.pcd", .field = "points", .value = "2", .bound = ">= 3"}));
    const auto in_one_place =
        score({cloud_of(std::vector<Eigen::Vector3d>(50, {1, 2, 3})), "--method", method});
    EXPECT_TRUE(bad_input(in_one_place, {.file = "cloud.pcd"}));
    if (std::string(method) == "thesis")
      EXPECT_TRUE(bad_input(in_one_place, {.field = "points", .value = "1", .bound = ">= 3"}));
    else
      EXPECT_TRUE(bad_input(in_one_place, {.field = "points"}));
  }
}

TEST_F(ScoreBadInput, AllPointsOnALine) {
  std::vector<Eigen::Vector3d> line;
  for (int n = 0; n < 500; ++n) line.emplace_back(n * 0.01, n * 0.02, n * -0.005);
  for (const char* method : {"thesis", "envelope", "climblab", "corrected"})
    EXPECT_TRUE(bad_input(score({cloud_of(line), "--method", method}), {.file = "cloud.pcd"}));
}

TEST_F(ScoreBadInput, AllNaN) {
  const double nan = std::nan("");
  cloud_of(std::vector<Eigen::Vector3d>(7, {nan, nan, nan}));
  EXPECT_TRUE(bad_input(score({"cloud.pcd"}),
                        {.file = "cloud.pcd", .field = "points of the cloud", .about = "7"}));
}

TEST_F(ScoreBadInput, HeaderPromisesMoreThanFollows) {
  graspmap_test::write_terrain();
  const std::string whole = read_text(scratch("terrain.pcd"));
  write_text(scratch("cut.pcd"), whole.substr(0, whole.size() / 2));
  EXPECT_TRUE(bad_input(score({"cut.pcd"}), {.file = "cut.pcd", .about = "14400"}));
  write_text(scratch("ascii.pcd"),
             "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 100\n"
             "HEIGHT 1\nPOINTS 100\nDATA ascii\n1 2 3\n4 5 6\n");
  EXPECT_TRUE(bad_input(score({"ascii.pcd"}), {.file = "ascii.pcd", .about = "100"}));
}

TEST_F(ScoreBadInput, CloudWithoutZ) {
  write_text(scratch("flat.csv"), "x,y\n1,2\n");
  EXPECT_TRUE(bad_input(score({"flat.csv"}), {.file = "flat.csv"}));
}

TEST_F(ScoreBadInput, Grippers) {
  graspmap_test::write_terrain();
  const auto with_gripper = [&](const std::string& from, const std::string& to) {
    return score({"terrain.pcd", "--gripper", "./" + gripper_with(from, to)});
  };
  EXPECT_TRUE(bad_input(
      with_gripper("finger_length_mm: 40", "finger_length_mm: -40"),
      {.file = "./gripper.yaml", .field = "finger_length_mm", .value = "-40", .bound = "> 0"}));
  EXPECT_TRUE(bad_input(with_gripper("closing_angle_deg: 10", "closing_angle_deg: 86"),
                        {.file = "./gripper.yaml", .field = "closing_angle_deg", .value = "86"}));
  EXPECT_TRUE(bad_input(
      with_gripper("finger_length_mm: 40", "finger_lenght_mm: 40"),
      {.file = "./gripper.yaml", .field = "finger_lenght_mm", .about = "'finger_length_mm'"}));
  EXPECT_TRUE(bad_input(with_gripper("finger_length_mm: 40", "# finger_length_mm: 40"),
                        {.file = "./gripper.yaml", .field = "finger_length_mm"}));
  EXPECT_TRUE(bad_input(with_gripper("opening_angle_deg: 85", "opening_angle_deg: 95"),
                        {.file = "./gripper.yaml",
                         .field = "opening_angle_deg",
                         .value = "95",
                         .bound = "> 0 and <= 90"}));
  EXPECT_TRUE(bad_input(with_gripper("name: SCAR-E", "name: SCAR-E\nname: other"),
                        {.file = "./gripper.yaml", .field = "name"}));
  EXPECT_TRUE(bad_input(score({"terrain.pcd", "--gripper", "scare"}),
                        {.field = "gripper", .value = "scare", .about = "'scar-e'"}));
  EXPECT_TRUE(bad_input(score({"terrain.pcd", "--gripper", "none.yaml"}), {.file = "none.yaml"}));
}

TEST_F(ScoreBadInput, GripperKeysWithSpacesBeforeTheColonAreThere) {
  graspmap_test::write_terrain();
  gripper_with("finger_length_mm: 40", "\"finger_length_mm\" : 40");
  EXPECT_TRUE(succeeded(graspmap({"score", "terrain.pcd", "--gripper", "gripper.yaml",
                                  "--curvature-radius", "0", "-o", "out.pcd"})));
}

TEST_F(ScoreBadInput, MisspeltGripperKeyOnTheCommandLine) {
  graspmap_test::write_terrain();
  EXPECT_TRUE(bad_input(score({"terrain.pcd", "--set", "gripper.opening_angel_deg=80"}),
                        {.field = "opening_angel_deg", .about = "'opening_angle_deg'"}));
  EXPECT_TRUE(bad_input(score({"terrain.pcd", "--set", "griper.opening_angle_deg=80"}),
                        {.field = "griper.opening_angle_deg"}));
  EXPECT_TRUE(bad_input(score({"terrain.pcd", "--set", "gripper.opening_angle_deg=wide"}),
                        {.field = "opening_angle_deg", .value = "wide", .bound = "> 0 and <= 90"}));
  EXPECT_TRUE(
      bad_input(score({"terrain.pcd", "--set", "method"}), {.field = "--set", .value = "method"}));
}

TEST_F(ScoreBadInput, VoxelSizes) {
  graspmap_test::write_terrain();
  const auto with_size = [&](const char* method, const char* size) {
    return score({"terrain.pcd", "--method", method, "--voxel-size", size});
  };
  for (const char* method : {"thesis", "envelope", "climblab", "corrected"}) {
    EXPECT_TRUE(
        bad_input(with_size(method, "0"), {.field = "--voxel-size", .value = "0", .bound = "> 0"}));
    EXPECT_TRUE(bad_input(with_size(method, "-0.01"),
                          {.field = "--voxel-size", .value = "-0.01", .bound = "> 0"}));
    EXPECT_TRUE(bad_input(with_size(method, "nan"),
                          {.field = "--voxel-size", .value = "nan", .bound = "> 0"}));
    EXPECT_TRUE(bad_input(with_size(method, "10"), {.field = "voxel_size_m", .value = "10"}));
    // A mask of 0.27 x 0.27 x 0.09 m holds some 6e15 voxels of that size.
    EXPECT_TRUE(bad_input(with_size(method, "1e-6"), {.field = "voxel_size_m", .value = "1e-06"}));
    EXPECT_TRUE(
        bad_input(with_size(method, "1e-300"), {.field = "voxel_size_m", .value = "1e-300"}));
  }
}

TEST_F(ScoreBadInput, GripperWithoutFingers) {
  graspmap_test::write_terrain();
  const std::string gripper = gripper_with("fingers:", "ignored:");
  std::string text = read_text(scratch(gripper));
  text.erase(text.find("ignored:"));
  write_text(scratch(gripper), text);
  EXPECT_TRUE(bad_input(score({"terrain.pcd", "--gripper", gripper}),
                        {.file = gripper, .field = "fingers"}));
}

TEST_F(ScoreBadInput, CloudTooWideForTheVoxelSize) {
  // Three patches 1e8 m apart.
  std::vector<Eigen::Vector3d> positions;
  for (const Eigen::Vector3d& patch :
       {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(1e8, 0, 0), Eigen::Vector3d(0, 1e8, 0)})
    for (int n = 0; n < 9; ++n)
      positions.push_back(patch + Eigen::Vector3d(n % 3, n / 3, 0.1 * (n % 2)));
  for (const char* method : {"thesis", "corrected"}) {
    cloud_of(positions);
    EXPECT_TRUE(bad_input(
        score({"cloud.pcd", "--plane", "none", "--voxel-size", "0.01", "--method", method}),
        {.file = "cloud.pcd", .field = "voxel_size_m", .value = "0.01"}));
  }
}

TEST_F(ScoreBadInput, Scenarios) {
  graspmap_test::write_terrain();
  const auto with_scenario = [&](const std::string& yaml) {
    write_text(scratch("scenario.yaml"), yaml);
    return score({"terrain.pcd", "--config", "scenario.yaml"});
  };
  EXPECT_TRUE(
      bad_input(with_scenario("voxel_sise_m: 0.01\n"),
                {.file = "scenario.yaml", .field = "voxel_sise_m", .about = "'voxel_size_m'"}));
  EXPECT_TRUE(
      bad_input(with_scenario("voxel_size_m: 0\n"),
                {.file = "scenario.yaml", .field = "voxel_size_m", .value = "0", .bound = "> 0"}));
  EXPECT_TRUE(bad_input(
      with_scenario("method: thesiss\n"),
      {.file = "scenario.yaml", .field = "method", .value = "thesiss", .about = "'thesis'"}));
  EXPECT_TRUE(
      bad_input(with_scenario("method: [thesis]\n"), {.file = "scenario.yaml", .field = "method"}));
  EXPECT_TRUE(bad_input(with_scenario("method: thesis\nmethod: corrected\n"),
                        {.file = "scenario.yaml", .field = "method"}));
  EXPECT_TRUE(bad_input(with_scenario("a: b: c\n"), {.file = "scenario.yaml", .field = "line 1"}));
  EXPECT_TRUE(bad_input(score({"terrain.pcd", "--config", "none.yaml"}), {.file = "none.yaml"}));
  EXPECT_TRUE(bad_input(score({"terrain.pcd", "--config", "artificial_rocks_prescam"}),
                        {.field = "scenario",
                         .value = "artificial_rocks_prescam",
                         .about = "'artificial_rocks_prescan'"}));
}

TEST_F(ScoreBadInput, FlagsOutOfTheirBounds) {
  graspmap_test::write_terrain();
  for (const char* share : {"3/2", "0/2", "-1/2", "1", "1/", "/2", "a/b", "1/2/3", "1/0", ""})
    EXPECT_TRUE(bad_input(score({"terrain.pcd", "--tile", share}), {.field = "--tile"})) << share;
  EXPECT_TRUE(bad_input(score({"terrain.pcd", "--tile", "1/2"}), {.field = "--tile"}));
  EXPECT_TRUE(bad_input(score({"terrain.pcd", "--up", "0,0"}),
                        {.field = "--up", .value = "0,0", .bound = "X,Y,Z"}));
  EXPECT_TRUE(
      bad_input(score({"terrain.pcd", "--up", "0,0,0"}), {.file = "terrain.pcd", .field = "up"}));
  EXPECT_TRUE(bad_input(score({"terrain.pcd", "--up", "0,0,1", "--plane", "none"}),
                        {.field = "--up", .value = "0,0,1", .about = "--plane"}));
  EXPECT_TRUE(bad_input(score({"terrain.pcd", "--max-points-in-memory", "5"}),
                        {.field = "--max-points-in-memory"}));
  EXPECT_TRUE(bad_input(score({"terrain.pcd", "--threads", "-1"}),
                        {.field = "--threads", .value = "-1", .bound = ">= 0 and <= 4096"}));
  EXPECT_TRUE(
      bad_input(score({"terrain.pcd", "--progress", "fancy"}),
                {.field = "--progress", .value = "fancy", .bound = "one of auto, json, none"}));
  EXPECT_TRUE(
      bad_input(score({"terrain.pcd", "--graspability-threshold", "1.5"}),
                {.field = "--graspability-threshold", .value = "1.5", .bound = ">= 0 and <= 1"}));
  EXPECT_TRUE(bad_input(
      score({"terrain.pcd", "--solid-voxel-threshold", "0"}),
      {.field = "--solid-voxel-threshold", .value = "0", .bound = ">= 1 and <= 2147483647"}));
  EXPECT_TRUE(bad_input(score({"terrain.pcd", "--tile-size", "1e-9"}),
                        {.file = "terrain.pcd", .field = "tile_size_m", .value = "1e-09"}));
}

TEST_F(ScoreBadInput, AMeshIsNoCloud) {
  libmap::TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.triangles = {{0, 1, 2}};
  for (const std::string name : {"mesh.ply", "mesh.obj"}) {
    libmap::write_mesh(scratch(name), mesh);
    EXPECT_TRUE(bad_input(score({name}), {.file = name}));
  }
}

// Ground of 3 x 3 m, a point each 2.5 voxels: nothing but lone voxels.
TEST_F(ScoreBadInput, PointsTooFarApartForTheVoxels) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 120; ++i)
    for (int j = 0; j < 120; ++j) points.emplace_back(0.025 * i, 0.025 * j, 0.0);
  const std::string cloud = cloud_of(points);
  const graspmap_test::ExpectedError named = {
      .file = cloud,
      .field = "share of voxels without a neighbor",
      .value = "100.0 % (voxels of 0.01 m, median point spacing 25.0 mm)",
      .bound = "<= 60 %"};
  EXPECT_TRUE(bad_input(score({cloud, "--voxel-size", "0.01"}), named));
  EXPECT_TRUE(bad_input(
      graspmap({"score", cloud, "--voxel-size", "0.01", "--quiet", "-o", "map.tiles"}), named));
  EXPECT_TRUE(graspmap_test::succeeded(
      graspmap({"score", cloud, "--voxel-size", "0.01", "--interpolation", "-o", "out.pcd"})));
}

TEST_F(ScoreBadInput, OutputsThatCannotBe) {
  graspmap_test::write_terrain();
  const auto to = [](const std::string& output) {
    const Words before = graspmap_test::names_in_scratch();
    const ProgramResult result = graspmap({"score", "terrain.pcd", "-o", output});
    EXPECT_EQ(graspmap_test::names_in_scratch(), before);
    return result;
  };
  EXPECT_TRUE(bad_input(to("none/out.pcd"), {.file = "none/out.pcd"}));
  EXPECT_TRUE(bad_input(to("out.xyz"), {.file = "out.xyz",
                                        .field = "extension",
                                        .value = ".xyz",
                                        .bound = ".pcd, .ply, .csv or .vtp"}));
  EXPECT_TRUE(bad_input(to("out"), {.file = "out",
                                    .field = "extension",
                                    .value = "missing",
                                    .bound = ".pcd, .ply, .csv or .vtp"}));
  std::filesystem::create_directory(scratch("folder.pcd"));
  EXPECT_TRUE(bad_input(to("folder.pcd"), {.file = "folder.pcd"}));
}

}  // namespace score_bad_input_test
