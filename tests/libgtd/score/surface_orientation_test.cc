// Tests scoring with tilted masks: closed forms, invariants, an independent oracle.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <utility>

#include "libgtd/detect.h"
#include "libgtd/score/matching_loops.h"
#include "libgtd/score/tilted_matching.h"
#include "libmap/core/parallel.h"
#include "tests/libgtd/instruction_sets.h"
#include "tests/libgtd/score/score_test_support.h"

namespace libgtd {
namespace surface_orientation_test {

using Eigen::Vector3d;
using graspmap_test::bumpy_cloud;
using graspmap_test::error_of;
using graspmap_test::gripper_named;
using graspmap_test::is_error;
using graspmap_test::uniform;
using libmap::PointCloud;

DetectionOptions options_for(Orientation orientation) {
  DetectionOptions options;
  options.gripper = gripper_named("scar-e");
  options.plane = PlaneSource::none;
  options.scenario.curvature_radius_m = 0.0;
  options.scenario.zero_plane_m = -10.0;
  options.scenario.orientation = orientation;
  options.scenario.method = Method::corrected;
  return options;
}

DetectionResult score(const PointCloud& cloud, Orientation orientation) {
  return detect(cloud, options_for(orientation));
}

// Rotated by `angle_deg` about y.
PointCloud turned(const PointCloud& cloud, double angle_deg) {
  return libmap::transform_cloud(cloud,
                                 libmap::make_pose_from_rpy({0, 0, 0}, {0.0, angle_deg, 0.0}));
}

// Height field over a square, rotated in its plane so that no row is along the lattice.
template <typename Height>
PointCloud ground(double half_m, double spacing_m, const Height& height) {
  PointCloud cloud;
  const Eigen::Rotation2Dd turn(0.3);
  for (double u = -half_m; u <= half_m; u += spacing_m)
    for (double v = -half_m; v <= half_m; v += spacing_m) {
      const Eigen::Vector2d p = turn * Eigen::Vector2d(u, v);
      cloud.positions.emplace_back(p.x(), p.y(), height(p.x(), p.y()));
      cloud.normals.emplace_back(0.0F, 0.0F, 1.0F);  // only the side matters
    }
  return cloud;
}

double bump(double x, double y) {
  return std::max(0.0, 0.06 * (1.0 - (x * x + y * y) / (0.1 * 0.1)));
}

TEST(SurfaceOrientation, TiltedPlaneCountsAsLevelGroundAtAnyAngle) {
  const PointCloud level = ground(0.25, 0.005, [](double, double) { return 0.003; });
  const GripperMask mask = make_gripper_mask(gripper_named("scar-e"), {});
  // The plane fills the top layer only: every square with the edge of a voxel contains a point.
  std::uint32_t solid = 0;
  for (int x = 0; x < mask.side; ++x)
    for (int y = 0; y < mask.side; ++y) solid += mask.is_solid(x, y, mask.pivot_z) ? 1U : 0U;
  const auto area = static_cast<std::uint32_t>(mask.side * mask.side);
  for (const double angle : {0.0, 20.0, 45.0, 60.0, 90.0, 130.0, 180.0}) {
    const auto result = score(turned(level, angle), Orientation::surface);
    int inside = 0;
    for (const MapVoxel& one : result.map.voxels) {
      if (result.map.lattice.center_of(one.voxel).norm() > 0.06) continue;
      ++inside;
      EXPECT_EQ(one.counts.ssv, area) << angle;
      EXPECT_EQ(one.counts.gsv, solid) << angle;
      EXPECT_DOUBLE_EQ(one.score, static_cast<double>(solid) / area) << angle;
      const double radians = angle * std::numbers::pi / 180.0;
      EXPECT_NEAR(one.normal.x(), std::sin(radians), 1e-5);
      EXPECT_NEAR(one.normal.z(), std::cos(radians), 1e-5);
    }
    EXPECT_GT(inside, 100);
  }
}

TEST(SurfaceOrientation, LevelGroundIsEvaluatedAsByTheUprightMask) {
  PointCloud cloud;
  for (int n = 0; n < 4000; ++n) {
    cloud.positions.emplace_back(uniform(-0.3, 0.3), uniform(-0.3, 0.3), 0.0041);
    cloud.normals.emplace_back(0.0F, 0.0F, 1.0F);
  }
  const auto plane = score(cloud, Orientation::plane);
  const auto surface = score(cloud, Orientation::surface);
  ASSERT_EQ(plane.map.voxels.size(), surface.map.voxels.size());
  EXPECT_GT(plane.border_voxels, 100U);
  EXPECT_LT(plane.border_voxels, plane.map.voxels.size());
  for (std::size_t n = 0; n < plane.map.voxels.size(); ++n) {
    EXPECT_EQ(plane.map.voxels[n].counts, surface.map.voxels[n].counts);
    EXPECT_EQ(plane.map.voxels[n].border, surface.map.voxels[n].border);
  }
}

// Oracle by definition, point by point, with another formula of the rotation.
VoxelCounts counts_by_hand(const PointCloud& cloud, const VoxelLattice& lattice,
                           const GripperMask& mask, const MapVoxel& one) {
  const Vector3d normal = one.normal.cast<double>().normalized();
  Vector3d mean = Vector3d::Zero();
  double count = 0.0;
  for (const Vector3d& p : cloud.positions)
    if (lattice.voxel_of(p) == one.voxel) {
      mean += p;
      count += 1.0;
    }
  const Vector3d center = lattice.center_of(one.voxel);
  const Vector3d anchor = center + normal * normal.dot(mean / count - center);
  const auto turn = Eigen::Quaterniond::FromTwoVectors(normal, Vector3d::UnitZ());
  std::set<std::array<int, 3>> occupied;
  for (const Vector3d& p : cloud.positions) {
    const Vector3d cell = (turn * (p - anchor) / lattice.voxel_size_m).array() + 0.5;
    const std::array<int, 3> at = {static_cast<int>(std::floor(cell.x())) + mask.pivot_xy,
                                   static_cast<int>(std::floor(cell.y())) + mask.pivot_xy,
                                   static_cast<int>(std::floor(cell.z())) + mask.pivot_z};
    if (std::min({at[0], at[1], at[2]}) >= 0 && std::max(at[0], at[1]) < mask.side &&
        at[2] < mask.layers)
      occupied.insert(at);
  }
  VoxelCounts counts;
  for (const auto& [x, y, z] : occupied) {
    counts.ssv += mask.is_counted(x, y, z) ? 1U : 0U;
    counts.gsv += mask.is_counted(x, y, z) && mask.is_solid(x, y, z) ? 1U : 0U;
  }
  return counts;
}

PointCloud rough_boulder() {
  PointCloud cloud;
  for (int n = 0; n < 9000; ++n) {
    const Vector3d way =
        Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)).normalized().eval();
    const double radius =
        0.2 + 0.03 * std::sin(9 * way.x()) * std::cos(7 * way.z()) + uniform(-0.003, 0.003);
    cloud.positions.push_back(radius * way);
    cloud.normals.push_back(way.cast<float>());
  }
  return cloud;
}

TEST(SurfaceOrientation, AgreesWithTheDefinitionPointByPoint) {
  const PointCloud cloud = rough_boulder();
  for (const Method method : {Method::corrected, Method::climblab}) {
    DetectionOptions options = options_for(Orientation::surface);
    options.scenario.method = method;
    const auto result = detect(cloud, options);
    ASSERT_GT(result.map.voxels.size(), 50U);
    const std::size_t step = std::max<std::size_t>(1, result.map.voxels.size() / 60);
    for (std::size_t n = 0; n < result.map.voxels.size(); n += step) {
      const MapVoxel& one = result.map.voxels[n];
      EXPECT_EQ(one.counts, counts_by_hand(cloud, result.map.lattice, result.mask, one));
    }
  }
}

TEST(SurfaceOrientation, BallScoresTheSameAtAnyLatitude) {
  PointCloud ball;  // Fibonacci's lattice
  const int count = 16000;
  for (int n = 0; n < count; ++n) {
    const double z = 1.0 - (2.0 * n + 1.0) / count;
    const double turn = n * std::numbers::pi * (3.0 - std::sqrt(5.0));
    const Vector3d way(std::sqrt(1 - z * z) * std::cos(turn), std::sqrt(1 - z * z) * std::sin(turn),
                       z);
    ball.positions.push_back(0.2 * way);
    ball.normals.push_back(way.cast<float>());
  }
  const auto means = [&](Orientation orientation) {
    const auto result = score(ball, orientation);
    // There is nothing around the ball, and no position of the mask square misses it.
    if (orientation == Orientation::surface) {
      EXPECT_EQ(result.border_voxels, 0U);
    }
    std::array<double, 6> sums{}, counts{};
    for (const MapVoxel& one : result.map.voxels) {
      const Vector3d place = result.map.lattice.center_of(one.voxel).normalized();
      const auto band =
          static_cast<std::size_t>(std::min(5.0, std::acos(place.z()) / std::numbers::pi * 6.0));
      sums[band] += one.score;
      counts[band] += 1.0;
    }
    for (std::size_t band = 0; band < 6; ++band) sums[band] /= counts[band];
    return sums;
  };
  const auto surface = means(Orientation::surface);
  for (const double mean : surface) EXPECT_NEAR(mean, surface[0], 0.02);
  const auto plane = means(Orientation::plane);
  EXPECT_GT(
      *std::max_element(plane.begin(), plane.end()) - *std::min_element(plane.begin(), plane.end()),
      0.2);
}

TEST(SurfaceOrientation, BumpOnAVerticalWallIsGraspable) {
  const PointCloud level = ground(0.35, 0.005, bump);
  const PointCloud wall = turned(level, 90.0);  // faces +x
  const auto best_at = [](const DetectionResult& result, const Vector3d& place) {
    double best = 0.0;
    for (const MapVoxel& one : result.map.voxels)
      if ((result.map.lattice.center_of(one.voxel) - place).norm() < 0.015)
        best = std::max(best, one.score);
    return best;
  };
  const double on_ground = best_at(score(level, Orientation::plane), {0, 0, 0.06});
  const double tilted = best_at(score(wall, Orientation::surface), {0.06, 0, 0});
  const double upright = best_at(score(wall, Orientation::plane), {0.06, 0, 0});
  EXPECT_GE(on_ground, 0.8);
  EXPECT_GE(tilted, 0.8);
  EXPECT_LT(upright, 0.8);
  // The wall beside it is as flat as the ground.
  EXPECT_LT(best_at(score(wall, Orientation::surface), {0.0, 0.2, 0.0}), 0.4);
}

TEST(SurfaceOrientation, TurnedTerrainIsEvaluatedAlike) {
  const PointCloud cloud = rough_boulder();
  const libmap::Pose turn = libmap::make_pose_from_rpy({0.4, -1.2, 0.3}, {35.0, 70.0, -110.0});
  const auto first = score(cloud, Orientation::surface);
  const auto second = score(libmap::transform_cloud(cloud, turn), Orientation::surface);
  std::map<Voxel, double> scores;
  for (const MapVoxel& one : second.map.voxels) scores[one.voxel] = one.score;
  double sum = 0.0, count = 0.0;
  std::map<Voxel, double> of_first;
  for (const MapVoxel& one : first.map.voxels) of_first[one.voxel] = one.score;
  for (const Vector3d& point : cloud.positions) {
    const double here = of_first.at(first.map.lattice.voxel_of(point));
    const double there = scores.at(second.map.lattice.voxel_of(turn * point));
    sum += std::abs(here - there);
    count += 1.0;
  }
  EXPECT_LT(sum / count, 0.05);
}

// A position without a plane has no slope, and NaN is not equal to itself.
PointCloud with_comparable_slopes(PointCloud map) {
  for (double& slope : map.find_field("slope_deg")->values)
    if (std::isnan(slope)) slope = -1.0;
  return map;
}

TEST(SurfaceOrientation, TilesThreadsAndSharesChangeNothing) {
  PointCloud cloud = rough_boulder();
  const PointCloud floor = bumpy_cloud(0.7, 0.009);
  cloud.positions.insert(cloud.positions.end(), floor.positions.begin(), floor.positions.end());
  cloud.normals.insert(cloud.normals.end(), floor.size(), Eigen::Vector3f::UnitZ());
  DetectionOptions options = options_for(Orientation::surface);
  options.scenario.curvature_radius_m = 0.05;
  options.scenario.obstacle_height_m = 0.1;
  const auto map_with = [&](double tile_size_m, unsigned threads) {
    options.scenario.tile_size_m = tile_size_m;
    const libmap::ThreadLimit limit(threads);
    return with_comparable_slopes(to_cloud(detect(cloud, options).map, MapFrame::terrain));
  };
  const PointCloud expected = map_with(10.0, 1);
  ASSERT_TRUE(expected.has_normals());
  ASSERT_NE(expected.find_field("obstacle"), nullptr);
  for (const auto& [size, threads] : {std::pair{0.07, 2U}, {0.31, 8U}}) {
    const PointCloud other = map_with(size, threads);
    EXPECT_EQ(other.fields, expected.fields);
    EXPECT_EQ(other.normals, expected.normals);
  }
}

TEST(SurfaceOrientation, PlacesWithoutANormalAreEvaluatedUpright) {
  PointCloud cloud = ground(0.2, 0.005, [](double, double) { return 0.003; });
  cloud.normals.clear();
  cloud.positions.emplace_back(0.0, 0.0, 0.5);  // alone: no plane
  const auto plane = score(cloud, Orientation::plane);
  const auto surface = score(cloud, Orientation::surface);
  EXPECT_EQ(surface.unoriented_voxels, 1U);
  for (std::size_t n = 0; n < plane.map.voxels.size(); ++n)
    if (plane.map.voxels[n].voxel.k > 10) {
      EXPECT_EQ(plane.map.voxels[n].counts, surface.map.voxels[n].counts);
      EXPECT_EQ(surface.map.voxels[n].normal, Eigen::Vector3f::UnitZ());
    }
}

// Air above the top of a wall is not an edge; the end of the wall is.
TEST(SurfaceOrientation, EdgesAreWhereTheScanEnds) {
  PointCloud cloud;  // floor, a wall that faces -x, a plateau
  const auto add = [&](double x, double y, double z, const Eigen::Vector3f& normal) {
    cloud.positions.emplace_back(x, y, z);
    cloud.normals.push_back(normal);
  };
  for (double y = -0.4; y <= 0.4; y += 0.006) {
    for (double s = 0.003; s < 0.5; s += 0.006) {
      add(-s, y, 0.004, Eigen::Vector3f::UnitZ());
      add(s, y, 0.304, Eigen::Vector3f::UnitZ());
    }
    for (double z = 0.005; z < 0.303; z += 0.006) add(0.004, y, z, -Eigen::Vector3f::UnitX());
  }
  const auto result = score(cloud, Orientation::surface);
  int middle = 0, end = 0;
  for (const MapVoxel& one : result.map.voxels) {
    const Vector3d place = result.map.lattice.center_of(one.voxel);
    if (std::abs(place.x()) > 0.02 || place.z() < 0.1 || place.z() > 0.29) continue;
    if (std::abs(place.y()) < 0.2) {
      EXPECT_FALSE(one.border) << place.transpose();
      ++middle;
    }
    if (std::abs(place.y()) > 0.33) {
      EXPECT_TRUE(one.border) << place.transpose();
      ++end;
    }
  }
  EXPECT_GT(middle, 100);
  EXPECT_GT(end, 50);
}

TEST(SurfaceOrientation, AxesAreTheShortestTurn) {
  EXPECT_EQ(tilted_axes(Vector3d::UnitZ()), Eigen::Matrix3d::Identity());
  EXPECT_EQ(tilted_axes(-Vector3d::UnitZ()).col(2), -Vector3d::UnitZ());
  for (int n = 0; n < 200; ++n) {
    Vector3d normal = Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)).normalized();
    if (n < 20) normal = Vector3d(1e-7 * n, 1e-9, -1.0).normalized();
    const Eigen::Matrix3d axes = tilted_axes(normal);
    EXPECT_TRUE((axes * axes.transpose()).isApprox(Eigen::Matrix3d::Identity(), 1e-9));
    EXPECT_NEAR(axes.determinant(), 1.0, 1e-9);
    EXPECT_TRUE(axes.col(2).isApprox(normal, 1e-12));
    // A rotation about an axis in the plane; the trace determines its angle.
    if (n >= 20) {
      EXPECT_NEAR(axes.trace(), 1.0 + 2.0 * normal.z(), 1e-9);
    }
  }
}

TEST(SurfaceOrientation, AllInstructionSetsYieldTheSame) {
  std::array<std::vector<double>, 3> points;
  const std::size_t count = 1003;
  for (auto& axis : points)
    for (std::size_t n = 0; n < count + MatchingLoops::lanes; ++n)
      axis.push_back(n < count ? std::floor(uniform(-20.0, 20.0) * 4.0) / 4.0
                               : std::numeric_limits<double>::infinity());
  const double* const axes[3] = {points[0].data(), points[1].data(), points[2].data()};
  const TiltedBox box{{-5, -5, -3}, {11, 11, 9}, {11, 1, 121}};
  for (const Vector3d& normal : {Vector3d(0, 0, 1), Vector3d(0.6, 0.0, 0.8), Vector3d(0, 1, 0)}) {
    TiltedLattice lattice{{0.5, -0.25, 1.0}, {}};
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) lattice.axes[a][b] = tilted_axes(normal)(b, a);
    std::vector<std::vector<int>> found;
    for (const auto instructions : graspmap_test::instruction_sets()) {
      std::vector<int> cells(count + MatchingLoops::lanes);
      cells.resize(
          matching_loops_of(instructions).find_cells(axes, count, lattice, box, cells.data()));
      found.push_back(std::move(cells));
      EXPECT_EQ(found.back(), found.front());
    }
    EXPECT_GT(found.front().size(), 5U);
  }
}

TEST(SurfaceOrientation, MethodsOfTheProgramAreRefused) {
  for (const Method method : {Method::thesis, Method::envelope}) {
    DetectionOptions options = options_for(Orientation::surface);
    options.scenario.method = method;
    const libmap::Error error = error_of([&] { detect(bumpy_cloud(0.3, 0.01), options); });
    EXPECT_TRUE(is_error(
        error,
        {.field = "orientation", .value = "surface", .about = std::string(name_of(method))}));
  }
}

}  // namespace surface_orientation_test
}  // namespace libgtd
