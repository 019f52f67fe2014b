#include "libgtd/evaluate/map_surface.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <set>

#include "libmap/core/parallel.h"
#include "tests/support/test_support.h"

namespace map_surface_test {

using graspmap_test::error_of;
using graspmap_test::uniform;
using libgtd::MapSurface;
using libgtd::Voxel;
using libgtd::VoxelLattice;
using libgtd::VoxelMap;
using std::numbers::pi;

const VoxelLattice lattice{{0.0013, -0.0021, 0.0037}, 0.01};

VoxelMap map_of(const std::set<Voxel>& voxels) {
  VoxelMap map;
  map.lattice = lattice;
  map.voxels.assign(voxels.begin(), voxels.end());
  map.scores.assign(map.size(), 0.5F);
  map.graspable.assign(map.size(), 0);
  map.border = map.obstacle = map.graspable;
  return map;
}

// Voxels that contain points of a surface.
std::set<Voxel> voxels_of(const std::function<Eigen::Vector3d(double, double)>& surface,
                          double u_end, double v_end, double du, double dv) {
  std::set<Voxel> voxels;
  for (double u = du / 2; u < u_end; u += du)
    for (double v = dv / 2; v < v_end; v += dv) voxels.insert(lattice.voxel_of(surface(u, v)));
  return voxels;
}

constexpr double edge_m = 0.6;

Eigen::Matrix3d turn_of(double tilt_deg, double heading_deg) {
  return (Eigen::AngleAxisd(heading_deg * pi / 180, Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(tilt_deg * pi / 180, Eigen::Vector3d::UnitY()))
      .toRotationMatrix();
}

// Square rotated about z, then tilted about a horizontal axis.
std::set<Voxel> square(const Eigen::Matrix3d& turn) {
  return voxels_of(
      [&](double u, double v) { return Eigen::Vector3d(turn * Eigen::Vector3d(u, v, 0)); }, edge_m,
      edge_m, 0.0023, 0.0023);
}

double sum_of(const std::vector<float>& areas) {
  double sum = 0.0;
  for (const float area : areas) sum += static_cast<double>(area);
  return sum;
}

TEST(MapSurface, AreaAndSlopeOfInclinedSquares) {
  double ratios = 0.0;
  int squares = 0;
  for (const double tilt : {0.0, 10.0, 20.0, 30.0, 45.0, 60.0, 80.0})
    for (const double heading : {0.0, 17.0}) {
      SCOPED_TRACE(testing::Message() << tilt << " deg, heading " << heading << " deg");
      const Eigen::Matrix3d turn = turn_of(tilt, heading);
      const VoxelMap map = map_of(square(turn));
      const MapSurface surface = libgtd::measure_surface(map);
      // Far from the edges of the square, whose voxels extend beyond it.
      double inner_m2 = 0.0;
      double plan_m2 = 0.0;
      double slope_deg = 0.0;
      std::size_t count = 0;
      for (std::size_t n = 0; n < map.size(); ++n) {
        const Eigen::Vector3d place = turn.transpose() * map.center_in_terrain(n);
        if (place.head<2>().minCoeff() < 0.15 || place.head<2>().maxCoeff() >= 0.45) continue;
        inner_m2 += static_cast<double>(surface.area_m2[n]);
        plan_m2 += surface.plan_area_m2(n);
        slope_deg += static_cast<double>(surface.slope_deg[n]);
        ++count;
      }
      // The number of lattice rows inside is 30 within one.
      EXPECT_NEAR(inner_m2 / 0.09, 1.0, 0.05);
      ratios += inner_m2 / 0.09;
      ++squares;
      EXPECT_NEAR(plan_m2 / inner_m2, std::cos(tilt * pi / 180), 0.01);
      EXPECT_NEAR(slope_deg / static_cast<double>(count), tilt, 0.6);
      // The number of voxels is that of a square half a voxel wider on each side.
      EXPECT_NEAR(sum_of(surface.area_m2) / (0.61 * 0.61), 1.0, 0.03);
    }
  EXPECT_NEAR(ratios / squares, 1.0, 0.015);
}

TEST(MapSurface, AreaOfAHemisphere) {
  for (const double radius : {0.1, 0.3}) {
    const auto ball = [&](double u, double v) {
      return Eigen::Vector3d(radius * std::sin(u) * std::cos(v), radius * std::sin(u) * std::sin(v),
                             radius * std::cos(u));
    };
    const VoxelMap map = map_of(voxels_of(ball, pi / 2, 2 * pi, 0.002 / radius, 0.002 / radius));
    const MapSurface surface = libgtd::measure_surface(map);
    EXPECT_NEAR(sum_of(surface.area_m2) / (2 * pi * radius * radius), 1.0, 0.02);
    double plan_m2 = 0.0;
    for (std::size_t n = 0; n < map.size(); ++n) plan_m2 += surface.plan_area_m2(n);
    EXPECT_NEAR(plan_m2 / (pi * radius * radius), 1.0, 0.05);
  }
}

TEST(MapSurface, OfACloudWithFewerPointsThanVoxels) {
  for (const double tilt : {0.0, 30.0, 60.0}) {
    std::set<Voxel> some;
    for (const Voxel& voxel : square(turn_of(tilt, 17.0)))
      if (uniform(0.0, 1.0) < 0.55) some.insert(voxel);
    EXPECT_NEAR(sum_of(libgtd::measure_surface(map_of(some)).area_m2) / (edge_m * edge_m), 1.0,
                0.04);
  }
}

TEST(MapSurface, WallsAlongTheLatticeHaveASlope) {
  std::set<Voxel> wall;
  for (int j = 0; j < 40; ++j)
    for (int k = 0; k < 40; ++k) wall.insert({7, j, k});
  const MapSurface surface = libgtd::measure_surface(map_of(wall));
  for (const float slope : surface.slope_deg) EXPECT_NEAR(slope, 90.0F, 1e-3F);
  EXPECT_NEAR(sum_of(surface.area_m2), 0.16, 0.003);
}

TEST(MapSurface, VoxelsByThemselvesAreOneFaceEach) {
  const MapSurface surface = libgtd::measure_surface(map_of({{0, 0, 0}, {500, 3, 2}}));
  EXPECT_NEAR(sum_of(surface.area_m2), 2e-4, 1e-9);
  EXPECT_TRUE(std::isnan(surface.slope_deg[0]));
  EXPECT_NEAR(surface.plan_area_m2(0), 1e-4, 1e-9);
}

TEST(MapSurface, SameForAnyNumberOfThreads) {
  const VoxelMap map = map_of(square(turn_of(33.0, 5.0)));
  const auto measured = [&](unsigned threads) {
    const libmap::ThreadLimit limit(threads);
    return libgtd::measure_surface(map);
  };
  const MapSurface one = measured(1);
  const MapSurface two = measured(2);
  EXPECT_EQ(one.area_m2, two.area_m2);
  EXPECT_EQ(one.slope_deg, two.slope_deg);
}

TEST(MapSurface, RadiusOutOfBounds) {
  for (const double radius : {-0.1, std::nan("")})
    EXPECT_EQ(error_of([&] {
                libgtd::measure_surface(map_of({{0, 0, 0}}), {.surface_radius_m = radius});
              })
                  .context()
                  .field,
              "surface_radius_m");
}

}  // namespace map_surface_test
