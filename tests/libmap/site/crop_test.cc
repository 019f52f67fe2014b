#include "libmap/site/crop.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "libmap/core/error.h"
#include "libmap/core/parallel.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/surface_distance.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/support/lower_limit.h"
#include "tests/support/sanitizers.h"
#include "tests/support/test_support.h"

namespace libmap {
namespace crop_test {

using Eigen::Vector2d;
using Eigen::Vector3d;
using graspmap_test::error_of;
using graspmap_test::is_error;

// Flat ground of 4 x 4 m with two blocks on it, joined to the ground at their feet.
TriangleMesh site_mesh() {
  TriangleMesh mesh = graspmap_test::square_mesh(0, 2);
  const auto add_block = [&](const Vector3d& low, const Vector3d& high) {
    TriangleMesh block;
    for (int n = 0; n < 8; ++n)
      block.vertices.emplace_back((n & 1) != 0 ? high.x() : low.x(),
                                  (n & 2) != 0 ? high.y() : low.y(),
                                  (n & 4) != 0 ? high.z() : low.z());
    block.triangles = {{4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4}, {1, 3, 7},
                       {1, 7, 5}, {3, 2, 6}, {3, 6, 7}, {2, 0, 4}, {2, 4, 6}};
    mesh = graspmap_test::join_meshes(mesh, block);
  };
  add_block({0.2, 0.3, 0}, {0.9, 1.0, 0.8});
  add_block({-1.3, -1.2, 0}, {-0.5, -0.7, 0.4});
  return mesh;
}

PointCloud make_site_cloud() {
  const TriangleMesh mesh = site_mesh();
  PointCloud cloud;
  ScalarField id{"id", ScalarType::int32, {}};
  for (const SurfacePoint& sample : sample_surface(mesh, 2000, 5)) {
    id.values.push_back(static_cast<double>(cloud.size()));
    cloud.positions.push_back(sample.position);
    cloud.normals.push_back(
        area_normal(mesh, mesh.triangles[sample.triangle]).normalized().cast<float>());
  }
  cloud.fields = {id};
  return cloud;
}

const PointCloud& site_cloud() {
  static const PointCloud cloud = make_site_cloud();
  return cloud;
}

const Pose tilted = make_pose_from_rpy({2, -1, 0.7}, {4, -6, 20});

CropOptions box_options(const Vector2d& low, const Vector2d& high) {
  constexpr double open = std::numeric_limits<double>::infinity();
  CropOptions options;
  options.region = CropRegion::box;
  options.box = {{low.x(), low.y(), -open}, {high.x(), high.y(), open}};
  return options;
}

TEST(Crop, LevelledMeshAndCloud) {
  const CropMeshResult mesh = crop_mesh(transform_mesh(site_mesh(), tilted), {});
  const CropCloudResult cloud = crop_cloud(transform_cloud(site_cloud(), tilted), {});
  for (const CropReport& report : {mesh.report, cloud.report}) {
    ASSERT_TRUE(report.ground.has_value());
    const Pose site_from_site = report.site_from_map * tilted;
    EXPECT_NEAR((site_from_site.linear().col(2) - Vector3d::UnitZ()).norm(), 0, 2e-5);
    EXPECT_NEAR(site_from_site.translation().z(), 0, 1e-4);
    EXPECT_TRUE(report.outline.empty());
    // x and y stay near those of the map.
    const Vector3d middle = tilted * Vector3d(0, 0, 0);
    EXPECT_LT((report.site_from_map * middle - middle).head<2>().norm(), 0.1);
  }
  EXPECT_EQ(mesh.mesh.triangles, site_mesh().triangles);
  EXPECT_EQ(cloud.cloud.size(), site_cloud().size());
  for (std::size_t n = 0; n < cloud.cloud.size(); n += 11) {
    const Vector3d expected = cloud.report.site_from_map * (tilted * site_cloud().positions[n]);
    ASSERT_LT((cloud.cloud.positions[n] - expected).norm(), 1e-12);
  }
}

TEST(Crop, AnyRotationOfTheMapGivesTheSameSite) {
  const CropCloudResult straight = crop_cloud(site_cloud(), {});
  for (const Vector3d& rpy : {Vector3d(90, 0, 0), Vector3d(180, 0, 0), Vector3d(-70, 50, 130)}) {
    const Pose turn = make_pose_from_rpy({3, 2, 1}, rpy);
    const CropCloudResult turned = crop_cloud(transform_cloud(site_cloud(), turn), {});
    for (std::size_t n = 0; n < straight.cloud.size(); n += 7)
      ASSERT_NEAR(turned.cloud.positions[n].z(), straight.cloud.positions[n].z(), 1e-7) << rpy;
    const CropMeshResult mesh = crop_mesh(transform_mesh(site_mesh(), turn), {});
    EXPECT_NEAR((mesh.report.site_from_map * turn).linear()(2, 2), 1, 1e-9);
    EXPECT_NEAR((mesh.report.site_from_map * turn).translation().z(), 0, 1e-4);
  }
  // With a given up along the map's z, the blocks hang from the ground.
  CropOptions options;
  options.up = Vector3d(0, 0, 1);
  const Pose over = make_pose_from_rpy({0, 0, 0}, {180, 0, 0});
  const CropCloudResult hanging = crop_cloud(transform_cloud(site_cloud(), over), options);
  EXPECT_LT(bounds_of(hanging.cloud.positions).min.z(), -0.75);
}

TEST(Crop, PiecesAreCutAsTheWhole) {
  const TriangleMesh mesh = transform_mesh(site_mesh(), tilted);
  std::vector<bool> is_first(mesh.triangles.size());
  for (std::size_t t = 0; t < is_first.size(); t += 3) is_first[t] = true;
  std::vector<TriangleMesh> pieces = {select_triangles(mesh, is_first), {}};
  is_first.flip();
  pieces.push_back(select_triangles(mesh, is_first));
  const EachMesh each = [&](const UseMesh& use) {
    for (const TriangleMesh& piece : pieces) use(piece);
  };
  for (CropOptions options : {box_options({1, -2}, {3, 0}), CropOptions{}}) {
    options.center = true;
    const CropMeshResult whole = crop_mesh(mesh, options);
    std::vector<double> areas;
    std::vector<Vector3d> vertices;
    const CropReport report = crop_mesh_tiles(each, options, [&](const TriangleMesh& cut) {
      areas.push_back(surface_area(cut));
      vertices.insert(vertices.end(), cut.vertices.begin(), cut.vertices.end());
    });
    ASSERT_EQ(areas.size(), 3U);
    EXPECT_EQ(areas[1], 0.0);
    // The ground is found from different samples.
    EXPECT_NEAR(areas[0] + areas[2], surface_area(whole.mesh), 1e-4);
    EXPECT_TRUE(report.site_from_map.isApprox(whole.report.site_from_map, 1e-4));
    EXPECT_NEAR((bounds_of(vertices).max - bounds_of(whole.mesh.vertices).max).norm(), 0, 1e-3);
  }
  CropOptions beside = box_options({70, 70}, {71, 71});
  EXPECT_TRUE(is_error(error_of([&] { crop_mesh_tiles(each, beside, [](const TriangleMesh&) {}); }),
                       {.field = "mesh"}));
}

TEST(Crop, BoxInTheLevelFrame) {
  CropOptions options = box_options({1, -2}, {3, 0});
  const CropMeshResult mesh = crop_mesh(transform_mesh(site_mesh(), tilted), options);
  const Bounds3d bounds = bounds_of(mesh.mesh.vertices);
  EXPECT_EQ(bounds.min.x(), 1);
  EXPECT_EQ(bounds.max.x(), 3);
  EXPECT_EQ(bounds.min.y(), -2);
  EXPECT_EQ(bounds.max.y(), 0);
  EXPECT_EQ(mesh.report.outline.size(), 4U);
  options.center = true;
  const CropMeshResult centered = crop_mesh(transform_mesh(site_mesh(), tilted), options);
  EXPECT_EQ(bounds_of(centered.mesh.vertices).min.head<2>(), Vector2d(-1, -1));
  EXPECT_NEAR(surface_area(centered.mesh), surface_area(mesh.mesh), 1e-9);
  const Vector3d shift =
      centered.report.site_from_map.translation() - mesh.report.site_from_map.translation();
  EXPECT_LT((shift - Vector3d(-2, 1, 0)).norm(), 1e-12);
}

TEST(Crop, BoxInTheMapsFrame) {
  CropOptions options = box_options({-1, -1}, {1.5, 1});
  options.frame = CropFrame::map;
  const Pose slight = make_pose_from_rpy({0, 0, 0.5}, {10, 0, 0});
  const CropCloudResult cloud = crop_cloud(transform_cloud(site_cloud(), slight), options);
  const Pose map_from_site = cloud.report.site_from_map.inverse();
  for (const Vector3d& point : cloud.cloud.positions) {
    const Vector3d in_map = map_from_site * point;
    ASSERT_TRUE(in_map.x() > -1 - 1e-8 && in_map.x() < 1.5 + 1e-8);
    ASSERT_TRUE(std::abs(in_map.y()) < 1 + 1e-8);
  }
  const CropMeshResult mesh = crop_mesh(transform_mesh(site_mesh(), slight), options);
  const TriangleMesh back = transform_mesh(mesh.mesh, mesh.report.site_from_map.inverse());
  EXPECT_NEAR(bounds_of(back.vertices).max.y(), 1, 1e-9);
  EXPECT_NEAR(bounds_of(mesh.mesh.vertices).min.z(), 0, 2e-4);
}

TEST(Crop, NotLevelled) {
  CropOptions options = box_options({-1, -1}, {1, 1});
  options.level = false;
  const CropCloudResult cloud = crop_cloud(site_cloud(), options);
  EXPECT_FALSE(cloud.report.ground.has_value());
  EXPECT_TRUE(cloud.report.site_from_map.matrix().isIdentity(0.0));
  const std::vector<double>& ids = cloud.cloud.fields[0].values;
  for (std::size_t n = 0; n < ids.size(); ++n)
    ASSERT_EQ(cloud.cloud.positions[n], site_cloud().positions[static_cast<std::size_t>(ids[n])])
        << "not a bit is changed";
}

TEST(Crop, SizeLaysTheSidesAlongTheAxes) {
  CropOptions options;
  options.region = CropRegion::size;
  options.size_m = {3.5, 3.5};
  options.center = true;
  const CropMeshResult mesh = crop_mesh(transform_mesh(site_mesh(), tilted), options);
  const Bounds3d bounds = bounds_of(mesh.mesh.vertices);
  EXPECT_EQ(bounds.min.head<2>(), Vector2d(-1.75, -1.75));
  EXPECT_EQ(bounds.max.head<2>(), Vector2d(1.75, 1.75));
  ASSERT_TRUE(mesh.report.rectangle.has_value());
  EXPECT_NEAR(mesh.report.rectangle->yaw_deg, 20, 0.6);
  EXPECT_NEAR((mesh.report.site_from_map * tilted).translation().norm(), 0, 0.04);
  options.yaw_deg = 0;
  options.center = false;
  const CropMeshResult turned = crop_mesh(transform_mesh(site_mesh(), tilted), options);
  EXPECT_NEAR(surface_area(turned.mesh), surface_area(mesh.mesh), 0.05);
  const Vector2d side = turned.report.outline[1] - turned.report.outline[0];
  EXPECT_NEAR(std::atan2(side.y(), side.x()) * 180 / 3.14159265358979, 20, 0.6);
  EXPECT_NEAR(turned.report.site_from_map.linear()(0, 1), 0, 0.02) << "no yaw";
}

TEST(Crop, YawTurnsTheLevelFrame) {
  CropOptions options = box_options({-1, -0.5}, {1, 0.5});
  options.yaw_deg = 90;
  const CropMeshResult mesh = crop_mesh(site_mesh(), options);
  EXPECT_NEAR(mesh.report.site_from_map.linear()(1, 0), 1, 1e-9);
  const Vector3d corner = mesh.report.site_from_map * Vector3d(0, 1, 0);
  EXPECT_NEAR(corner.x(), -1, 0.03);
}

TEST(Crop, BorderOfWhiteTriangles) {
  // A fine mesh of a floor with painted colors.
  TriangleMesh mesh;
  constexpr std::uint32_t count = 250;
  const Pose map_from_site = make_pose_from_rpy({5, 6, 7}, {3, 5, -30});
  for (std::uint32_t j = 0; j <= count; ++j)
    for (std::uint32_t i = 0; i <= count; ++i) {
      const Vector2d p(5.0 * i / count - 2.5, 5.0 * j / count - 2.5);
      const double off = p.cwiseAbs().maxCoeff() - 1.5;
      const bool is_white = off > 0 && off < 0.1;
      const double rock = std::max(0.0, 0.3 - 2 * (p - Vector2d(0.4, 0.5)).norm());
      mesh.vertices.push_back(map_from_site * Vector3d(p.x(), p.y(), rock));
      mesh.vertex_colors.push_back(is_white ? Color{230, 228, 225} : Color{120, 110, 90});
    }
  for (std::uint32_t j = 0; j < count; ++j)
    for (std::uint32_t i = 0; i < count; ++i) {
      const std::uint32_t a = j * (count + 1) + i;
      mesh.triangles.push_back({a, a + 1, a + count + 2});
      mesh.triangles.push_back({a, a + count + 2, a + count + 1});
    }
  CropOptions options;
  options.region = CropRegion::border;
  options.center = true;
  const CropMeshResult cut = crop_mesh(mesh, options);
  ASSERT_TRUE(cut.report.band.has_value());
  const Bounds3d bounds = bounds_of(cut.mesh.vertices);
  EXPECT_LT((bounds.min.head<2>() - Vector2d(-1.5, -1.5)).norm(), 0.025);
  EXPECT_LT((bounds.max.head<2>() - Vector2d(1.5, 1.5)).norm(), 0.025);
  EXPECT_NEAR((cut.report.site_from_map * map_from_site).linear()(0, 0), 1, 1e-4);
}

TEST(Crop, WhatCannotBe) {
  const auto message = [](const CropOptions& options) {
    return error_of([&] { crop_cloud(site_cloud(), options); });
  };
  EXPECT_TRUE(is_error(message(box_options({50, 50}, {51, 51})), {.field = "cloud"}));
  EXPECT_TRUE(is_error(error_of([] {
                         crop_mesh(site_mesh(), box_options({50, 50}, {51, 51}));
                       }),
                       {.field = "mesh"}));
  EXPECT_TRUE(is_error(message(box_options({1, 0}, {0, 1})), {.field = "box"}));
  CropOptions options;
  options.region = CropRegion::polygon;
  options.polygon = {{0, 0}, {1, 1}};
  EXPECT_TRUE(is_error(message(options), {.field = "corners", .value = "2", .bound = ">= 3"}));
  options.region = CropRegion::border;
  EXPECT_TRUE(is_error(message(options), {.field = "colors"}));
  options = box_options({0, 0}, {1, 1});
  options.rectangle.margin_m = 0.1;
  EXPECT_TRUE(is_error(message(options), {.field = "margin_m", .value = "0.1"}));
  options = {};
  options.region = CropRegion::size;
  options.size_m = {3, 3};
  options.frame = CropFrame::map;
  EXPECT_TRUE(is_error(message(options), {.field = "frame", .value = "map"}));
  options = {};
  options.yaw_deg = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(is_error(message(options), {.field = "yaw", .value = "inf"}));
  EXPECT_TRUE(is_error(error_of([&] { crop_cloud({}, {}); }), {.field = "points of the cloud"}));
  EXPECT_TRUE(is_error(error_of([&] { crop_mesh({}, {}); }),
                       {.field = "area", .value = "0 m2", .bound = "> 0"}));
  TriangleMesh broken = site_mesh();
  broken.vertices[2].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(
      is_error(error_of([&] { crop_mesh(broken, {}); }), {.field = "corners of triangles"}));
  PointCloud with_nan = site_cloud();
  with_nan.positions[4].z() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(crop_cloud(with_nan, {}).cloud.size(), site_cloud().size() - 1);
  TriangleMesh one;
  one.vertices = {{0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
  one.triangles = {{0, 1, 2}};
  EXPECT_NEAR(crop_mesh(one, {}).mesh.vertices[1].z(), 0, 1e-9);
}

// Oblique and vertical triangles of kilometers, and coordinates at which a cell is below rounding.
TEST(Crop, TrianglesOfAnyShapeAreSeenByFewSamples) {
  CropOptions options;
  options.level = false;
  options.region = CropRegion::size;
  options.size_m = {1, 1};
  const auto message = [&](const std::vector<Vector3d>& corners, std::uint32_t copies) {
    TriangleMesh mesh;
    mesh.vertices = corners;
    mesh.triangles.assign(copies, {0, 1, 2});
    return error_of([&] { crop_mesh(mesh, options); });
  };
  const graspmap_test::LowerLimit limit(
      graspmap_test::memory_can_be_limited ? RLIMIT_DATA : RLIMIT_CORE, std::uint64_t{1} << 30U);
  EXPECT_TRUE(is_error(message({{0, 0, 0}, {1e3, 1e3, 0}, {1e3, 1e3 + 0.01, 0}}, 50),
                       {.field = "size of the data", .value = "1006 x 1007 m"}));
  EXPECT_TRUE(is_error(message({{0, 0, 0}, {1e3, 1e3, 0}, {0, 0, 1}}, 1000),
                       {.field = "size of the data", .value = "1007 x 1007 m"}));
  EXPECT_TRUE(is_error(message({{1e20, 1e20, 0}, {1e20 + 2e4, 1e20, 0}, {1e20, 1e20 + 2e4, 0}}, 1),
                       {.field = "size of the data", .value = "65995 x 65995 m"}));
}

TEST(Crop, ThreadsMakeNoDifference) {
  CropOptions options;
  options.region = CropRegion::size;
  options.size_m = {3, 3};
  const TriangleMesh mesh = transform_mesh(site_mesh(), tilted);
  const ThreadLimit one(1);
  const CropMeshResult a = crop_mesh(mesh, options);
  const ThreadLimit more(4);
  const CropMeshResult b = crop_mesh(mesh, options);
  EXPECT_EQ(a.mesh.vertices, b.mesh.vertices);
  EXPECT_EQ(a.report.site_from_map.matrix(), b.report.site_from_map.matrix());
}

TEST(Crop, RealSiteTurned) {
  GRASPMAP_REQUIRE_DATA();
  const TriangleMesh mesh =
      read_mesh(graspmap_test::data_folder() / "scans/site_ground_truth_mesh.ply").mesh;
  const Pose turn = make_pose_from_rpy({10, -4, 2}, {8, -11, 33});
  const CropMeshResult straight = crop_mesh(mesh, {});
  const CropMeshResult turned = crop_mesh(transform_mesh(mesh, turn), {});
  const Vector3d up = straight.report.site_from_map.linear().row(2);
  const Vector3d up_again =
      turn.linear().transpose() * turned.report.site_from_map.linear().row(2).transpose();
  EXPECT_LT((up - up_again).norm(), 2e-4);
  CropOptions options;
  options.region = CropRegion::size;
  options.size_m = {2.8, 2.8};
  options.center = true;
  const CropMeshResult site = crop_mesh(transform_mesh(mesh, turn), options);
  // The whole is 3 x 3 m about the origin.
  EXPECT_LT((site.report.site_from_map * turn).translation().head<2>().norm(), 0.1);
  EXPECT_NEAR(bounds_of(site.mesh.vertices).max.x(), 1.4, 1e-12);
  EXPECT_NEAR(site.report.rectangle->clearance_m, 0.1, 0.03);
}

}  // namespace crop_test
}  // namespace libmap
