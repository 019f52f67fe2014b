#include "libmap/scan/scan_source.h"

#include <gtest/gtest.h>

#include <limits>
#include <set>
#include <utility>

#include "tests/libmap/scan/example_scan.h"
#include "tests/support/test_support.h"

namespace joined_scan_test {

using graspmap_test::error_of;
using graspmap_test::example_scan;
using graspmap_test::ExampleScan;
using graspmap_test::scratch_folder;
using libmap::PoseLink;

TEST(JoinedScan, HasAllNodesSessionsLinksAndFrames) {
  const ExampleScan a = example_scan();
  const ExampleScan b = example_scan();
  const auto folder = scratch_folder();
  graspmap_test::write_database(folder / "a.db", a);
  graspmap_test::write_database(folder / "b.db", b);
  const auto joined = libmap::open_scans({folder / "a.db", folder / "b.db"});
  const libmap::PoseGraph& graph = joined->graph();
  const std::size_t count = a.graph.nodes.size();
  ASSERT_EQ(graph.nodes.size(), 2 * count);
  EXPECT_TRUE(graph.optimized_map_from_base.empty());
  std::set<int> sessions_of_a;
  for (std::size_t n = 0; n < count; ++n) {
    EXPECT_EQ(graph.nodes[n].id, a.graph.nodes[n].id);
    EXPECT_EQ(graph.nodes[count + n].id % 10, b.graph.nodes[n].id % 10);
    EXPECT_GT(graph.nodes[count + n].id, graph.nodes[count - 1].id);
    sessions_of_a.insert(graph.nodes[n].session);
  }
  for (std::size_t n = 0; n < count; ++n)
    EXPECT_FALSE(sessions_of_a.contains(graph.nodes[count + n].session));
  const auto stored = libmap::open_scan(folder / "b.db");
  const std::size_t links = stored->graph().links.size();
  ASSERT_EQ(graph.links.size(), 2 * links);
  for (std::size_t n = 0; n < links; ++n) {
    const PoseLink& link = graph.links[links + n];
    const PoseLink& before = stored->graph().links[n];
    EXPECT_EQ(joined->source_of(link.from).node, before.from);
    EXPECT_EQ(link.to < 0, before.to < 0);
    if (link.to > 0) {
      EXPECT_EQ(joined->source_of(link.to).node, before.to);
    }
    EXPECT_EQ(link.from_from_to.matrix(), before.from_from_to.matrix());
  }
  for (const libmap::GraphNode& node : graph.nodes) {
    const libmap::SourceNode source = joined->source_of(node.id);
    EXPECT_EQ(source.path.filename(), node.id < 10 ? "a.db" : "b.db");
    const libmap::RgbdFrame frame = joined->read_frame(node.id);
    EXPECT_EQ(frame.node, node.id);
    EXPECT_EQ(frame.depth, libmap::open_scan(source.path)->read_frame(source.node).depth);
  }
  EXPECT_EQ(error_of([&] { joined->read_frame(2000); }).context().field, "node");
  EXPECT_EQ(error_of([&] { joined->read_frame(-3); }).context().field, "node");
  // A folder of databases is joined in the order of their names.
  const auto by_folder = libmap::open_scan(folder);
  ASSERT_EQ(by_folder->graph().nodes.size(), 2 * count);
  EXPECT_EQ(by_folder->graph().nodes.back().id, graph.nodes.back().id);
}

TEST(JoinedScan, OneIsItselfAndTheSameTwiceIsRefused) {
  const auto folder = scratch_folder();
  graspmap_test::write_database(folder / "a.db", example_scan());
  const auto one = libmap::open_scans({folder / "a.db"});
  EXPECT_EQ(one->graph().optimized_map_from_base.size(),
            libmap::open_scan(folder / "a.db")->graph().optimized_map_from_base.size());
  EXPECT_EQ(one->source_of(5).node, 5);
  EXPECT_TRUE(graspmap_test::is_error(error_of([&] {
                                        libmap::open_scans({folder / "a.db", folder / "a.db"});
                                      }),
                                      {.file = folder / "a.db"}));
  EXPECT_TRUE(
      graspmap_test::is_error(error_of([&] { libmap::open_scans({}); }), {.field = "scans"}));
}

TEST(JoinedScan, NumbersThatAreTooLargeAreNamed) {
  const auto folder = scratch_folder();
  ExampleScan large = example_scan();
  const int renamed =
      std::exchange(large.graph.nodes.back().id, std::numeric_limits<int>::max() - 1);
  large.frames[large.graph.nodes.back().id] = large.frames.at(renamed);
  large.frames[large.graph.nodes.back().id].node = large.graph.nodes.back().id;
  large.graph.links.clear();
  large.graph.optimized_map_from_base.clear();
  graspmap_test::write_database(folder / "a.db", example_scan());
  graspmap_test::write_database(folder / "b.db", large);
  const libmap::Error error = error_of([&] {
    libmap::open_scans({folder / "a.db", folder / "b.db"});
  });
  EXPECT_EQ(error.context().field, "largest node id");
  EXPECT_EQ(error.context().value, std::to_string(std::numeric_limits<int>::max() - 1));
  EXPECT_EQ(error.context().bound, "< 1000000000");
}

}  // namespace joined_scan_test
