// A cloud made in tiles equals the cloud made at once.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>
#include <vector>

#include "libmap/fusion/depth_fusion.h"
#include "tests/libmap/fusion/depth_scenes.h"
#include "tests/libmap/fusion/fusion_checks.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace depth_fusion_tiles_test {

using graspmap_test::error_of;
using graspmap_test::kinect;
using graspmap_test::MemoryScan;
using graspmap_test::ring_scan;
using graspmap_test::small_camera;
using graspmap_test::step_scene;

// All values of each point, in an order that does not depend on the tiles.
using Row = std::vector<double>;
std::vector<Row> rows_of(const PointCloud& cloud) {
  std::vector<Row> rows;
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    Row row(cloud.positions[n].begin(), cloud.positions[n].end());
    for (const float x : cloud.normals[n]) row.push_back(x);
    for (const std::uint8_t x : cloud.colors[n]) row.push_back(x);
    for (const ScalarField& field : cloud.fields) row.push_back(field.values[n]);
    rows.push_back(row);
  }
  std::sort(rows.begin(), rows.end());
  return rows;
}

// Frames whose depth has noise, colors differ and poses are off by up to a centimeter.
MemoryScan noisy_scan(const Eigen::Vector3d& target) {
  const auto scene = [=](const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
    return step_scene(origin - target, direction);
  };
  MemoryScan scan = ring_scan(scene, 10, kinect, target);
  std::uint8_t level = 0;
  for (auto& [node, frame] : scan.frames) {
    level = static_cast<std::uint8_t>(level + 23);
    frame.color = ColorImage(128, 96, Color{level, 100, static_cast<std::uint8_t>(255 - level)});
  }
  for (TrajectoryPose& pose : scan.poses)
    pose.world_from_base.translation() += 0.01 * Eigen::Vector3d(std::sin(pose.node), 0.3, 0.5);
  return scan;
}

TEST(DepthFusionTiles, SamePointsAsAtOnceBitForBit) {
  // Far from the origin too, where tiles have large and negative numbers.
  for (const Eigen::Vector3d& target :
       {Eigen::Vector3d(0.03, 0.01, 0), Eigen::Vector3d(-731, 94, 5)})
    for (const double tile_m : {0.5, 0.13}) {
      const MemoryScan scan = noisy_scan(target);
      const DepthFusionResult whole = fuse_depth(scan, scan.poses);
      EXPECT_GT(whole.registration_rounds, 0);
      PointCloud joined;
      joined.fields = {{"views", ScalarType::uint16, {}},
                       {"expected_error", ScalarType::float32, {}}};
      std::size_t tiles = 0;
      TileFusion fusion(scan, scan.poses, {}, tile_m);
      // Continues with the plan of the first object, as another process does.
      TileFusion again(scan, scan.poses, {}, tile_m, no_progress(), &fusion.plan());
      DepthFusionResult parts = again.report();
      EXPECT_EQ(parts.poses.size(), 10U);
      for (std::size_t n = 0; n < again.tiles().size(); ++n) {
        const XyTile& tile = again.tiles()[n];
        const auto [cloud, of_tile] = (n % 2 == 0 ? again : fusion).make(n);
        libmap::merge_into<libmap::FusionCounts>(parts, of_tile);
        cloud.check();
        tiles += cloud.empty() ? 0 : 1;
        for (const Eigen::Vector3d& place : cloud.positions) {
          // Rounding may put a point on its voxel's border.
          const Eigen::Vector2d in_tile = place.head<2>() / tile_m;
          EXPECT_NEAR(in_tile.x(), static_cast<double>(tile.i) + 0.5, 0.50001);
          EXPECT_NEAR(in_tile.y(), static_cast<double>(tile.j) + 0.5, 0.50001);
        }
        const auto add = [](auto& to, const auto& from) {
          to.insert(to.end(), from.begin(), from.end());
        };
        add(joined.positions, cloud.positions);
        add(joined.normals, cloud.normals);
        add(joined.colors, cloud.colors);
        for (ScalarField& field : joined.fields)
          if (!cloud.empty()) add(field.values, cloud.find_field(field.name)->values);
      }
      EXPECT_GT(tiles, 6U);
      EXPECT_TRUE(parts.cloud.empty());
      const std::vector<Row> found = rows_of(joined);
      const std::vector<Row> expected = rows_of(whole.cloud);
      ASSERT_EQ(found.size(), expected.size()) << tile_m;
      for (std::size_t n = 0; n < found.size(); ++n) ASSERT_EQ(found[n], expected[n]) << tile_m;
      const auto counts = [](const DepthFusionResult& result) {
        const SurfacePointCounts& points = result.points;
        return std::tuple(result.output_points, result.elements, result.occupied_voxels,
                          result.pixels.used, result.pixels.flying, points.merged,
                          points.seen_through, points.beyond_edge, points.extended_points,
                          points.max_views);
      };
      EXPECT_EQ(counts(parts), counts(whole)) << tile_m;
      EXPECT_GT(whole.points.merged, 0U);
      EXPECT_GT(whole.points.extended_points, 0U);
    }
}

TEST(DepthFusionTiles, FramesThatCannotBeUsedAreNamedOnce) {
  MemoryScan scan = noisy_scan(Eigen::Vector3d::Zero());
  scan.broken[3] = true;
  DepthFusionOptions options;
  options.registration_rounds = 0;
  TileFusion fusion(scan, scan.poses, options, 0.3);
  DepthFusionResult result = fusion.report();
  for (std::size_t n = 0; n < fusion.tiles().size(); ++n)
    libmap::merge_into<libmap::FusionCounts>(result, fusion.make(n).counts);
  ASSERT_EQ(result.skipped.size(), 1U);
  EXPECT_EQ(result.skipped.front().first, 3);
  EXPECT_EQ(result.frames, 9U);
  EXPECT_EQ(result.pixels.pixels, 9U * 128 * 96) << "each once, in however many tiles it is seen";
  for (TrajectoryPose& pose : scan.poses) pose.world_from_base.translation().x() += 1e18;
  EXPECT_EQ(error_of([&] { TileFusion(scan, scan.poses, options, 0.3); }).kind(),
            ErrorKind::bad_input);
}

}  // namespace depth_fusion_tiles_test
}  // namespace libmap
