// Terrain from points: rendering in squares equals rendering the whole surface.
#include "libmap/simulate/terrain_surface.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include "libmap/core/parallel.h"
#include "libmap/core/random_stream.h"
#include "libmap/simulate/terrain_tiles.h"
#include "tests/support/test_support.h"

namespace terrain_surface_test {

using graspmap_test::scratch_folder;
using libmap::GroundHeights;
using libmap::PointCloud;
using libmap::PointTileStore;
using libmap::Pose;
using libmap::SurfaceView;
using libmap::TerrainSurface;
using libmap::TriangleMesh;
using libmap::VisibleSurface;

// Points about `spacing` apart, one in each square of a grid.
template <typename Height>
PointCloud grid(const Eigen::Vector2d& low, const Eigen::Vector2d& high, double spacing,
                const Height& height) {
  PointCloud cloud;
  libmap::RandomStream random(7, 0);
  for (double x = low.x(); x < high.x() - 1e-9; x += spacing)
    for (double y = low.y(); y < high.y() - 1e-9; y += spacing) {
      const double px = x + spacing * random.uniform(0.2, 0.8);
      const double py = y + spacing * random.uniform(0.2, 0.8);
      cloud.positions.emplace_back(px, py, height(px, py));
    }
  return cloud;
}

double wave(double x, double y) { return 0.2 * std::sin(2.0 * x) + 0.1 * std::cos(3.0 * y); }

struct Ground {
  GroundHeights heights;
  PointTileStore points{scratch_folder(), {.tile_m = GroundHeights::cell_m}};

  explicit Ground(const PointCloud& cloud) {
    heights.add(cloud.positions);
    points.add(cloud);
    points.finish();
  }
};

// A camera's optical frame that looks along `heading` and down.
Pose looking(const Eigen::Vector3d& from, double heading_deg, double down_deg) {
  Pose base = libmap::make_pose_from_rpy(from, {0.0, down_deg, heading_deg});
  Eigen::Matrix3d optical;
  optical << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  base.linear() = base.linear() * optical;
  return base;
}

libmap::ViewRays small_rays() {
  return libmap::make_view_rays(
      {.width = 40, .height = 32, .fx = 30, .fy = 30, .cx = 19.5, .cy = 15.5});
}

using Corners = std::array<std::array<double, 3>, 3>;
std::map<Corners, int> triangles_of(const TriangleMesh& mesh) {
  std::map<Corners, int> found;
  for (const libmap::Triangle& t : mesh.triangles) {
    Corners corners;
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3d& p = mesh.vertices[t[k]];
      corners[k] = {p.x(), p.y(), p.z()};
    }
    std::sort(corners.begin(), corners.end());
    ++found[corners];
  }
  return found;
}

TEST(TriangulatePlan, NeighborsHaveTheSameTrianglesAtTheirBorderAndLeaveNoGap) {
  const PointCloud cloud = grid({0, 0}, {4, 2}, 0.05, wave);
  const double radius = 0.15;
  const auto part = [&](double from, double to) {
    const Eigen::AlignedBox2d rectangle(Eigen::Vector2d(from, 0.5), Eigen::Vector2d(to, 1.5));
    std::vector<Eigen::Vector3d> near;
    for (const Eigen::Vector3d& p : cloud.positions)
      if (rectangle.exteriorDistance(Eigen::Vector2d(p.head<2>())) <= 4 * radius) near.push_back(p);
    return libmap::triangulate_plan(near, rectangle, radius);
  };
  const auto left = triangles_of(part(1.0, 2.0));
  const auto right = triangles_of(part(2.0, 3.0));
  const auto both = triangles_of(part(1.0, 3.0));
  auto joined = left;
  std::size_t shared = 0;
  for (const auto& [corners, count] : right) shared += !joined.emplace(corners, count).second;
  EXPECT_EQ(joined, both);
  EXPECT_GT(shared, 20U);
  // Their plan covers the rectangle: signed areas, and normals up.
  const TriangleMesh mesh = part(1.0, 3.0);
  double area = 0.0;
  for (const libmap::Triangle& t : mesh.triangles) {
    EXPECT_GT(libmap::area_normal(mesh, t).z(), 0.0);
    area += 0.5 * libmap::area_normal(mesh, t).z();
  }
  EXPECT_GT(area, 2.0);
  EXPECT_LT(area, 2.2 * 1.2);
  for (const Eigen::Vector3f& normal : mesh.vertex_normals) EXPECT_NEAR(normal.norm(), 1.0F, 1e-5F);
}

TEST(TriangulatePlan, WideGapsStayOpen) {
  PointCloud cloud = grid({0, 0}, {2, 2}, 0.05, [](double, double) { return 0.0; });
  std::erase_if(cloud.positions, [](const Eigen::Vector3d& p) {
    return (p.head<2>() - Eigen::Vector2d(1, 1)).norm() < 0.4;
  });
  const Eigen::AlignedBox2d all(Eigen::Vector2d(0, 0), Eigen::Vector2d(2, 2));
  const TriangleMesh mesh = libmap::triangulate_plan(cloud.positions, all, 0.15);
  EXPECT_NEAR(libmap::surface_area(mesh), 4.0 - std::numbers::pi * 0.16, 0.25);
  EXPECT_TRUE(libmap::triangulate_plan({{0, 0, 0}, {1, 0, 0}}, all, 0.15).triangles.empty());
  EXPECT_TRUE(libmap::triangulate_plan({}, all, 0.15).triangles.empty());
}

TEST(GroundHeights, MeansSpacingAndExtent) {
  GroundHeights heights;
  EXPECT_TRUE(heights.empty());
  EXPECT_EQ(heights.height({0, 0}), 0.0);
  heights.add(grid({0, 0}, {6, 4}, 0.05, [](double x, double) { return 0.5 * x; }).positions);
  EXPECT_NEAR(heights.spacing_m(), 0.05, 1e-9);
  EXPECT_NEAR(heights.height({3.0, 2.0}), 1.5, 1e-3);
  EXPECT_NEAR(heights.height({100.0, 2.0}), 1.5, 1e-3);
  const Eigen::AlignedBox3d box =
      heights.extent({Eigen::Vector2d(1.1, 1.1), Eigen::Vector2d(1.4, 2.4)});
  EXPECT_NEAR(box.min().z(), 0.5, 0.05);
  EXPECT_NEAR(box.max().z(), 0.75, 0.05);
  EXPECT_NEAR(box.max().y(), 2.5, 0.05);
  EXPECT_TRUE(heights.extent({Eigen::Vector2d(7, 0), Eigen::Vector2d(8, 1)}).isEmpty());
}

TEST(TerrainSurface, SlopeIsSeenAtItsDepth) {
  const auto slope = [](double x, double y) { return 0.3 * x - 0.2 * y; };
  const Ground ground(grid({-3, -3}, {5, 3}, 0.04, slope));
  TerrainSurface terrain(ground.points, ground.heights, {.tile_spacings = 32.0});
  const libmap::ViewRays rays = small_rays();
  const Pose pose = looking({0, 0, 1.2}, 20, 50);
  const auto surfaces = terrain.seen_from({{pose}}, libmap::view_range(rays, 3.0));
  ASSERT_EQ(surfaces.size(), 1U);
  const SurfaceView view = surfaces[0].view(rays, pose);
  std::size_t seen = 0;
  for (std::size_t n = 0; n < rays.centers.size(); ++n) {
    const Eigen::Vector3d ray = pose.linear() * rays.centers[n].homogeneous();
    const double exact = -1.2 / (ray.z() - slope(ray.x(), ray.y()));
    if (!(exact > 0.0 && exact < 3.0)) continue;
    ++seen;
    EXPECT_NEAR(static_cast<double>(view.depth.pixels[n]), exact, 1e-6);
  }
  EXPECT_GT(seen, 1000U);
}

TEST(TerrainSurface, StreamedIsWholeWhateverWasSeenBefore) {
  libmap::TerrainTilesOptions options;
  options.size_x_m = options.size_y_m = options.tile_m = 6.0;
  options.spacing_m = 0.04;
  const PointCloud cloud = libmap::sample_tile(options, {0, 0});
  const Ground ground(cloud);
  const Eigen::AlignedBox2d all(Eigen::Vector2d(-1, -1), Eigen::Vector2d(7, 7));
  const double radius = 5.0 * ground.heights.spacing_m();
  const VisibleSurface whole(libmap::triangulate_plan(cloud.positions, all, radius),
                             libmap::TextureSource::rock, 1, libmap::ShadingNormals::per_vertex);
  const libmap::ViewRays rays = small_rays();
  const double far_m = 2.5;
  TerrainSurface fleeting(ground.points, ground.heights, {.tile_spacings = 24.0, .kept_points = 0});
  TerrainSurface keeping(ground.points, ground.heights, {.tile_spacings = 24.0});
  std::size_t compared = 0;
  std::size_t wrong = 0;
  for (int n = 0; n < 8; ++n) {
    const Pose pose = looking({1.0 + 0.5 * n, 3.0, 1.5}, 45.0 * n, 55.0);
    const libmap::ViewRange range = libmap::view_range(rays, far_m);
    const SurfaceView one = fleeting.seen_from({{pose}}, range)[0].view(rays, pose);
    const SurfaceView other = keeping.seen_from({{pose}}, range)[0].view(rays, pose);
    EXPECT_EQ(one.depth, other.depth);
    EXPECT_EQ(one.corner_depth, other.corner_depth);
    EXPECT_EQ(one.color.pixels, other.color.pixels);
    const SurfaceView truth = whole.view(rays, pose);
    for (std::size_t p = 0; p < truth.depth.pixels.size(); ++p) {
      if (truth.depth.pixels[p] == 0.0F || truth.depth.pixels[p] > 2.5F) continue;
      ++compared;
      wrong += std::abs(one.depth.pixels[p] - truth.depth.pixels[p]) > 1e-6F;
      wrong += std::abs(one.incidence_cos.pixels[p] - truth.incidence_cos.pixels[p]) > 1e-5F;
    }
  }
  EXPECT_GT(compared, 5000U);
  EXPECT_EQ(wrong, 0U);
  EXPECT_GT(fleeting.tiles_made(), keeping.tiles_made());
}

TEST(TerrainSurface, MemoryDoesNotGrowWithTheGround) {
  const auto most_points = [](double length_m) {
    const Ground ground(grid({0, 0}, {length_m, 4}, 0.05, wave));
    TerrainSurface terrain(ground.points, ground.heights,
                           {.tile_spacings = 20.0, .kept_points = 5000});
    const libmap::ViewRays rays = small_rays();
    std::size_t most = 0;
    for (double x = 0.0; x < length_m - 2.0; x += 0.5) {
      terrain.seen_from({{looking({x, 2.0, 1.2}, 0.0, 45.0)}}, libmap::view_range(rays, 2.5));
      most = std::max(most, terrain.points_in_memory());
    }
    EXPECT_GT(terrain.tiles_made(), static_cast<std::size_t>(2.0 * length_m));
    return most;
  };
  const std::size_t of_short = most_points(8.0);
  EXPECT_LT(most_points(24.0), 1.1 * static_cast<double>(of_short));
  // Little more than twice what is seen at once.
  EXPECT_LT(of_short, 20'000U);
}

}  // namespace terrain_surface_test
