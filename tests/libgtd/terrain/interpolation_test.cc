#include "libgtd/terrain/interpolation.h"

#include <gmock/gmock.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "libgtd/terrain/planar_delaunay.h"
#include "libgtd/terrain/regression_plane.h"
#include "libmap/core/parallel.h"
#include "libmap/io/cloud_io.h"
#include "tests/support/reference_data.h"
#include "tests/support/test_support.h"

namespace interpolation_test {

using Eigen::Vector2d;
using Eigen::Vector3d;
using graspmap_test::error_of;
using graspmap_test::is_error;
using graspmap_test::uniform;
using libgtd::interpolate;
using libgtd::InterpolationMethod;
using libgtd::InterpolationOptions;
using libgtd::InterpolationResult;
using libmap::PointCloud;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

PointCloud random_cloud(std::size_t count, double (*height)(double, double)) {
  PointCloud cloud;
  for (std::size_t i = 0; i < count; ++i) {
    const double x = uniform(-1, 1), y = uniform(-0.5, 0.5);
    cloud.positions.emplace_back(x, y, height(x, y));
  }
  return cloud;
}

double tilted_plane(double x, double y) { return 0.3 * x - 0.7 * y + 0.25; }
double waves(double x, double y) { return std::sin(5 * x) * std::cos(7 * y) + 2; }

InterpolationOptions method(InterpolationMethod m) {
  InterpolationOptions options;
  options.method = m;
  return options;
}

InterpolationOptions spacing(double grid_spacing_m) {
  InterpolationOptions options;
  options.grid_spacing_m = grid_spacing_m;
  return options;
}

// Oracle: height in the triangle whose circumcircle contains no point, by testing all triangles.
std::optional<double> slow_height(const PointCloud& cloud, const Vector2d& at) {
  const auto& p = cloud.positions;
  const auto flat = [&](std::size_t i) -> Vector2d { return p[i].head<2>(); };
  for (std::size_t i = 0; i < p.size(); ++i)
    for (std::size_t j = i + 1; j < p.size(); ++j)
      for (std::size_t k = j + 1; k < p.size(); ++k) {
        Eigen::Matrix3d corners;
        corners << flat(i), flat(j), flat(k), 1, 1, 1;
        const Vector3d weights = corners.inverse() * Vector3d(at.x(), at.y(), 1);
        if (!(weights.minCoeff() >= 0)) continue;
        Eigen::Matrix2d edges;
        edges << (flat(j) - flat(i)).transpose(), (flat(k) - flat(i)).transpose();
        const Vector2d center = edges.inverse() * (0.5 * Vector2d(edges.row(0).squaredNorm(),
                                                                  edges.row(1).squaredNorm()));
        bool empty = true;
        for (std::size_t l = 0; l < p.size() && empty; ++l)
          empty = (flat(l) - flat(i) - center).norm() > center.norm() * (1 - 1e-12);
        if (empty) return weights.dot(Vector3d(p[i].z(), p[j].z(), p[k].z()));
      }
  return std::nullopt;
}

// Nodes on corners and edges, where triangles differ by rounding: tests every triangle.
TEST(Interpolation, ANodeOnAnEdgeTakesTheLowerOfItsTrianglesHeights) {
  PointCloud cloud;
  for (int i = 0; i < 12; ++i)
    for (int j = 0; j < 12; ++j) cloud.positions.emplace_back(0.5 * i, 0.5 * j, uniform(0.1, 1));
  InterpolationOptions options;
  options.grid_spacing_m = 0.25;
  const InterpolationResult result = interpolate(cloud, options);
  ASSERT_EQ(result.cloud.size(), 23u * 23u);
  std::size_t shared = 0;
  const auto triangles = libgtd::triangulate_in_plane(cloud.positions).triangles;
  for (const Vector3d& node : result.cloud.positions) {
    double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
    for (const auto& corners : triangles) {
      const Vector3d a = cloud.positions[corners[0]];
      const Vector3d b = cloud.positions[corners[1]] - a, c = cloud.positions[corners[2]] - a;
      const Vector3d p = node - a;
      const double area = b.x() * c.y() - b.y() * c.x();
      const double u = (p.x() * c.y() - p.y() * c.x()) / area;
      const double v = (b.x() * p.y() - b.y() * p.x()) / area;
      if (u < 0 || v < 0 || u + v > 1) continue;  // exact for these numbers
      const auto [low, high] =
          std::minmax({a.z(), cloud.positions[corners[1]].z(), cloud.positions[corners[2]].z()});
      const double z = std::clamp(a.z() + u * b.z() + v * c.z(), low, high);
      lowest = std::min(lowest, z);
      highest = std::max(highest, z);
    }
    EXPECT_EQ(node.z(), lowest);
    shared += lowest < highest ? 1 : 0;
  }
  EXPECT_GT(shared, 20u);
}

TEST(Interpolation, APlaneStaysThatPlane) {
  const PointCloud cloud = random_cloud(2000, tilted_plane);
  const InterpolationResult corrected = interpolate(cloud);
  ASSERT_GT(corrected.cloud.size(), 1000u);
  for (const Vector3d& p : corrected.cloud.positions)
    ASSERT_NEAR(p.z(), tilted_plane(p.x(), p.y()), 1e-14);
  const InterpolationResult thesis = interpolate(cloud, method(InterpolationMethod::thesis));
  ASSERT_GT(thesis.cloud.size(), 1000u);
  for (const Vector3d& p : thesis.cloud.positions)
    ASSERT_NEAR(p.z(), tilted_plane(p.x(), p.y()), 1e-5);
}

TEST(Interpolation, AgreesWithTheSlowOracle) {
  const PointCloud cloud = random_cloud(24, waves);
  const InterpolationResult result = interpolate(cloud, spacing(0.11));
  std::map<std::pair<double, double>, double> heights;
  for (const Vector3d& p : result.cloud.positions) heights[{p.x(), p.y()}] = p.z();
  std::size_t inside = 0;
  for (int i = -9; i <= 9; ++i)
    for (int j = -4; j <= 4; ++j) {
      const auto expected = slow_height(cloud, {i * 0.11, j * 0.11});
      const auto found = heights.find({i * 0.11, j * 0.11});
      ASSERT_EQ(expected.has_value(), found != heights.end()) << i << " " << j;
      if (!expected) continue;
      ++inside;
      EXPECT_NEAR(found->second, *expected, 1e-12);
    }
  EXPECT_EQ(inside, result.cloud.size());
  EXPECT_GT(inside, 30u);
}

TEST(Interpolation, CountsAddUp) {
  for (const InterpolationMethod m :
       {InterpolationMethod::thesis, InterpolationMethod::corrected}) {
    const InterpolationResult result = interpolate(random_cloud(500, waves), method(m));
    EXPECT_EQ(result.nodes, result.cloud.size() + result.outside_nodes + result.zero_nodes);
    EXPECT_GT(result.outside_nodes, 0u);
  }
}

TEST(Interpolation, NodesOnTheHullAreKept) {
  PointCloud square;
  square.positions = {{0, 0, 1}, {4, 0, 1}, {0, 4, 5}, {4, 4, 5}};
  const InterpolationResult result = interpolate(square, spacing(1));
  ASSERT_EQ(result.cloud.size(), 25u);
  for (const Vector3d& p : result.cloud.positions) EXPECT_EQ(p.z(), 1 + p.y());
}

TEST(Interpolation, OutsideTheHullThereIsNothing) {
  PointCloud triangle;
  triangle.positions = {{0, 0, 1}, {10, 0, 1}, {0, 10, 1}};
  const InterpolationResult result = interpolate(triangle, spacing(1));
  EXPECT_EQ(result.nodes, 121u);
  EXPECT_EQ(result.cloud.size(), 66u);  // x + y <= 10
  EXPECT_EQ(result.outside_nodes, 55u);
}

TEST(Interpolation, OrderIsXOuterYInner) {
  const auto p = interpolate(random_cloud(300, waves)).cloud.positions;
  for (std::size_t i = 1; i < p.size(); ++i)
    ASSERT_TRUE(p[i - 1].x() < p[i].x() || (p[i - 1].x() == p[i].x() && p[i - 1].y() < p[i].y()));
}

TEST(Interpolation, NodesLieOnTheLatticeThroughTheOrigin) {
  const double pitch = 0.013;
  const PointCloud cloud = random_cloud(3000, waves);
  PointCloud left, right;
  for (const Vector3d& p : cloud.positions) {
    if (p.x() < 0.4) left.positions.push_back(p);
    if (p.x() > -0.4) right.positions.push_back(p);
  }
  std::map<std::pair<double, double>, double> heights;
  for (const Vector3d& p : interpolate(left, spacing(pitch)).cloud.positions) {
    ASSERT_EQ(p.x(), std::round(p.x() / pitch) * pitch);
    heights[{p.x(), p.y()}] = p.z();
  }
  std::size_t shared = 0;
  for (const Vector3d& p : interpolate(right, spacing(pitch)).cloud.positions) {
    if (std::abs(p.x()) > 0.2 || std::abs(p.y()) > 0.35) continue;  // away from either hull
    ASSERT_TRUE(heights.contains({p.x(), p.y()}));
    ASSERT_NEAR((heights[{p.x(), p.y()}]), p.z(), 1e-12);
    ++shared;
  }
  EXPECT_GT(shared, 1000u);
}

TEST(Interpolation, PitchIsEquation3_5AsPrinted) {
  PointCloud cloud;  // 1 point on each 0.1 x 0.1, on half of the bounding box: an L
  for (int i = 0; i < 80; ++i)
    for (int j = 0; j < 80; ++j)
      if (i < 40 || j < 40) cloud.positions.emplace_back(0.1 * i + 0.05, 0.1 * j + 0.05, 0);
  InterpolationOptions options;
  options.area_cell_m = 0.4;
  const InterpolationResult result = interpolate(cloud, options);
  EXPECT_NEAR(result.area_m2, 48, 1e-9);
  EXPECT_NEAR(result.grid_spacing_m, 1 / std::sqrt(4800 / 48.0 * 5 / 3), 1e-12);
  options.area_cell_m = 0;
  EXPECT_NEAR(interpolate(cloud, options).area_m2, 48, 3);
}

TEST(Interpolation, PitchOfTheProgramTakesTheBoundingBoxAndNoFiveThirds) {
  PointCloud cloud = random_cloud(996, waves);
  for (const double x : {-1, 1})
    for (const double y : {-0.5, 0.5}) cloud.positions.emplace_back(x, y, 1);
  const InterpolationResult result = interpolate(cloud, method(InterpolationMethod::thesis));
  EXPECT_EQ(result.area_m2, 2);
  EXPECT_EQ(result.grid_spacing_m, 1 / 22.3607);  // sqrt(500), four digits
}

TEST(Interpolation, GridOfTheProgramEndsBeforeTheLargestCoordinate) {
  PointCloud square;  // 4 points on 16 m^2: a pitch of 2 m
  square.positions = {{0, 0, 1}, {4, 0, 1}, {0, 4, 1}, {4, 4, 1}};
  const InterpolationResult result = interpolate(square, method(InterpolationMethod::thesis));
  EXPECT_EQ(result.grid_spacing_m, 2);
  EXPECT_THAT(result.cloud.positions, testing::ElementsAre(Vector3d(0, 0, 1), Vector3d(0, 2, 1),
                                                           Vector3d(2, 0, 1), Vector3d(2, 2, 1)));
}

TEST(Interpolation, HeightZeroIsDroppedByTheThesisAlone) {
  const PointCloud flat = random_cloud(200, [](double, double) { return 0.0; });
  const InterpolationResult thesis = interpolate(flat, method(InterpolationMethod::thesis));
  EXPECT_EQ(thesis.cloud.size(), 0u);
  EXPECT_GT(thesis.zero_nodes, 100u);
  const InterpolationResult corrected = interpolate(flat);
  EXPECT_GT(corrected.cloud.size(), 100u);
  EXPECT_EQ(corrected.zero_nodes, 0u);
}

TEST(Interpolation, LongTrianglesAcrossAGapAreRefused) {
  PointCloud cloud;
  for (int i = 0; i < 60; ++i)
    for (int j = 0; j < 20; ++j)
      if (i < 20 || i >= 40)
        cloud.positions.emplace_back(0.05 * i + uniform(0, 0.01), 0.05 * j + uniform(0, 0.01), 1);
  const auto in_gap = [](const InterpolationResult& result) {
    return std::count_if(result.cloud.positions.begin(), result.cloud.positions.end(),
                         [](const Vector3d& p) { return p.x() > 0.97 && p.x() < 1.99; });
  };
  InterpolationOptions options = spacing(0.02);
  EXPECT_GT(in_gap(interpolate(cloud, options)), 1000);
  options.max_edge_m = 0.12;
  const InterpolationResult refused = interpolate(cloud, options);
  EXPECT_EQ(in_gap(refused), 0);
  EXPECT_GT(refused.rejected_triangles, 0u);
  EXPECT_GT(refused.cloud.size(), 3000u);
}

TEST(Interpolation, ACliffIsNotAGap) {
  PointCloud cloud;
  for (int i = 0; i < 40; ++i)
    for (int j = 0; j < 20; ++j)
      cloud.positions.emplace_back(0.05 * i + uniform(0, 0.01), 0.05 * j, i < 20 ? 0 : 3);
  InterpolationOptions options = spacing(0.02);
  const std::size_t all = interpolate(cloud, options).cloud.size();
  options.max_edge_m = 0.12;
  EXPECT_NEAR(static_cast<double>(interpolate(cloud, options).cloud.size()),
              static_cast<double>(all), 0.02 * static_cast<double>(all));  // slivers at the hull
}

TEST(Interpolation, OfPointsAboveOneAnotherTheHighestCounts) {
  PointCloud cloud;
  for (const double z : {1.0, 3.0, 2.0})
    for (const double x : {0, 2})
      for (const double y : {0, 2}) cloud.positions.emplace_back(x, y, z);
  for (int turn = 0; turn < 2; ++turn) {
    const InterpolationResult result = interpolate(cloud, spacing(1));
    EXPECT_EQ(result.skipped_points, 8u);
    ASSERT_EQ(result.cloud.size(), 9u);
    for (const Vector3d& p : result.cloud.positions) EXPECT_EQ(p.z(), 3);
    std::reverse(cloud.positions.begin(), cloud.positions.end());
  }
}

TEST(Interpolation, DoesNotDependOnTheOrderOfThePointsOrTheThreads) {
  PointCloud cloud = random_cloud(20000, waves);
  const auto a = interpolate(cloud).cloud.positions;
  {
    const libmap::ThreadLimit limit(1);
    EXPECT_EQ(a, interpolate(cloud).cloud.positions);
  }
  for (std::size_t i = cloud.size(); i > 1; --i)
    std::swap(cloud.positions[i - 1], cloud.positions[graspmap_test::random_engine()() % i]);
  const auto b = interpolate(cloud).cloud.positions;
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].head<2>(), b[i].head<2>());
    ASSERT_NEAR(a[i].z(), b[i].z(), 1e-9);
  }
}

TEST(Interpolation, AFarOriginDoesNoHarm) {
  PointCloud cloud = random_cloud(500, tilted_plane);
  const Vector3d shift(0x1p20, -0x1p21, 0x1p19);
  for (Vector3d& p : cloud.positions) p += shift;
  const InterpolationResult result = interpolate(cloud);
  ASSERT_GT(result.cloud.size(), 500u);
  for (const Vector3d& p : result.cloud.positions)
    ASSERT_NEAR(p.z() - shift.z(), tilted_plane(p.x() - shift.x(), p.y() - shift.y()), 1e-8);
}

TEST(Interpolation, PointsThatAreNotFiniteAreSkipped) {
  PointCloud cloud = random_cloud(300, waves);
  const auto clean = interpolate(cloud).cloud.positions;
  cloud.positions.emplace_back(0, 0, nan);
  cloud.positions.emplace_back(0, std::numeric_limits<double>::infinity(), 0);
  const InterpolationResult result = interpolate(cloud);
  EXPECT_EQ(result.skipped_points, 2u);
  EXPECT_EQ(result.cloud.positions, clean);
}

TEST(Interpolation, OfAGridOfPointsEachNodeIsFound) {
  PointCloud grid;  // all circles through neighbors hold four points
  for (int i = 0; i < 50; ++i)
    for (int j = 0; j < 50; ++j) grid.positions.emplace_back(i * 0.25, j * 0.25, i - 2 * j);
  const InterpolationResult result = interpolate(grid, spacing(0.125));
  ASSERT_EQ(result.cloud.size(), 99u * 99u);
  for (const Vector3d& p : result.cloud.positions) ASSERT_EQ(p.z(), 4 * p.x() - 8 * p.y());
}

TEST(InterpolationErrors, TooFewOrOnALine) {
  PointCloud cloud;
  EXPECT_TRUE(is_error(error_of([&] { interpolate(cloud); }),
                       {.field = "points", .value = "0", .bound = ">= 3"}));
  cloud.positions = {{0, 0, 0}, {1, 1, 0}, {nan, 1, 2}};
  EXPECT_TRUE(is_error(error_of([&] { interpolate(cloud); }),
                       {.field = "points", .value = "2", .bound = ">= 3"}));
  cloud.positions = {{0, 0, 0}, {1, 1, 5}, {2, 2, 3}, {2, 2, 4}};
  for (const auto m : {InterpolationMethod::thesis, InterpolationMethod::corrected})
    EXPECT_TRUE(is_error(error_of([&] { interpolate(cloud, method(m)); }), {.field = "points"}));
  cloud.positions.assign(10, Vector3d(1, 2, 3));
  EXPECT_TRUE(is_error(error_of([&] { interpolate(cloud); }), {.field = "points"}));
}

TEST(InterpolationErrors, OptionsOutOfRange) {
  const PointCloud cloud = random_cloud(10, waves);
  InterpolationOptions options;
  options.max_edge_m = -1;
  EXPECT_EQ(error_of([&] { interpolate(cloud, options); }).context().field, "max_edge_m");
  EXPECT_EQ(error_of([&] { interpolate(cloud, spacing(nan)); }).context().field, "grid_spacing_m");
  options = {};
  options.area_cell_m = std::numeric_limits<double>::infinity();
  EXPECT_EQ(error_of([&] { interpolate(cloud, options); }).context().field, "area_cell_m");
}

TEST(InterpolationErrors, TooManyNodesOrTooFarAway) {
  PointCloud cloud = random_cloud(100, waves);
  EXPECT_TRUE(is_error(error_of([&] { interpolate(cloud, spacing(1e-7)); }),
                       {.field = "grid spacing", .value = "1e-07 m"}));
  for (Vector3d& p : cloud.positions) p.x() += 1e17;
  cloud.positions[0].x() += 1e3;
  EXPECT_TRUE(is_error(error_of([&] { interpolate(cloud, spacing(10)); }),
                       {.field = "grid spacing", .value = "10 m"}));
}

// Four points 89 m apart, with a node in each voxel of 1 cm.
TEST(InterpolationErrors, TooManyNodesForSoFewPoints) {
  PointCloud cloud;
  cloud.positions = {{0, 0, 0}, {89, 0, 0}, {0, 89, 0.5}, {89, 89, 0}};
  InterpolationOptions options;
  options.max_grid_spacing_m = 0.009;
  const libmap::Error error = error_of([&] { interpolate(cloud, options); });
  EXPECT_TRUE(
      is_error(error, {.field = "grid spacing", .value = "0.009 m", .about = "1000400 nodes"}));
  options.max_nodes = 5000;
  EXPECT_TRUE(is_error(error_of([&] { interpolate(cloud, options); }),
                       {.field = "grid spacing", .value = "0.009 m"}));
}

TEST(Interpolation, SlopesSceneHasThePitchOfEquation3_5) {
  GRASPMAP_REQUIRE_DATA();
  const auto path = graspmap_test::data_folder() / "clouds" / "simulated_cloud_pre-scan.pcd";
  const PointCloud cloud = libmap::read_cloud(path).cloud;
  const auto terrain = [&](libgtd::PlaneMethod m) {
    libgtd::RegressionPlaneOptions options;
    options.method = m;
    return libgtd::transform_to_terrain(cloud, libgtd::fit_regression_plane(cloud, options), m);
  };
  const InterpolationResult thesis =
      interpolate(terrain(libgtd::PlaneMethod::thesis), method(InterpolationMethod::thesis));
  EXPECT_NEAR(thesis.grid_spacing_m, 0.025, 1e-3);
  const InterpolationResult corrected = interpolate(terrain(libgtd::PlaneMethod::corrected));
  EXPECT_NEAR(corrected.area_m2, 22.8, 0.5);
  EXPECT_NEAR(corrected.grid_spacing_m, std::sqrt(22.8 / 70322 * 3 / 5), 2e-4);
}

class InterpolationReference : public testing::TestWithParam<const char*> {};

TEST_P(InterpolationReference, ToTheBit) {
  GRASPMAP_REQUIRE_REFERENCE();
  const std::string stem = (graspmap_test::reference_folder() / "gtd" / GetParam()).string();
  const auto frame = graspmap_test::read_frame(stem + ".frame.txt");
  const auto expected = graspmap_test::read_points_f32_gz(stem + ".interpolated.f32.gz");
  PointCloud terrain;
  for (const auto& p : graspmap_test::read_points_f32_gz(stem + ".transformed.f32.gz"))
    terrain.positions.push_back(p.cast<double>());
  const InterpolationResult result = interpolate(terrain, method(InterpolationMethod::thesis));
  EXPECT_EQ(result.grid_spacing_m, frame.grid_spacing);
  EXPECT_EQ(result.area_m2, frame.x_width * frame.y_width);
  ASSERT_EQ(result.cloud.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i)
    ASSERT_EQ(result.cloud.positions[i], expected[i].cast<double>()) << i;
}

INSTANTIATE_TEST_SUITE_P(Sets, InterpolationReference,
                         testing::Values("primitive_shapes.thesis", "leaning_holds_hubrobo.thesis",
                                         "leaning_holds_hubrobo.envelope"),
                         [](const auto& set) {
                           std::string name = set.param;
                           name[name.find('.')] = '_';
                           return name;
                         });

}  // namespace interpolation_test
