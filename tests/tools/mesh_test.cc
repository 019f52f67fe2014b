#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "libmap/core/triangle_mesh.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "tests/tools/tool_test_support.h"

namespace mesh_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::data_folder;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::warned;
using ::testing::HasSubstr;
using Words = std::vector<std::string>;

// A ball of 0.2 m, colored, a point about each 12 mm.
libmap::PointCloud ball(bool with_normals) {
  libmap::PointCloud cloud;
  constexpr int count = 3500;
  for (int n = 0; n < count; ++n) {
    const double z = 1 - (2 * n + 1.0) / count;
    const double angle = n * std::numbers::pi * (3 - std::sqrt(5.0));
    const double r = std::sqrt(1 - z * z);
    const Eigen::Vector3d out(r * std::cos(angle), r * std::sin(angle), z);
    cloud.positions.push_back(0.2 * out);
    if (with_normals) cloud.normals.push_back(out.cast<float>());
    cloud.colors.push_back({90, 120, 150});
  }
  return cloud;
}

void write_ball(const libmap::PointCloud& cloud) {
  libmap::write_cloud(scratch("ball.ply"), cloud);
}

TEST(Mesh, BallBecomesAWatertightSurface) {
  write_ball(ball(true));
  const auto result = graspmap({"mesh", "ball.ply", "-o", "mesh.ply", "--report"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_THAT(result.standard_output, HasSubstr("watertight: yes\n"));
  EXPECT_THAT(result.standard_output, HasSubstr("genus: 0\n"));
  EXPECT_THAT(result.standard_output, HasSubstr("boundaries: 0\n"));
  EXPECT_THAT(result.standard_output, HasSubstr("self_intersections: 0\n"));
  const libmap::TriangleMesh mesh = libmap::read_mesh(scratch("mesh.ply")).mesh;
  EXPECT_NEAR(libmap::signed_volume(mesh), 4.0 / 3 * std::numbers::pi * 0.008, 0.0003);
  EXPECT_EQ(mesh.vertex_colors.at(0), (libmap::Color{90, 120, 150}));
  EXPECT_EQ(mesh.vertex_normals.size(), mesh.vertices.size());
  const nlohmann::json results = json_of("mesh.ply.json").at("results");
  EXPECT_EQ(results.at("points"), 3500);
  EXPECT_EQ(results.at("watertight"), true);
  EXPECT_EQ(results.at("triangles"), mesh.triangles.size());
  EXPECT_LT(results.at("cloud_to_mesh_rmse_m"), 0.001);
  EXPECT_EQ(results.at("cell_size_m"), results.at("spacing_m"));
}

TEST(Mesh, ReportAsJson) {
  write_ball(ball(true));
  const auto result = graspmap({"mesh", "ball.ply", "-o", "mesh.ply", "--json"});
  ASSERT_TRUE(succeeded(result));
  const auto report = nlohmann::json::parse(result.standard_output);
  EXPECT_EQ(report.at("manifold"), true);
  EXPECT_EQ(report.at("components"), 1);
  EXPECT_TRUE(report.at("boundary_lengths_m").empty());
}

TEST(Mesh, MissingNormalsAreEstimatedAndItIsSaid) {
  write_ball(ball(false));
  const auto result = graspmap({"mesh", "ball.ply", "-o", "mesh.ply"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_GT(libmap::signed_volume(libmap::read_mesh(scratch("mesh.ply")).mesh), 0.03);
  EXPECT_EQ(json_of("mesh.ply.json").at("results").at("normals_oriented_by"),
            "a minimum spanning tree");
  EXPECT_TRUE(
      bad_input(graspmap({"mesh", "ball.ply", "-o", "mesh.ply", "--normals", "cloud", "--quiet"}),
                {.file = "ball.ply", .field = "--normals", .value = "cloud"}));
}

// As Open3D, PCL and a PCA leave them.
TEST(Mesh, NormalsWithoutSidesAreOriented) {
  libmap::PointCloud cloud = ball(true);
  for (std::size_t n = 0; n < cloud.size(); n += 2) cloud.normals[n] = -cloud.normals[n];
  write_ball(cloud);
  const auto result = graspmap({"mesh", "ball.ply", "-o", "mesh.ply"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_TRUE(warned(result, {"ball.ply", "normals"}));
  const nlohmann::json results = json_of("mesh.ply.json").at("results");
  EXPECT_GT(results.at("opposing_normals"), 0.4);
  EXPECT_EQ(results.at("normals_oriented_by"), "a minimum spanning tree");
  EXPECT_TRUE(bad_input(graspmap({"mesh", "ball.ply", "-o", "as_is.ply", "--normals", "cloud"}),
                        {.file = "ball.ply",
                         .field = "share of neighbors with normals on opposite sides",
                         .value = "83.7 %",
                         .bound = "<= 40 %",
                         .about = "--normals"}));
}

TEST(Mesh, NormalsThatAreAllZero) {
  libmap::PointCloud cloud = ball(true);
  for (Eigen::Vector3f& normal : cloud.normals) normal.setZero();
  write_ball(cloud);
  EXPECT_TRUE(bad_input(
      graspmap({"mesh", "ball.ply", "-o", "mesh.ply"}),
      {.file = "ball.ply", .field = "normals", .value = "all zero or NaN", .about = "--normals"}));
  ASSERT_TRUE(succeeded(graspmap({"mesh", "ball.ply", "-o", "mesh.ply", "--normals", "estimate"})));
}

TEST(Mesh, SameBytesForAnyNumberOfThreads) {
  write_ball(ball(false));
  ASSERT_TRUE(succeeded(graspmap({"mesh", "ball.ply", "-o", "one.ply", "--threads", "1"})));
  ASSERT_TRUE(succeeded(graspmap({"mesh", "ball.ply", "-o", "four.ply", "--threads", "4"})));
  ASSERT_TRUE(
      succeeded(graspmap({"mesh", "ball.ply", "-o", "omp.ply"}, {{"OMP_NUM_THREADS", "8"}})));
  EXPECT_EQ(content("one.ply"), content("four.ply"));
  EXPECT_EQ(content("one.ply"), content("omp.ply"));
}

TEST(Mesh, CloudsThatAreTooThin) {
  libmap::PointCloud line;
  for (int n = 0; n < 50; ++n) line.positions.emplace_back(0.01 * n, 0, 0);
  libmap::write_cloud(scratch("line.ply"), line);
  EXPECT_TRUE(
      bad_input(graspmap({"mesh", "line.ply", "-o", "mesh.ply", "--quiet"}), {.file = "line.ply"}));
  line.normals.assign(50, Eigen::Vector3f::UnitZ());
  libmap::write_cloud(scratch("line.ply"), line);
  EXPECT_TRUE(bad_input(graspmap({"mesh", "line.ply", "-o", "mesh.ply"}),
                        {.file = "line.ply", .field = "number of distinct points", .value = "50"}));
  libmap::write_cloud(scratch("empty.ply"), {});
  EXPECT_TRUE(bad_input(graspmap({"mesh", "empty.ply", "-o", "mesh.ply"}),
                        {.file = "empty.ply", .field = "points of the cloud"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("mesh.ply")));
}

TEST(Mesh, CloudsWithoutASurface) {
  libmap::PointCloud sheet;
  for (const double x : {0.0, 0.01})
    for (const double y : {0.0, 0.01}) sheet.positions.emplace_back(x, y, 0);
  sheet.normals.assign(4, Eigen::Vector3f::UnitZ());
  libmap::write_cloud(scratch("sheet.ply"), sheet);
  EXPECT_TRUE(bad_input(
      graspmap({"mesh", "sheet.ply", "-o", "mesh.ply", "--quiet", "--trim-distance-cells", "0.1"}),
      {.file = "sheet.ply", .field = "trim_distance_cells", .value = "0.1"}));
  sheet.positions.insert(sheet.positions.end(), sheet.positions.begin(), sheet.positions.end());
  sheet.normals.insert(sheet.normals.end(), 4, -Eigen::Vector3f::UnitZ());
  libmap::write_cloud(scratch("both.ply"), sheet);
  EXPECT_TRUE(
      bad_input(graspmap({"mesh", "both.ply", "-o", "mesh.ply", "--quiet"}), {.file = "both.ply"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("mesh.ply")));
}

TEST(Mesh, BadOptions) {
  write_ball(ball(true));
  EXPECT_TRUE(bad_input(graspmap({"mesh", "ball.ply", "-o", "mesh.pcd"}),
                        {.file = "mesh.pcd",
                         .field = "extension",
                         .value = ".pcd",
                         .bound = ".ply, .obj, .stl, .off, .glb or .vtp"}));
  EXPECT_TRUE(
      bad_input(graspmap({"mesh", "ball.ply", "-o", "ball.ply", "--force"}), {.file = "ball.ply"}));
  EXPECT_TRUE(bad_input(graspmap({"mesh", "none.ply", "-o", "mesh.ply"}), {.file = "none.ply"}));
  EXPECT_TRUE(bad_input(graspmap({"mesh", "ball.ply", "-o", "mesh.ply", "--cell-size", "-1"}),
                        {.field = "--cell-size", .value = "-1", .bound = ">= 0"}));
  EXPECT_TRUE(bad_input(graspmap({"mesh", "ball.ply", "-o", "mesh.ply", "--cell-size", "1e-6"}),
                        {.file = "ball.ply",
                         .field = "cell_size_m",
                         .value = "1e-06",
                         .bound = ">= 0.0028893955 m"}));
  EXPECT_EQ(graspmap_test::names_in_scratch(), std::vector<std::string>{"ball.ply"});
}

TEST(Mesh, DryRunWritesNothing) {
  write_ball(ball(true));
  ASSERT_TRUE(succeeded(graspmap({"mesh", "ball.ply", "-o", "mesh.ply", "--dry-run"})));
  EXPECT_EQ(graspmap_test::names_in_scratch(), std::vector<std::string>{"ball.ply"});
}

TEST(Mesh, RealScanLiesNearTheTrueSurface) {
  GRASPMAP_REQUIRE_DATA();
  const std::string scan = data_folder() / "scans" / "site_full.db";
  ASSERT_TRUE(succeeded(graspmap({"fuse", scan, "--poses", "stored", "--frame", "ground-truth",
                                  "--voxel-size", "0.02", "-o", "cloud.ply"})));
  const auto result =
      graspmap({"mesh", "cloud.ply", "-o", "mesh.ply", "--cell-size", "0.02", "--report"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_THAT(result.standard_output, HasSubstr("manifold: yes\n"));
  EXPECT_THAT(result.standard_output, HasSubstr("self_intersections: 0\n"));
  const auto compared =
      graspmap({"compare", "mesh.ply", data_folder() / "scans/site_ground_truth_mesh.ply",
                "--transform=0,0,0,0,0,-90", "--box=-1.5,-1.5,-1,1.5,1.5,2", "--json"});
  ASSERT_TRUE(succeeded(compared));
  const auto distances = nlohmann::json::parse(compared.standard_output);
  EXPECT_LT(distances.at("rmse_m"), 0.0045);
  EXPECT_LT(distances.at("median_m"), 0.0015);
}

}  // namespace mesh_test
