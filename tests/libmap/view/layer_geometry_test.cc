#include "libmap/view/layer_geometry.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/test_support.h"

namespace libmap {
namespace layer_geometry_test {

using graspmap_test::uniform;

std::vector<Eigen::Vector3d> lattice(int side, double pitch_m) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j)
      points.emplace_back(pitch_m * i, pitch_m * j, pitch_m * ((i * j) % 2));
  return points;
}

TEST(PointSpacing, KnowsALattice) {
  const PointSpacing spacing = estimate_spacing(lattice(30, 0.01));
  EXPECT_TRUE(spacing.lattice);
  EXPECT_NEAR(spacing.distance_m, 0.01, 1e-12);
  EXPECT_FALSE(spacing.gaps);
  std::vector<Eigen::Vector3d> holes = lattice(30, 0.01);
  std::erase_if(holes, [](const Eigen::Vector3d&) { return uniform(0, 1) < 0.35; });
  EXPECT_TRUE(estimate_spacing(holes).lattice);
  EXPECT_TRUE(estimate_spacing(holes).gaps);
  std::vector<Eigen::Vector3d> random;
  for (int i = 0; i < 2000; ++i) random.emplace_back(uniform(0, 1), uniform(0, 1), 0.0);
  EXPECT_FALSE(estimate_spacing(random).lattice);
  // A lattice that is turned is none for cubes along the axes.
  std::vector<Eigen::Vector3d> turned = lattice(30, 0.01);
  for (Eigen::Vector3d& point : turned)
    point = Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ()) * point;
  EXPECT_FALSE(estimate_spacing(turned).lattice);
  EXPECT_NEAR(estimate_spacing(turned).distance_m, 0.01, 1e-9);
}

TEST(PointSpacing, DegenerateClouds) {
  EXPECT_EQ(estimate_spacing({}).distance_m, 0.0);
  EXPECT_EQ(estimate_spacing({{1, 2, 3}}).distance_m, 0.0);
  EXPECT_EQ(estimate_spacing(std::vector<Eigen::Vector3d>(50, {1, 2, 3})).distance_m, 0.0);
}

TEST(PrepareLayer, LeavesOutWhatIsNotFinite) {
  PointCloud cloud;
  cloud.positions = {{0, 0, 0}, {std::nan(""), 0, 0}, {0, INFINITY, 0}, {1, 0, 0}};
  cloud.colors = {{1, 1, 1}, {2, 2, 2}, {3, 3, 3}, {4, 4, 4}};
  SceneLayer layer;
  layer.shape = cloud;
  const PreparedLayer prepared = prepare_layers(layer, Pose::Identity()).front();
  ASSERT_EQ(prepared.positions.size(), 2U);
  EXPECT_EQ(prepared.colors[1], (Color{4, 4, 4}));

  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, std::nan("")}, {7, 7, 7}};
  mesh.triangles = {{0, 1, 3}, {0, 1, 2}};
  mesh.face_fields = {{.name = "score", .type = ScalarType::float32, .values = {0.1, 0.95}}};
  layer.shape = mesh;
  const PreparedLayer faces = prepare_layers(layer, Pose::Identity()).front();
  ASSERT_EQ(faces.triangles.size(), 1U);
  ASSERT_EQ(faces.positions.size(), 3U);
  EXPECT_EQ(faces.colors[0], score_color(0.95));
  mesh.face_fields.clear();
  layer.shape = mesh;
  EXPECT_EQ(prepare_layers(layer, Pose::Identity()).front().positions.size(), 3U)
      << "a vertex of no triangle is not drawn";
}

// The zero plane is one of the terrain frame.
TEST(PrepareLayer, ColorsInTheTerrainFrame) {
  PointCloud cloud;
  cloud.positions = {{0, 0, -5}, {0, 0, 5}};
  cloud.add_field("score", ScalarType::float32).values = {1.0, 1.0};
  SceneLayer layer;
  layer.shape = cloud;
  layer.coloring.zero_plane_m = 0.0;
  const Pose upside_down = make_pose_from_rpy({0, 0, 1}, {180, 0, 0});
  const PreparedLayer prepared = prepare_layers(layer, upside_down).front();
  EXPECT_NEAR(prepared.positions[0].z(), 6.0, 1e-12);
  EXPECT_EQ(prepared.colors[0], score_color(1.0));
  EXPECT_EQ(prepared.colors[1], below_plane_color);
}

TEST(TrianglesOf, CubesShowOneSideFromAboveAndThreeFromAslant) {
  SceneLayer layer;
  PointCloud cloud;
  cloud.positions = {{0, 0, 0}};
  cloud.colors = {{200, 100, 50}};
  layer.shape = cloud;
  layer.coloring.mode = ColorMode::own;
  layer.point_shape = PointShape::cube;
  layer.point_size_m = 2.0;
  const PreparedLayer prepared = prepare_layers(layer, Pose::Identity()).front();
  const PixelRect plot{0, 0, 100, 100};
  const ColoredTriangles top = triangles_of(
      prepared, fit_camera(Viewpoint::top, {}, prepared.positions, 1.0, plot), {0, 0, 0});
  ASSERT_EQ(top.triangles.size(), 2U);
  for (const Eigen::Vector3f& vertex : top.vertices) EXPECT_EQ(vertex.z(), 1.0F);
  for (const Color& color : top.colors) EXPECT_EQ(color, (Color{200, 100, 50}));
  const ColoredTriangles aslant = triangles_of(
      prepared, fit_camera(Viewpoint::oblique, {}, prepared.positions, 2.0, plot), {0, 0, 0});
  EXPECT_EQ(aslant.triangles.size(), 6U);
  for (const Eigen::Vector3f& vertex : aslant.vertices)
    EXPECT_FLOAT_EQ(vertex.cwiseAbs().minCoeff(), 1.0F);
}

TEST(TrianglesOf, FarPointsStayVisible) {
  SceneLayer layer;
  PointCloud cloud;
  cloud.positions = {{0, 0, 0}, {1000, 0, 0}};
  layer.shape = cloud;
  layer.point_size_m = 0.001;
  const PreparedLayer prepared = prepare_layers(layer, Pose::Identity()).front();
  const SceneCamera camera =
      fit_camera(Viewpoint::top, {}, prepared.positions, 0.0, {0, 0, 100, 100});
  const ColoredTriangles triangles = triangles_of(prepared, camera, {0, 0, 0});
  const float width_m = triangles.vertices[1].x() - triangles.vertices[0].x();
  EXPECT_NEAR(width_m * camera.scale_px, 1.3, 1e-5);
}

// Coordinates far from the origin, as surveyors have them, lose nothing.
TEST(TrianglesOf, CountsFromTheGivenOrigin) {
  SceneLayer layer;
  PointCloud cloud;
  const Eigen::Vector3d far(512345.678, 4398765.432, 1234.5);
  cloud.positions = {far, far + Eigen::Vector3d(0.001, 0, 0)};
  layer.shape = cloud;
  layer.point_size_m = 0.001;
  const PreparedLayer prepared = prepare_layers(layer, Pose::Identity()).front();
  const SceneCamera camera =
      fit_camera(Viewpoint::top, {}, prepared.positions, 0.001, {0, 0, 100, 100});
  const ColoredTriangles triangles = triangles_of(prepared, camera, far);
  EXPECT_NEAR(triangles.vertices[4].x() - triangles.vertices[0].x(), 0.001, 1e-8);
}

}  // namespace layer_geometry_test
}  // namespace libmap
