#include "libmap/poses/trajectory_io.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "tests/support/test_support.h"

namespace trajectory_io_test {

namespace fs = std::filesystem;
using libmap::Pose;
using libmap::Trajectory;

Pose random_pose() {
  const auto draw = [] { return graspmap_test::uniform(-1.0, 1.0); };
  return libmap::make_pose(Eigen::Vector3d(draw(), draw(), draw()),
                           Eigen::Quaterniond(draw(), draw(), draw(), draw()));
}

libmap::TrajectoryFile example() {
  libmap::TrajectoryFile file;
  for (int id : {2, 3, 7}) file.poses.push_back({id, 1700000000.0 + 1.08 * id, random_pose()});
  file.links.push_back({.from = 2, .to = 7, .type = libmap::LinkType::user_closure});
  return file;
}

TEST(TrajectoryIo, ChoosesTheFormatByTheExtension) {
  const libmap::TrajectoryFile written = example();
  for (const char* name : {"poses.tum", "poses.kitti", "poses.g2o", "poses.toro", "POSES.TUM"}) {
    SCOPED_TRACE(name);
    const fs::path path = graspmap_test::scratch_folder() / name;
    libmap::write_trajectory(path, written, true);
    const libmap::TrajectoryFile read = libmap::read_trajectory(path);
    const std::string extension = path.extension().string();
    const bool is_tum = extension == ".tum" || extension == ".TUM";
    ASSERT_EQ(read.poses.size(), 3U);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_TRUE(read.poses[i].world_from_base.isApprox(written.poses[i].world_from_base, 1e-14));
      EXPECT_EQ(read.poses[i].node, extension == ".kitti" ? 0 : written.poses[i].node);
      EXPECT_EQ(read.poses[i].stamp_s, is_tum ? written.poses[i].stamp_s : 0.0);
    }
    EXPECT_EQ(read.links.size(), extension == ".g2o" || extension == ".toro" ? 1U : 0U);
  }
}

TEST(TrajectoryIo, NamesTheFormatsItKnows) {
  EXPECT_FALSE(libmap::is_trajectory_path("poses.txt"));
  const libmap::Error error = graspmap_test::error_of(
      [] { libmap::write_trajectory(graspmap_test::scratch_folder() / "poses.csv", example()); });
  EXPECT_EQ(error.context().value, ".csv");
  EXPECT_EQ(error.context().bound, "one of .tum .kitti .g2o .toro");
  EXPECT_FALSE(fs::exists(graspmap_test::scratch_folder() / "poses.csv"));
  const fs::path path = graspmap_test::scratch_folder() / "poses.txt";
  for (const auto format : {libmap::TrajectoryFormat::automatic, libmap::TrajectoryFormat::colmap})
    EXPECT_TRUE(graspmap_test::is_error(
        graspmap_test::error_of([&] { libmap::write_trajectory_as(format, path, example()); }),
        {.file = path}));
  EXPECT_FALSE(fs::exists(path));
}

TEST(TrajectoryIo, KnowsOtherNamesByTheirContent) {
  const libmap::TrajectoryFile written = example();
  for (const auto& [extension, other] : std::vector<std::pair<std::string, std::string>>{
           {"tum", "a.txt"}, {"kitti", "b.txt"}, {"g2o", "c.graph"}, {"toro", "d"}}) {
    SCOPED_TRACE(extension);
    const fs::path folder = graspmap_test::scratch_folder();
    libmap::write_trajectory(folder / ("poses." + extension), written);
    fs::rename(folder / ("poses." + extension), folder / other);
    EXPECT_EQ(libmap::read_trajectory(folder / other).poses.size(), 3U);
  }
}

TEST(TrajectoryIo, NumbersPosesWithoutNodes) {
  libmap::TrajectoryFile written = example();
  for (libmap::TrajectoryPose& pose : written.poses) pose.node = 0;
  written.links.clear();
  for (const char* name : {"poses.g2o", "poses.toro"}) {
    libmap::write_trajectory(graspmap_test::scratch_folder() / name, written);
    const auto read = libmap::read_trajectory(graspmap_test::scratch_folder() / name);
    ASSERT_EQ(read.poses.size(), 3U);
    // Generated node numbers, marked as such if the format allows comments.
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(read.poses[i].node, std::string(name) == "poses.g2o" ? 0 : static_cast<int>(i) + 1);
      EXPECT_TRUE(read.poses[i].world_from_base.isApprox(written.poses[i].world_from_base, 1e-14));
    }
    const std::string text = graspmap_test::read_text(graspmap_test::scratch_folder() / name);
    EXPECT_NE(text.find(" 3 "), std::string::npos) << text;
  }
}

TEST(TrajectoryIo, NodesStandWhereStampsDoNotTellPosesApart) {
  libmap::TrajectoryFile written = example();
  const fs::path path = graspmap_test::scratch_folder() / "poses.tum";
  libmap::write_trajectory(path, written);
  EXPECT_EQ(libmap::read_trajectory(path).poses[1].node, 0);
  written.poses[1].stamp_s = written.poses[0].stamp_s;
  libmap::write_trajectory(path, written);
  EXPECT_EQ(libmap::read_trajectory(path).poses[1].node, 3);
}

TEST(TrajectoryIo, NamesTheFileThatIsOfNoUse) {
  const fs::path folder = graspmap_test::scratch_folder();
  graspmap_test::write_text(folder / "empty.tum", "# nothing\n\n");
  graspmap_test::write_text(folder / "short.kitti", "1 0 0 0 0 1 0 0 0 0 1\n");
  for (const char* name : {"missing.tum", "empty.tum", "short.kitti"}) {
    const libmap::Error error =
        graspmap_test::error_of([&] { libmap::read_trajectory(folder / name); });
    EXPECT_EQ(error.context().file, (folder / name).string());
  }
}

libmap::PoseGraph graph_of_nodes() {
  libmap::PoseGraph graph;
  for (int id = 1; id <= 4; ++id)
    graph.nodes.push_back({.id = id, .weight = id == 3 ? -9 : 0, .stamp_s = 100.0 + id});
  return graph;
}

std::vector<int> nodes_of(const Trajectory& trajectory) {
  std::vector<int> nodes;
  for (const libmap::TrajectoryPose& pose : trajectory) nodes.push_back(pose.node);
  return nodes;
}

TEST(AssignNodes, TakesTheNodesOfThePoses) {
  const Trajectory poses = {{4, 0, random_pose()}, {2, 0, random_pose()}, {9, 0, random_pose()}};
  const libmap::NodeTrajectory result = libmap::assign_nodes(poses, graph_of_nodes());
  EXPECT_EQ(nodes_of(result.poses), (std::vector<int>{2, 4}));
  EXPECT_EQ(result.poses[0].stamp_s, 102.0);
  EXPECT_TRUE(result.poses[0].world_from_base.isApprox(poses[1].world_from_base));
  EXPECT_EQ(result.unmatched, 1U);
  // Node 3 is invalid.
  const Trajectory more = {{3, 0, random_pose()}, {4, 0, random_pose()}};
  EXPECT_EQ(nodes_of(libmap::assign_nodes(more, graph_of_nodes()).poses), std::vector<int>{4});
}

TEST(AssignNodes, PairsStampsWithinTwentyMilliseconds) {
  const Trajectory poses = {{0, 100.98, random_pose()},
                            {0, 102.03, random_pose()},
                            {0, 103.0, random_pose()},
                            {0, 104.02, random_pose()}};
  const libmap::NodeTrajectory result = libmap::assign_nodes(poses, graph_of_nodes());
  EXPECT_EQ(nodes_of(result.poses), (std::vector<int>{1, 4}));
  EXPECT_EQ(result.poses[1].stamp_s, 104.0);
  EXPECT_EQ(result.unmatched, 2U);
}

TEST(AssignNodes, TakesPosesWithoutNodesAndStampsInTheirOrder) {
  const Trajectory poses = {{0, 0, random_pose()}, {0, 0, random_pose()}, {0, 0, random_pose()}};
  const libmap::NodeTrajectory result = libmap::assign_nodes(poses, graph_of_nodes());
  EXPECT_EQ(nodes_of(result.poses), (std::vector<int>{1, 2, 4}));
  EXPECT_TRUE(result.poses[2].world_from_base.isApprox(poses[2].world_from_base));
  // As many poses as stored poses of the scan, which RTAB-Map exports.
  libmap::PoseGraph graph = graph_of_nodes();
  graph.optimized_map_from_base = {{1, random_pose()}, {4, random_pose()}};
  const Trajectory two(poses.begin(), poses.begin() + 2);
  EXPECT_EQ(nodes_of(libmap::assign_nodes(two, graph).poses), (std::vector<int>{1, 4}));
  EXPECT_EQ(nodes_of(libmap::assign_nodes(poses, graph).poses), (std::vector<int>{1, 2, 4}));
  const libmap::Error error =
      graspmap_test::error_of([&] { libmap::assign_nodes(two, graph_of_nodes()); });
  EXPECT_EQ(error.context().value, "2");
  EXPECT_EQ(error.context().bound, "3");
}

TEST(AssignNodes, RefusesPosesOfNoUse) {
  EXPECT_TRUE(
      graspmap_test::is_error(graspmap_test::error_of([&] {
                                libmap::assign_nodes({{9, 0, random_pose()}}, graph_of_nodes());
                              }),
                              {.field = "poses"}));
  EXPECT_TRUE(
      graspmap_test::is_error(graspmap_test::error_of([&] {
                                libmap::assign_nodes({{0, 7.0, random_pose()}}, graph_of_nodes());
                              }),
                              {.about = "20 ms"}));
  EXPECT_TRUE(graspmap_test::is_error(
      graspmap_test::error_of([&] {
        libmap::assign_nodes({{2, 0, random_pose()}, {2, 1, random_pose()}}, graph_of_nodes());
      }),
      {.field = "node", .value = "2"}));
  EXPECT_TRUE(graspmap_test::is_error(
      graspmap_test::error_of([&] { libmap::assign_nodes({}, graph_of_nodes()); }),
      {.field = "poses"}));
}

}  // namespace trajectory_io_test
