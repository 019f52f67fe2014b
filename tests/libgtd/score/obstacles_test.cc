// Obstacles: steps, ramps and table rocks in closed form.
#include "libgtd/score/obstacles.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "libgtd/detect.h"
#include "tests/libgtd/score/score_test_support.h"

namespace libgtd {
namespace obstacles_test {

using graspmap_test::error_of;
using graspmap_test::gripper_named;
using graspmap_test::is_error;
using graspmap_test::uniform;
using libmap::PointCloud;

// Height field over squares of 5 mm; steps become vertical walls.
template <typename Height>
PointCloud terrain_of(const Height& height) {
  PointCloud cloud;
  const double step = 0.005;
  for (double x = -0.6025; x < 0.6; x += step)
    for (double y = -0.6025; y < 0.6; y += step) {
      const double z = height(x, y);
      cloud.positions.emplace_back(x, y, z + 0.004);
      for (const auto& [dx, dy] : {std::pair{step, 0.0}, {0.0, step}}) {
        const double other = height(x + dx, y + dy);
        const double low = std::min(z, other), high = std::max(z, other);
        for (double at = low + step; at < high; at += step)
          cloud.positions.emplace_back(x + dx / 2, y + dy / 2, at + 0.004);
      }
    }
  return cloud;
}

struct Limits {
  double height_m = 0.2;
  double slope_deg = 60.0;
};

using Counts = std::map<Obstacle, std::size_t>;

DetectionResult evaluate(const PointCloud& cloud, const Limits& limits) {
  DetectionOptions options;
  options.gripper = gripper_named("scar-e");
  options.plane = PlaneSource::none;
  options.scenario.curvature_radius_m = 0.0;
  options.scenario.obstacle_height_m = limits.height_m;
  options.scenario.obstacle_slope_deg = limits.slope_deg;
  return detect(cloud, options);
}

Counts counts_of(const DetectionResult& result) {
  Counts counts;
  for (const MapVoxel& one : result.map.voxels) ++counts[one.obstacle];
  EXPECT_EQ(result.obstacle_voxels, result.map.voxels.size() - counts[Obstacle::none]);
  return counts;
}

double step_of_25_cm(double x, double) { return x < 0.1 ? 0.0 : 0.25; }

TEST(Obstacles, StepIsOneAboveTheHeightAndBelowItNone) {
  const PointCloud cloud = terrain_of(step_of_25_cm);
  const Counts above = counts_of(evaluate(cloud, {.height_m = 0.24}));
  EXPECT_GT(above.at(Obstacle::face), 1000U);
  // The smaller part is unreachable: 0.5 of 1.2 m.
  EXPECT_NEAR(static_cast<double>(above.at(Obstacle::unreachable)), 120.0 * 50.0, 700.0);
  const auto below = counts_of(evaluate(cloud, {.height_m = 0.26}));
  EXPECT_EQ(below.size(), 1U);
  EXPECT_TRUE(below.contains(Obstacle::none));
}

TEST(Obstacles, RampIsOneBeyondTheSlopeAlone) {
  const PointCloud cloud =
      terrain_of([](double x, double) { return std::clamp(x, 0.0, 0.3); });  // 45 deg
  EXPECT_FALSE(counts_of(evaluate(cloud, {.slope_deg = 47.0})).contains(Obstacle::face));
  EXPECT_TRUE(counts_of(evaluate(cloud, {.slope_deg = 43.0})).contains(Obstacle::face));
  EXPECT_FALSE(
      counts_of(evaluate(cloud, {.height_m = 0.31, .slope_deg = 43.0})).contains(Obstacle::face));
}

double table(double x, double y) { return std::max(std::abs(x), std::abs(y)) < 0.2 ? 0.3 : 0.0; }

TEST(Obstacles, TopOfATableRockIsOutOfReach) {
  const auto result = evaluate(terrain_of(table), {});
  for (const MapVoxel& one : result.map.voxels) {
    const Eigen::Vector3d place = result.map.lattice.center_of(one.voxel);
    const double out = std::max(std::abs(place.x()), std::abs(place.y()));
    if (out < 0.15) {
      EXPECT_EQ(one.obstacle, Obstacle::unreachable);
    }
    if (out > 0.22) {
      EXPECT_EQ(one.obstacle, Obstacle::none);
    }
    if (place.z() > 0.05 && place.z() < 0.25) {
      EXPECT_EQ(one.obstacle, Obstacle::face);
    }
  }
}

TEST(Obstacles, RampToTheTableLeadsUp) {
  const auto result = evaluate(terrain_of([](double x, double y) {
                                 const double ramp =
                                     std::abs(y) < 0.12 && x < 0.0 ? 0.3 + 0.8 * (x + 0.2) : 0.0;
                                 return std::max(table(x, y), std::min(ramp, 0.3));
                               }),
                               {});
  const Counts counts = counts_of(result);
  EXPECT_GT(counts.at(Obstacle::face), 500U);
  for (const MapVoxel& one : result.map.voxels) {
    const Eigen::Vector3d place = result.map.lattice.center_of(one.voxel);
    if (std::max(std::abs(place.x()), std::abs(place.y())) < 0.1) {
      EXPECT_EQ(one.obstacle, Obstacle::none);
    }
  }
}

// A pit is not an obstacle; neither is ground separated by a shadow.
TEST(Obstacles, PitsAndGroundBehindGapsAreNone) {
  const Counts pit =
      counts_of(evaluate(terrain_of([](double x, double y) { return 0.3 - table(x, y); }), {}));
  EXPECT_GT(pit.at(Obstacle::face), 500U);
  EXPECT_FALSE(pit.contains(Obstacle::unreachable));
  PointCloud shadow = terrain_of([](double x, double y) { return table(x - 0.4, y); });
  std::erase_if(shadow.positions, [](const Eigen::Vector3d& p) {
    return p.x() > 0.35 && p.z() < 0.28 && std::abs(std::abs(p.y()) - 0.3) < 0.06;
  });
  const auto result = evaluate(shadow, {});
  for (const MapVoxel& one : result.map.voxels)
    if (result.map.lattice.center_of(one.voxel).z() < 0.02) {
      EXPECT_NE(one.obstacle, Obstacle::unreachable);
    }
}

TEST(Obstacles, MapsWithoutLimitsHaveNoField) {
  const PointCloud cloud = terrain_of(step_of_25_cm);
  for (const Limits& limits : {Limits{.height_m = 0.0}, Limits{.slope_deg = 0.0}}) {
    const PointCloud map = to_cloud(evaluate(cloud, limits).map, MapFrame::terrain);
    EXPECT_EQ(map.find_field("obstacle"), nullptr);
    EXPECT_EQ(map.find_field("slope_deg"), nullptr);
    EXPECT_FALSE(map.has_normals());
  }
}

TEST(Obstacles, AnyMethodEvaluatesThem) {
  const PointCloud cloud = terrain_of(table);
  for (const Method method : {Method::thesis, Method::climblab}) {
    DetectionOptions options;
    options.gripper = gripper_named("scar-e");
    options.plane = PlaneSource::none;
    options.scenario.method = method;
    options.scenario.curvature_radius_m = 0.0;
    options.scenario.obstacle_height_m = 0.2;
    EXPECT_GT(detect(cloud, options).obstacle_voxels, 1000U) << name_of(method);
  }
}

// Oracle by definition, with loops over all pairs.
std::vector<Obstacle> by_hand(const std::vector<Voxel>& voxels, const std::vector<float>& slopes,
                              const ObstacleOptions& options, double size) {
  const std::size_t count = voxels.size();
  const auto apart = [&](std::size_t a, std::size_t b) {
    return std::max({std::abs(voxels[a].i - voxels[b].i), std::abs(voxels[a].j - voxels[b].j),
                     std::abs(voxels[a].k - voxels[b].k)});
  };
  const auto label = [&](const auto& belongs) {
    std::vector<std::size_t> labels(count, count);
    for (std::size_t n = 0; n < count; ++n) {
      if (!belongs(n) || labels[n] != count) continue;
      std::vector<std::size_t> open = {n};
      labels[n] = n;
      while (!open.empty()) {
        const std::size_t at = open.back();
        open.pop_back();
        for (std::size_t m = 0; m < count; ++m)
          if (belongs(m) && labels[m] == count && apart(at, m) <= 2) {
            labels[m] = n;
            open.push_back(m);
          }
      }
    }
    return labels;
  };
  const auto is_steep = [&](std::size_t n) { return slopes[n] > options.slope_deg; };
  const auto faces = label(is_steep);
  std::vector<int> foot(count, 1000000), top(count, -1000000);
  for (std::size_t n = 0; n < count; ++n)
    for (std::size_t m = 0; m < count; ++m) {
      const Eigen::Vector3d way(voxels[n].i - voxels[m].i, voxels[n].j - voxels[m].j,
                                voxels[n].k - voxels[m].k);
      if (!is_steep(n) || size * way.norm() > options.normal_radius_m) continue;
      foot[faces[n]] = std::min(foot[faces[n]], voxels[m].k);
      top[faces[n]] = std::max(top[faces[n]], voxels[m].k);
    }
  std::vector<Obstacle> result(count, Obstacle::none);
  for (std::size_t n = 0; n < count; ++n)
    if (is_steep(n) && size * (top[faces[n]] - foot[faces[n]]) > options.height_m + 1e-9)
      result[n] = Obstacle::face;
  const auto regions = label([&](std::size_t n) { return result[n] == Obstacle::none; });
  std::map<std::size_t, int> sizes;
  for (std::size_t n = 0; n < count; ++n)
    if (regions[n] != count) ++sizes[regions[n]];
  std::size_t ground = count;
  for (const auto& [region, of] : sizes)
    if (ground == count || of > sizes[ground]) ground = region;
  std::vector<Obstacle> marked = result;
  for (std::size_t n = 0; n < count; ++n)
    for (std::size_t m = 0; m < count; ++m)
      if (result[n] == Obstacle::none && result[m] == Obstacle::face && apart(n, m) <= 2 &&
          regions[n] != ground &&
          (size * (voxels[n].k - foot[faces[m]]) > options.height_m + 1e-9 ||
           2 * voxels[n].k > foot[faces[m]] + top[faces[m]]))
        for (std::size_t other = 0; other < count; ++other)
          if (regions[other] == regions[n]) marked[other] = Obstacle::unreachable;
  return marked;
}

TEST(Obstacles, AgreeWithTheDefinitionOnRandomPlaces) {
  std::map<Obstacle, int> seen;
  for (int round = 0; round < 30; ++round) {
    std::vector<Voxel> voxels;
    std::vector<float> slopes;
    for (int i = 0; i < 16; ++i)
      for (int j = 0; j < 16; ++j)
        if (uniform(0, 1) < 0.6)
          voxels.push_back({3 * i / 2, j,
                            static_cast<int>(uniform(0, 1) < 0.5 ? uniform(0, 3) : uniform(3, 9))});
    for (std::size_t n = 0; n < voxels.size(); ++n)
      slopes.push_back(static_cast<float>(uniform(0.0, 90.0)));
    slopes[0] = std::numeric_limits<float>::quiet_NaN();
    const ObstacleOptions options{
        .slope_deg = uniform(40.0, 80.0), .height_m = 0.04, .normal_radius_m = 0.03};
    const auto found = find_obstacles(voxels, slopes, 0.01, options);
    EXPECT_EQ(found, by_hand(voxels, slopes, options, 0.01));
    for (const Obstacle one : found) ++seen[one];
    // Radii larger than the extent, and larger than an int, give the same result.
    const auto within = [&](double radius_m) {
      ObstacleOptions wide = options;
      wide.normal_radius_m = radius_m;
      return find_obstacles(voxels, slopes, 0.01, wide);
    };
    EXPECT_EQ(within(1e12), within(0.5));
  }
  EXPECT_EQ(seen.size(), 3U);
}

TEST(Obstacles, NeedAMapInOrder) {
  EXPECT_NO_THROW(find_obstacles({}, {}, 0.01, {}));
  EXPECT_TRUE(is_error(error_of([] {
                         find_obstacles({{1, 0, 0}, {0, 0, 0}}, {0.0F, 0.0F}, 0.01, {});
                       }),
                       {.field = "i, j, k"}));
  EXPECT_TRUE(is_error(error_of([] {
                         find_obstacles({{1, 0, 0}}, {}, 0.01, {});
                       }),
                       {.field = "slopes_deg", .value = "0", .bound = "1"}));
}

TEST(Obstacles, NeedPossibleLengths) {
  const std::vector<Voxel> far = {{0, 0, 0}, {300'000'000, 0, 0}};
  const std::vector<float> slopes = {80.0F, 80.0F};
  const auto field_of = [&](double voxel_size_m, double height_m, double radius_m) {
    return error_of([&] {
             find_obstacles(far, slopes, voxel_size_m,
                            {.slope_deg = 45.0, .height_m = height_m, .normal_radius_m = radius_m});
           })
        .context()
        .field;
  };
  EXPECT_EQ(field_of(0.0, 0.1, 0.1), "voxel_size_m");
  EXPECT_EQ(field_of(NAN, 0.1, 0.1), "voxel_size_m");
  EXPECT_EQ(field_of(0.01, -1.0, 0.1), "obstacle_height_m");
  EXPECT_EQ(field_of(0.01, 0.1, -5.0), "normal_radius_m");
  EXPECT_EQ(field_of(0.01, 0.1, 1e9), "normal_radius_m");
}

}  // namespace obstacles_test
}  // namespace libgtd
