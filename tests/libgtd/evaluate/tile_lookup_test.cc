// Look-ups in a map in tiles equal those in the whole map to the bit.
#include "libgtd/evaluate/lookup.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "libmap/core/parallel.h"
#include "tests/support/test_support.h"

namespace tile_lookup_test {

using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::uniform;
using libgtd::GraspabilityMap;
using libgtd::LookupAnswer;
using libgtd::LookupMode;
using libgtd::LookupOptions;
using libgtd::MapFrame;
using libgtd::StoredTile;
using libgtd::TileNumber;
using libgtd::TileStoreIndex;
using libgtd::Voxel;
using libmap::PointCloud;

// Ground with holes and steps, some columns with several voxels, as a whole and in tiles.
class TiledMap {
 public:
  explicit TiledMap(MapFrame frame = MapFrame::terrain) {
    index_.lattice = {{0.003, -0.002, 0.001}, 0.02};
    index_.tile_voxels = 7;
    index_.frame = frame;
    index_.manifest.transforms.emplace_back("terrain_from_input",
                                            libmap::make_pose_from_rpy({3, -1, 2}, {20, -30, 40}));
    GraspabilityMap map;
    map.lattice = index_.lattice;
    map.terrain_from_input = index_.terrain_from_input();
    for (int i = -20; i < 25; ++i)
      for (int j = -15; j < 20; ++j) {
        const bool in_hole = i > -14 && i < 1 && j > -8 && j < 7;
        if (in_hole || uniform(0, 1) < 0.1) continue;
        const int top = static_cast<int>(uniform(-3, 3)) + (i > 10 ? 12 : 0);
        for (int k = top; k >= top - (uniform(0, 1) < 0.2 ? 3 : 0); --k)
          map.voxels.push_back({.voxel = {i, j, k},
                                .counts = {static_cast<std::uint32_t>(uniform(0, 900)), 7},
                                .score = std::floor(uniform(0, 8)) / 8});
      }
    std::sort(map.voxels.begin(), map.voxels.end(),
              [](const auto& a, const auto& b) { return a.voxel < b.voxel; });
    whole_ = libgtd::to_cloud(map, frame);
    cut(map, frame);
  }

  const TileStoreIndex& index() const { return index_; }
  const PointCloud& whole() const { return whole_; }
  PointCloud load(std::size_t tile) const {
    ++loads_;
    return tiles_[tile];
  }
  std::size_t loads() const { return loads_; }

 private:
  void cut(const GraspabilityMap& map, MapFrame frame) {
    std::map<TileNumber, GraspabilityMap> parts;
    for (const auto& voxel : map.voxels)
      parts[tile_of(voxel.voxel, index_.tile_voxels)].voxels.push_back(voxel);
    index_.min = index_.max = map.voxels.front().voxel;
    for (auto& [number, part] : parts) {
      part.lattice = map.lattice;
      part.terrain_from_input = map.terrain_from_input;
      StoredTile tile;
      tile.number = number;
      tile.voxels = part.voxels.size();
      tile.min = tile.max = part.voxels.front().voxel;
      for (const auto& one : part.voxels) {
        grow(tile.min, tile.max, one.voxel);
        grow(index_.min, index_.max, one.voxel);
      }
      index_.tiles.push_back(tile);
      tiles_.push_back(libgtd::to_cloud(part, frame));
    }
  }
  static void grow(Voxel& min, Voxel& max, const Voxel& by) {
    min = {std::min(min.i, by.i), std::min(min.j, by.j), std::min(min.k, by.k)};
    max = {std::max(max.i, by.i), std::max(max.j, by.j), std::max(max.k, by.k)};
  }

  TileStoreIndex index_;
  PointCloud whole_;
  std::vector<PointCloud> tiles_;
  mutable std::atomic<std::size_t> loads_ = 0;
};

// On the map, beside it, above it, in its hole, on borders of tiles, far away.
std::vector<Eigen::Vector3d> places(const TiledMap& map) {
  const libmap::Pose map_from_terrain = map.index().frame == MapFrame::input
                                            ? map.index().terrain_from_input().inverse()
                                            : libmap::Pose(libmap::Pose::Identity());
  std::vector<Eigen::Vector3d> points;
  for (int n = 0; n < 400; ++n)
    points.emplace_back(uniform(-0.5, 0.6), uniform(-0.4, 0.5), uniform(-0.1, 0.35));
  // Corners of voxels are equally near to several centers.
  for (int n = 0; n < 200; ++n)
    points.push_back(map.index().lattice.origin_m +
                     0.02 * Eigen::Vector3d(std::floor(uniform(-20, 25)),
                                            std::floor(uniform(-15, 20)),
                                            std::floor(uniform(-4, 16))));
  for (int n = 0; n < 30; ++n)
    points.emplace_back(uniform(-30, 30), uniform(-30, 30), uniform(-30, 30));
  points.emplace_back(1e7, -1e7, 1e3);
  points.emplace_back(0, 0, 1e12);
  for (Eigen::Vector3d& point : points) point = map_from_terrain * point;
  points.emplace_back(0, std::numeric_limits<double>::quiet_NaN(), 0);
  return points;
}

std::vector<LookupAnswer> ask(const TiledMap& map, const std::vector<Eigen::Vector3d>& points,
                              const LookupOptions& options) {
  return libgtd::look_up_tiles(
      map.index(), [&](std::size_t tile) { return map.load(tile); }, points, options);
}

class TileLookup : public testing::TestWithParam<std::tuple<LookupMode, MapFrame>> {};

TEST_P(TileLookup, AnswersAreThoseOfTheWholeMap) {
  const auto [mode, frame] = GetParam();
  const TiledMap map(frame);
  ASSERT_GT(map.index().tiles.size(), 20U);
  const auto points = places(map);
  std::size_t found = 0;
  for (const double radius : {0.011, 0.05, 0.3}) {
    LookupOptions options;
    options.mode = mode;
    options.radius_m = radius;
    options.max_distance_m = radius;
    const auto wanted = libgtd::look_up(map.whole(), points, options);
    const auto answers = ask(map, points, options);
    ASSERT_EQ(answers.size(), wanted.size());
    for (std::size_t n = 0; n < points.size(); ++n) {
      EXPECT_EQ(answers[n].found, wanted[n].found) << points[n].transpose();
      EXPECT_EQ(answers[n].distance_m, wanted[n].distance_m) << points[n].transpose();
      EXPECT_EQ(answers[n].map_points, wanted[n].map_points) << points[n].transpose();
      EXPECT_EQ(answers[n].values, wanted[n].values) << points[n].transpose();
      found += wanted[n].found ? 1 : 0;
    }
  }
  EXPECT_GT(found, points.size());
  EXPECT_LT(found, 3 * points.size() - 100);
}

std::string name_of(const testing::TestParamInfo<std::tuple<LookupMode, MapFrame>>& info) {
  static const char* const modes[] = {"nearest", "maximum", "mean"};
  return std::string(modes[static_cast<int>(std::get<0>(info.param))]) +
         (std::get<1>(info.param) == MapFrame::input ? "_input" : "_terrain");
}
INSTANTIATE_TEST_SUITE_P(Modes, TileLookup,
                         testing::Combine(testing::Values(LookupMode::nearest, LookupMode::maximum,
                                                          LookupMode::mean),
                                          testing::Values(MapFrame::terrain, MapFrame::input)),
                         name_of);

TEST(TileLookupLoads, OnlyTilesThatAreAskedAndThoseOnce) {
  const TiledMap map;
  // In the middle of tile (2, 1), on its ground.
  const std::size_t middle = [&] {
    for (std::size_t n = 0; n < map.whole().size(); ++n)
      if (map.whole().find_field("i")->values[n] == 17 &&
          map.whole().find_field("j")->values[n] == 10)
        return n;
    return std::size_t{0};
  }();
  const std::vector<Eigen::Vector3d> points(500, map.whole().positions[middle]);
  const auto answers = ask(map, points, {});
  EXPECT_TRUE(answers.front().found);
  EXPECT_EQ(map.loads(), 1U);
}

TEST(TileLookupLoads, ThreadsChangeNothing) {
  const TiledMap map;
  const auto points = places(map);
  const LookupOptions options{.mode = LookupMode::mean, .radius_m = 0.05};
  const auto many = ask(map, points, options);
  const libmap::ThreadLimit one(1);
  const auto alone = ask(map, points, options);
  for (std::size_t n = 0; n < points.size(); ++n) EXPECT_EQ(alone[n].values, many[n].values);
}

// With an invalid transform, no point has a finite position.
TEST(TileLookup, PlacesThatTheTransformLoses) {
  const TiledMap map(MapFrame::input);
  TileStoreIndex index = map.index();
  index.manifest.transforms.front().second.linear().setConstant(1e308);
  const std::vector<Eigen::Vector3d> points = {map.whole().positions[3], {10, -10, 10}};
  const auto answers = libgtd::look_up_tiles(
      index, [&](std::size_t tile) { return map.load(tile); }, points, {.max_distance_m = 1e9});
  for (const LookupAnswer& answer : answers) EXPECT_FALSE(answer.found);
}

TEST(TileLookupErrors, MapsThatCannotBeAsked) {
  const TiledMap map;
  const std::vector<Eigen::Vector3d> points = {{0, 0, 0}};
  TileStoreIndex empty = map.index();
  empty.tiles.clear();
  const auto load = [&](std::size_t tile) { return map.load(tile); };
  EXPECT_TRUE(is_error(error_of([&] { libgtd::look_up_tiles(empty, load, points); }),
                       {.field = "points of the map"}));
  const auto without_columns = [&](std::size_t tile) {
    PointCloud cloud = map.load(tile);
    cloud.fields.resize(2);
    return cloud;
  };
  EXPECT_EQ(error_of([&] { libgtd::look_up_tiles(map.index(), without_columns, points); })
                .context()
                .field,
            "i");
  const auto reversed = [&](std::size_t tile) {
    const PointCloud cloud = map.load(tile);
    std::vector<std::size_t> order(cloud.size());
    for (std::size_t n = 0; n < order.size(); ++n) order[n] = order.size() - 1 - n;
    return libmap::select_points(cloud, order);
  };
  EXPECT_TRUE(is_error(error_of([&] { libgtd::look_up_tiles(map.index(), reversed, points); }),
                       {.field = "points of a tile"}));
  const auto nowhere = [&](std::size_t tile) {
    PointCloud cloud = map.load(tile);
    for (libmap::ScalarField& field : cloud.fields)
      if (field.name == "k") field.values.back() = 1e10;
    return cloud;
  };
  EXPECT_EQ(error_of([&] { libgtd::look_up_tiles(map.index(), nowhere, points); }).context().field,
            "k");
  EXPECT_EQ(error_of([&] { libgtd::look_up_tiles(map.index(), load, points, {.radius_m = -1}); })
                .context()
                .field,
            "radius_m");
}

// A tile with points farther apart than any terrain takes as much memory and work as two neighbors.
TEST(TileLookup, ColumnsFarApart) {
  constexpr double far_column = 5e8;
  TileStoreIndex index;
  index.lattice = {{0.0, 0.0, 0.0}, 0.02};
  index.tile_voxels = 7;
  StoredTile tile;
  tile.number = {0, 0};
  tile.voxels = 2;
  index.tiles.push_back(tile);
  PointCloud cloud;
  cloud.positions = {{0.01, 0.01, 0.01}, {0.02 * far_column + 0.01, 0.01, 0.01}};
  cloud.add_field("i", libmap::ScalarType::int32).values = {0.0, far_column};
  cloud.add_field("j", libmap::ScalarType::int32);
  cloud.add_field("k", libmap::ScalarType::int32);
  const std::vector<Eigen::Vector3d> points = {{0.1, 0.0, 0.0}, {0.02 * far_column, 0.5, 0.0}};
  const auto answers = libgtd::look_up_tiles(index, [&](std::size_t) { return cloud; }, points,
                                             {.max_distance_m = 1.0});
  ASSERT_EQ(answers.size(), 2u);
  for (std::size_t n = 0; n < 2; ++n) {
    EXPECT_TRUE(answers[n].found);
    EXPECT_NEAR(answers[n].distance_m, (cloud.positions[n] - points[n]).norm(), 1e-7);
  }
  EXPECT_EQ(answers[1].values.front(), far_column);
}

}  // namespace tile_lookup_test
