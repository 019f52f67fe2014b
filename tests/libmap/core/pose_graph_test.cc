#include "libmap/core/pose_graph.h"

#include <gtest/gtest.h>

namespace pose_graph_test {

using libmap::GraphNode;
using libmap::Pose;
using libmap::PoseGraph;
using libmap::PoseSource;

Pose at(double x, double y) {
  Pose pose = Pose::Identity();
  pose.translation() << x, y, 0.0;
  return pose;
}

PoseGraph small_graph() {
  PoseGraph graph;
  graph.nodes = {
      {.id = 2, .stamp_s = 1.0, .odometry_from_base = at(0, 0), .truth_from_base = at(5, 5)},
      {.id = 3, .stamp_s = 2.0, .odometry_from_base = at(3, 4)},
      {.id = 5, .weight = -9, .stamp_s = 3.0, .odometry_from_base = at(100, 0)},
      {.id = 7, .weight = -1, .stamp_s = 4.0, .odometry_from_base = at(3, 6)},
      {.id = 9, .stamp_s = 5.0}};
  graph.optimized_map_from_base = {{3, at(1, 1)}, {9, at(2, 2)}, {40, at(9, 9)}};
  return graph;
}

TEST(PoseGraphTest, NodesById) {
  const PoseGraph graph = small_graph();
  ASSERT_NE(graph.find_node(7), nullptr);
  EXPECT_EQ(graph.find_node(7)->stamp_s, 4.0);
  EXPECT_EQ(graph.find_node(4), nullptr);
  EXPECT_EQ(graph.find_node(99), nullptr);
  EXPECT_EQ(PoseGraph().find_node(1), nullptr);
}

TEST(PoseGraphTest, TrajectoriesLeaveOutWhatHasNoPoseAndInvalidNodes) {
  const PoseGraph graph = small_graph();
  const auto nodes_of = [&](PoseSource source) {
    std::vector<int> nodes;
    for (const auto& pose : trajectory_of(graph, source)) nodes.push_back(pose.node);
    return nodes;
  };
  EXPECT_EQ(nodes_of(PoseSource::odometry), (std::vector<int>{2, 3, 7}));
  EXPECT_EQ(nodes_of(PoseSource::optimized), (std::vector<int>{3, 9}));
  EXPECT_EQ(nodes_of(PoseSource::ground_truth), (std::vector<int>{2}));
  EXPECT_EQ(trajectory_of(graph, PoseSource::optimized)[1].stamp_s, 5.0);
  EXPECT_DOUBLE_EQ(libmap::path_length(trajectory_of(graph, PoseSource::odometry)), 5.0 + 2.0);
  EXPECT_EQ(libmap::path_length({}), 0.0);
}

TEST(PoseGraphTest, NamesOfLinksAndPoses) {
  EXPECT_EQ(to_text(libmap::LinkType::neighbor), "neighbor");
  EXPECT_EQ(to_text(libmap::LinkType::gravity), "gravity");
  EXPECT_EQ(to_text(static_cast<libmap::LinkType>(42)), "type 42");
  EXPECT_EQ(to_text(PoseSource::ground_truth), "ground-truth");
}

}  // namespace pose_graph_test
