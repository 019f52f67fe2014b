// Initial poses against their definition: repeated passes over the links in order.
#include "libmap/refine/initial_poses.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <random>
#include <set>

#include "libmap/geometry/rigid_motion.h"
#include "tests/support/test_support.h"

namespace initial_poses_test {

using libmap::Pose;
using libmap::PoseGraph;
using libmap::PoseLink;
using Poses = std::map<int, Pose>;
using Parts = std::vector<std::vector<int>>;

double between(double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(graspmap_test::random_engine());
}
int number_to(int last) {
  return std::uniform_int_distribution<int>(1, last)(graspmap_test::random_engine());
}

Pose random_pose() {
  const Eigen::Vector3d axis(between(-1, 1), between(-1, 1), between(1, 2));
  return libmap::make_pose(
      {between(-9, 9), between(-9, 9), between(-9, 9)},
      Eigen::Quaterniond(Eigen::AngleAxisd(between(-3, 3), axis.normalized())));
}

PoseGraph random_graph(int nodes, int links, int sessions, double share_with_odometry) {
  PoseGraph graph;
  for (int id = 1; id <= nodes; ++id) {
    libmap::GraphNode node{.id = id, .session = number_to(sessions)};
    if (between(0, 1) < share_with_odometry) node.odometry_from_base = random_pose();
    graph.nodes.push_back(std::move(node));
  }
  for (int n = 0; n < links; ++n)
    graph.links.push_back({number_to(nodes), number_to(nodes), libmap::LinkType::neighbor,
                           random_pose(), libmap::Matrix6d::Identity()});
  return graph;
}

void place(const PoseGraph& graph, Poses& poses) {
  for (bool any = true; any;) {
    any = false;
    for (const PoseLink& link : graph.links) {
      if (poses.contains(link.from) == poses.contains(link.to)) continue;
      if (poses.contains(link.from))
        poses.emplace(link.to, poses.at(link.from) * link.from_from_to);
      else
        poses.emplace(link.from, poses.at(link.to) * link.from_from_to.inverse());
      any = true;
    }
  }
}

// The motion that most links between two parts agree with.
Pose best_move(const std::vector<std::pair<Pose, Pose>>& moves_and_probes) {
  std::pair<int, Pose> best(-1, Pose::Identity());
  for (const auto& [move, probe] : moves_and_probes) {
    int votes = 0;
    for (const auto& [other, unused] : moves_and_probes) {
      const libmap::Vector6d apart = libmap::step_between(move * probe, other * probe);
      votes += apart.head<3>().norm() < 0.1 && apart.tail<3>().norm() < 0.1 ? 1 : 0;
    }
    if (votes > best.first) best = {votes, move};
  }
  return best.second;
}

// Moves the first part that is linked to `whole`, and adds it. Returns true if there was one.
bool join_one(std::vector<int>& whole, Parts& open, Poses& poses,
              const std::vector<PoseLink>& links) {
  const std::set<int> inside(whole.begin(), whole.end());
  for (auto part = open.begin(); part != open.end(); ++part) {
    std::vector<std::pair<Pose, Pose>> moves;
    for (const PoseLink& link : links)
      for (const bool forth : {true, false}) {
        const int in = forth ? link.from : link.to;
        const int out = forth ? link.to : link.from;
        if (!inside.contains(in) || std::find(part->begin(), part->end(), out) == part->end())
          continue;
        const Pose in_from_out = forth ? link.from_from_to : Pose(link.from_from_to.inverse());
        moves.emplace_back(poses.at(in) * in_from_out * poses.at(out).inverse(), poses.at(out));
      }
    if (moves.empty()) continue;
    const Pose move = best_move(moves);
    for (const int node : *part) poses.at(node) = move * poses.at(node);
    whole.insert(whole.end(), part->begin(), part->end());
    open.erase(part);
    return true;
  }
  return false;
}

Parts joined(Parts open, Poses& poses, const std::vector<PoseLink>& links) {
  std::stable_sort(open.begin(), open.end(),
                   [](const auto& a, const auto& b) { return a.size() > b.size(); });
  Parts result;
  while (!open.empty()) {
    std::vector<int> whole = open.front();
    open.erase(open.begin());
    while (join_one(whole, open, poses, links)) continue;
    result.push_back(whole);
  }
  return result;
}

// A node without a part joins the part of the first link's other end.
void spread_parts(const PoseGraph& graph, const Poses& poses, Parts& parts) {
  for (bool any = true; any;) {
    any = false;
    for (const PoseLink& link : graph.links) {
      const auto part_of = [&](int node) {
        return std::find_if(parts.begin(), parts.end(), [&](const auto& part) {
          return std::find(part.begin(), part.end(), node) != part.end();
        });
      };
      const auto of_from = part_of(link.from);
      const auto of_to = part_of(link.to);
      if ((of_from == parts.end()) == (of_to == parts.end())) continue;
      const int node = of_from == parts.end() ? link.from : link.to;
      if (!poses.contains(node)) continue;
      (of_from == parts.end() ? of_to : of_from)->push_back(node);
      any = true;
    }
  }
  for (std::vector<int>& part : parts) std::sort(part.begin(), part.end());
}

void expect_same(const Poses& poses, const Poses& expected) {
  ASSERT_EQ(poses.size(), expected.size());
  for (const auto& [node, pose] : expected) {
    ASSERT_TRUE(poses.contains(node)) << node;
    EXPECT_EQ(poses.at(node).matrix(), pose.matrix()) << node;
  }
}

TEST(InitialPoses, AreThoseOfTheDefinition) {
  std::set<std::size_t> seen;  // numbers of parts
  for (int round = 0; round < 300; ++round) {
    const PoseGraph graph =
        random_graph(number_to(30), number_to(60), number_to(6), between(0.05, 1.0));
    Poses expected;
    std::map<int, std::vector<int>> sessions;
    for (const libmap::GraphNode& node : graph.nodes)
      if (node.odometry_from_base) {
        expected.emplace(node.id, *node.odometry_from_base);
        sessions[node.session].push_back(node.id);
      }
    if (expected.empty()) continue;
    Parts parts;
    for (const auto& [session, nodes] : sessions) parts.push_back(nodes);
    parts = joined(parts, expected, graph.links);
    place(graph, expected);
    spread_parts(graph, expected, parts);
    const auto found = libmap::initial_poses(graph, libmap::StartPoses::odometry);
    SCOPED_TRACE(round);
    expect_same(found.map_from_base, expected);
    EXPECT_EQ(found.parts, parts);
    seen.insert(parts.size());
  }
  EXPECT_GT(seen.size(), 2U);
}

// Sizes at which visiting all links for each node, or all pairs of links, would take minutes.
TEST(InitialPoses, OfManyNodesLinksAndParts) {
  PoseGraph chain;
  for (int id = 1; id <= 5'000; ++id) chain.nodes.push_back({.id = id});
  chain.nodes.back().odometry_from_base = Pose::Identity();
  for (int id = 1; id < 5'000; ++id)
    chain.links.push_back(
        {id, id + 1, libmap::LinkType::neighbor, Pose::Identity(), libmap::Matrix6d::Identity()});
  EXPECT_TRUE(libmap::initial_poses(chain, libmap::StartPoses::odometry).without_pose.empty());
  PoseGraph bridges = random_graph(4, 0, 1, 1.0);
  bridges.nodes[2].session = bridges.nodes[3].session = 2;
  for (int n = 0; n < 20'000; ++n) bridges.links.push_back({1, 3, {}, Pose::Identity()});
  EXPECT_EQ(libmap::initial_poses(bridges, libmap::StartPoses::odometry).parts.size(), 1U);
  PoseGraph islands = random_graph(1'000, 0, 1, 1.0);
  for (libmap::GraphNode& node : islands.nodes) node.session = node.id;
  for (int n = 0; n < 1'000; ++n) islands.links.push_back({1, 2, {}, Pose::Identity()});
  EXPECT_EQ(libmap::initial_poses(islands, libmap::StartPoses::odometry).parts.size(), 999U);
}

}  // namespace initial_poses_test
