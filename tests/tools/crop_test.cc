#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "libmap/core/manifest.h"
#include "libmap/core/pose.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "libmap/mesh/mesh_parts.h"
#include "tests/tools/tool_test_support.h"

namespace crop_test {

using Eigen::Vector3d;
using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::names_in_scratch;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::write_text;
using graspmap_test::wrong_usage;
using Words = std::vector<std::string>;

const libmap::Pose map_from_ground = libmap::make_pose_from_rpy({1, 2, 3}, {5, -3, 15});

// Ground of 2 x 2 m in quads of 2 cm with a bump, tilted in the map.
void write_mesh_map() {
  libmap::TriangleMesh mesh;
  constexpr std::uint32_t count = 100;
  for (std::uint32_t j = 0; j <= count; ++j)
    for (std::uint32_t i = 0; i <= count; ++i) {
      const double x = 0.02 * i - 1;
      const double y = 0.02 * j - 1;
      const double bump = std::max(0.0, 0.2 - std::hypot(x - 0.3, y));
      mesh.vertices.push_back(map_from_ground * Vector3d(x, y, bump));
      mesh.vertex_colors.push_back({200, 100, static_cast<std::uint8_t>(i)});
    }
  for (std::uint32_t j = 0; j < count; ++j)
    for (std::uint32_t i = 0; i < count; ++i) {
      const std::uint32_t a = j * (count + 1) + i;
      mesh.triangles.push_back({a, a + 1, a + count + 2});
      mesh.triangles.push_back({a, a + count + 2, a + count + 1});
    }
  mesh.face_fields = {
      {"filled", libmap::ScalarType::uint8, std::vector<double>(mesh.triangles.size(), 1.0)}};
  libmap::write_mesh(scratch("map.ply"), mesh);
}

// The vertices of the same as a cloud.
void write_cloud_map() {
  write_mesh_map();
  const libmap::TriangleMesh mesh = libmap::read_mesh(scratch("map.ply")).mesh;
  libmap::PointCloud cloud;
  cloud.positions = mesh.vertices;
  cloud.colors = mesh.vertex_colors;
  cloud.add_field("views", libmap::ScalarType::uint16).values[7] = 9;
  libmap::write_cloud(scratch("map.pcd"), cloud);
}

libmap::Pose transform_of(const std::string& output) {
  const auto manifest = libmap::read_manifest_of(scratch(output));
  EXPECT_TRUE(manifest && manifest->find_transform("site_from_map"));
  return *manifest->find_transform("site_from_map");
}

TEST(Crop, MeshIsLevelledAndCut) {
  write_mesh_map();
  ASSERT_TRUE(
      succeeded(graspmap({"crop", "map.ply", "--size", "1x1.5", "--center", "-o", "site.ply"})));
  const libmap::TriangleMesh site = libmap::read_mesh(scratch("site.ply")).mesh;
  const libmap::Bounds3d bounds = libmap::bounds_of(site.vertices);
  EXPECT_EQ(bounds.min.head<2>(), Eigen::Vector2d(-0.5, -0.75));
  EXPECT_EQ(bounds.max.head<2>(), Eigen::Vector2d(0.5, 0.75));
  EXPECT_NEAR(bounds.min.z(), 0, 1e-4);
  EXPECT_EQ(site.vertex_colors.size(), site.vertices.size());
  ASSERT_EQ(site.face_fields.size(), 1U);
  EXPECT_EQ(site.face_fields[0].name, "filled");
  const nlohmann::json manifest = json_of("site.ply.json");
  EXPECT_EQ(manifest.at("frame"), "site");
  EXPECT_NEAR(manifest.at("results").at("ground_tilt_deg"), 5.83, 0.02);
  EXPECT_NEAR(manifest.at("results").at("outline_area_m2"), 1.5, 1e-9);
  EXPECT_GT(manifest.at("results").at("ground_share"), 0.7);
  EXPECT_EQ(manifest.at("results").at("triangles"), site.triangles.size());
  EXPECT_EQ(manifest.at("parameters").at("size"), "1x1.5");
}

TEST(Crop, TransformStandsBesideTheOutput) {
  write_cloud_map();
  ASSERT_TRUE(
      succeeded(graspmap({"crop", "map.pcd", "--box", "0.5,1.5,1.5,2.5", "-o", "site.csv"})));
  EXPECT_EQ(names_in_scratch(),
            (Words{"map.pcd", "map.ply", "site.csv", "site.csv.json", "site.site_from_map.txt"}));
  std::istringstream text(content("site.site_from_map.txt"));
  Eigen::Matrix4d matrix;
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) text >> matrix(row, column);
  EXPECT_TRUE(text.good());
  EXPECT_EQ(matrix, transform_of("site.csv").matrix()) << "the same to the last bit";
  // The transform maps the map's points to those of the site.
  const libmap::PointCloud map = libmap::read_cloud(scratch("map.pcd")).cloud;
  const libmap::PointCloud site = libmap::read_cloud(scratch("site.csv")).cloud;
  const libmap::Pose site_from_map = transform_of("site.csv");
  std::size_t inside = 0;
  for (const Vector3d& point : map.positions) {
    const Vector3d p = site_from_map * point;
    inside += p.x() >= 0.5 && p.x() <= 1.5 && p.y() >= 1.5 && p.y() <= 2.5 ? 1U : 0U;
  }
  EXPECT_EQ(site.size(), inside);
  EXPECT_NE(site.find_field("views"), nullptr);
  // Once more over its own output, and with another cut.
  ASSERT_TRUE(succeeded(graspmap({"crop", "map.pcd", "-o", "site.csv"})));
}

TEST(Crop, CroppedTwiceLeadsFromTheFirstMap) {
  write_cloud_map();
  ASSERT_TRUE(succeeded(graspmap({"crop", "map.pcd", "--center", "-o", "first.ply"})));
  ASSERT_TRUE(succeeded(graspmap(
      {"crop", "first.ply", "--box=-0.5,-0.5,0.5,0.5", "--yaw", "30", "-o", "second.ply"})));
  const libmap::PointCloud map = libmap::read_cloud(scratch("map.pcd")).cloud;
  const libmap::PointCloud second = libmap::read_cloud(scratch("second.ply")).cloud;
  const libmap::Pose site_from_map = transform_of("second.ply");
  ASSERT_GT(second.size(), 100U);
  for (std::size_t n = 0; n < second.size(); n += 37) {
    double nearest = 1e9;
    for (const Vector3d& point : map.positions)
      nearest = std::min(nearest, (site_from_map * point - second.positions[n]).norm());
    ASSERT_LT(nearest, 1e-6);
  }
}

TEST(Crop, Polygons) {
  write_mesh_map();
  write_text(scratch("outline.csv"),
             "name,x,y\na,0.5,1.5\nb,1.5,1.5\nc,1.0,2.0\nd,1.5,2.5\ne,0.5,2.5\n");
  ASSERT_TRUE(
      succeeded(graspmap({"crop", "map.ply", "--polygon", "outline.csv", "-o", "site.ply"})));
  EXPECT_NEAR(json_of("site.ply.json").at("results").at("outline_area_m2"), 0.75, 1e-9);
  const libmap::TriangleMesh site = libmap::read_mesh(scratch("site.ply")).mesh;
  double twice = 0;
  for (const libmap::Triangle& triangle : site.triangles)
    twice += libmap::area_normal(site, triangle).z();
  EXPECT_NEAR(twice / 2, 0.75, 1e-6) << "single precision in the file";
  EXPECT_EQ(json_of("site.ply.json").at("inputs").size(), 2U);
  const auto with = [](const std::string& text) {
    write_text(scratch("outline.csv"), text);
    return graspmap({"crop", "map.ply", "--polygon", "outline.csv", "-o", "new.ply"});
  };
  EXPECT_TRUE(
      bad_input(with("x,y\n0,0\n1,1\n"),
                {.file = "outline.csv", .field = "corners", .value = "2", .bound = ">= 3"}));
  EXPECT_TRUE(bad_input(
      with("x,y\n"), {.file = "outline.csv", .field = "corners", .value = "0", .bound = ">= 3"}));
  EXPECT_TRUE(bad_input(with(""), {.file = "outline.csv"}));
  EXPECT_TRUE(
      bad_input(with("x,z\n0,0\n1,0\n1,1\n"), {.file = "outline.csv", .field = "column 'y'"}));
  EXPECT_TRUE(bad_input(with("x,y\n0,0\n1,one\n1,1\n"),
                        {.file = "outline.csv", .field = "row 2, column 'y'", .value = "'one'"}));
  EXPECT_TRUE(bad_input(with("x,y\n0,0\n1,nan\n1,1\n"),
                        {.file = "outline.csv", .field = "corner 2", .value = "(1, nan)"}));
  EXPECT_TRUE(bad_input(with("x,y\n0,0\n1,1\n1,0\n0,1\n"),
                        {.file = "outline.csv",
                         .field = "edge from (0, 0) to (1, 1)",
                         .value = "meeting the edge from (1, 0) to (0, 1)"}));
  EXPECT_TRUE(bad_input(with("x,y\n50,50\n51,50\n51,51\n"), {.file = "map.ply"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("new.ply")));
  EXPECT_FALSE(std::filesystem::exists(scratch("new.site_from_map.txt")));
}

TEST(Crop, SamePlaceForMeshAndCloudAndAnyThreads) {
  write_cloud_map();
  for (const std::string file : {"map.ply", "map.pcd"}) {
    ASSERT_TRUE(
        succeeded(graspmap({"crop", file, "--size", "1x1", "--threads", "1", "-o", "a.ply"})));
    ASSERT_TRUE(
        succeeded(graspmap({"crop", file, "--size", "1x1", "--threads", "3", "-o", "b.ply"})));
    EXPECT_EQ(content("a.ply"), content("b.ply"));
    EXPECT_EQ(content("a.site_from_map.txt"), content("b.site_from_map.txt"));
    const libmap::Pose ground_from_ground = transform_of("a.ply") * map_from_ground;
    EXPECT_NEAR(ground_from_ground.translation().z(), 0, 1e-4);
    EXPECT_NEAR(ground_from_ground.linear()(2, 2), 1, 1e-7);
  }
}

TEST(Crop, DryRunWritesNothing) {
  write_mesh_map();
  ASSERT_TRUE(succeeded(graspmap({"crop", "map.ply", "--dry-run", "-o", "site.ply"})));
  EXPECT_EQ(names_in_scratch(), (Words{"map.ply"}));
}

TEST(Crop, BadInput) {
  write_mesh_map();
  const auto with = [](const Words& more) {
    Words words = {"crop", "map.ply", "-o", "new.ply"};
    words.insert(words.end(), more.begin(), more.end());
    return graspmap(words);
  };
  EXPECT_TRUE(bad_input(with({"--box", "1,2,3"}), {.field = "--box", .value = "1,2,3"}));
  EXPECT_TRUE(bad_input(with({"--level", "none", "--up", "1,0,0", "--box", "0,0,1,1"}),
                        {.field = "--up", .value = "1,0,0", .about = "--level"}));
  EXPECT_TRUE(bad_input(with({"--box", "1,2,3,4,5"}), {.field = "--box", .value = "1,2,3,4,5"}));
  EXPECT_TRUE(bad_input(with({"--box", "1,2,0,3"}), {.field = "--box", .value = "1,2,0,3"}));
  EXPECT_TRUE(bad_input(with({"--box", "nan,0,1,1"}), {.field = "--box", .value = "nan,0,1,1"}));
  EXPECT_TRUE(bad_input(with({"--size", "3"}),
                        {.file = "map.ply", .field = "size", .value = "3.00 x 3.00 m"}));
  EXPECT_TRUE(bad_input(with({"--size", "0x3"}), {.field = "--size", .value = "0x3"}));
  EXPECT_TRUE(bad_input(with({"--size", "1xtwo"}), {.field = "--size", .value = "1xtwo"}));
  EXPECT_TRUE(bad_input(with({"--size", "1x1", "--border"}), {.about = "--border"}));
  EXPECT_TRUE(bad_input(with({"--border"}), {.file = "map.ply",
                                             .field = "visible share of the side",
                                             .value = "0 %",
                                             .bound = ">= 40 %"}));
  EXPECT_TRUE(bad_input(with({"--level", "none"}), {.field = "--level", .value = "none"}));
  EXPECT_TRUE(bad_input(with({"--level", "some"}),
                        {.field = "--level", .value = "some", .bound = "one of auto none"}));
  EXPECT_TRUE(bad_input(with({"--yaw", "left"}), {.field = "--yaw", .value = "left"}));
  EXPECT_TRUE(
      bad_input(with({"--up", "0,0"}), {.field = "--up", .value = "0,0", .bound = "X,Y,Z"}));
  EXPECT_TRUE(bad_input(with({"--up", "0,0,0"}), {.file = "map.ply", .field = "up"}));
  EXPECT_TRUE(
      bad_input(with({"--up", "1,0,0"}), {.file = "map.ply",
                                          .field = "share of the points on the largest plane",
                                          .value = "0.0 %",
                                          .bound = ">= 5.0 %"}));
  EXPECT_TRUE(bad_input(with({"--plane-tolerance", "0"}),
                        {.field = "--plane-tolerance", .value = "0", .bound = "> 0"}));
  EXPECT_TRUE(bad_input(with({"--margin", "0.1"}),
                        {.file = "map.ply", .field = "margin_m", .value = "0.1"}));
  EXPECT_TRUE(bad_input(graspmap({"crop", "map.ply", "-o", "new.pcd"}),
                        {.file = "new.pcd",
                         .field = "extension",
                         .value = ".pcd",
                         .bound = ".ply, .obj, .stl, .off, .glb or .vtp"}));
  EXPECT_TRUE(bad_input(graspmap({"crop", "map.ply", "-o", "map.ply"}), {.file = "map.ply"}));
  EXPECT_TRUE(bad_input(graspmap({"crop", "none.ply", "-o", "new.ply"}), {.file = "none.ply"}));
  EXPECT_TRUE(wrong_usage(graspmap({"crop", "map.ply"}), {"--output"}));
  EXPECT_EQ(names_in_scratch(), (Words{"map.ply"}));
  // A file of the user has the name of the transform's file.
  write_text(scratch("new.site_from_map.txt"), "mine");
  EXPECT_TRUE(bad_input(with({}), {.file = "new.site_from_map.txt", .about = "--force"}));
  EXPECT_EQ(content("new.site_from_map.txt"), "mine");
  EXPECT_TRUE(succeeded(with({"--force"})));
  // The transform is of an earlier run whose site was removed.
  std::filesystem::remove(scratch("new.ply"));
  EXPECT_TRUE(succeeded(with({})));
}

// A white band around 1.2 x 1 m that is measured too large by 0.8 %.
TEST(Crop, BorderOfKnownSizeGivesTheScale) {
  libmap::PointCloud map;
  for (double x = -1; x <= 1; x += 0.008)
    for (double y = -1; y <= 1; y += 0.008) {
      const double off = std::max(std::abs(x) - 1.008 * 0.6, std::abs(y) - 1.008 * 0.5);
      map.positions.push_back(map_from_ground * Vector3d(x, y, 0));
      map.colors.push_back(off > 0 && off < 0.08 ? libmap::Color{230, 228, 225}
                                                 : libmap::Color{120, 110, 90});
    }
  libmap::write_cloud(scratch("map.pcd"), map);
  const auto with = [](const std::string& output, const Words& more) {
    Words words = {"crop", "map.pcd", "-o", output};
    words.insert(words.end(), more.begin(), more.end());
    return graspmap(words);
  };
  const auto result = with("site.ply", {"--border", "--border-size", "1x1.2", "--margin", "0.05"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_NE(result.standard_error.find("--scale 0.99"), std::string::npos) << result.standard_error;
  const nlohmann::json results = json_of("site.ply.json").at("results");
  EXPECT_NEAR(results.at("border_scale"), 1 / 1.008, 0.004);
  EXPECT_LT(results.at("border_scale_deviation"), 0.004);
  EXPECT_EQ(results.at("border_sides_m").size(), 4U);
  EXPECT_NEAR(results.at("outline_area_m2"), (1.2096 - 0.1) * (1.008 - 0.1), 0.01) << "not scaled";
  EXPECT_TRUE(bad_input(with("new.ply", {"--border", "--border-size", "3x3"}),
                        {.file = "map.pcd", .field = "border_size", .value = "3x3"}));
  EXPECT_TRUE(bad_input(with("new.ply", {"--border", "--border-size", "0x3"}),
                        {.field = "--border-size", .value = "0x3"}));
  EXPECT_TRUE(bad_input(with("new.ply", {"--border-size", "1x1.2"}),
                        {.field = "--border-size", .value = "1x1.2"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("new.ply")));
}

TEST(Crop, PointsOfTheMapAreFoundOnTheScoredSite) {
  libmap::write_cloud(scratch("map.pcd"),
                      libmap::transform_cloud(graspmap_test::bumpy_terrain(), map_from_ground));
  ASSERT_TRUE(succeeded(graspmap({"crop", "map.pcd", "--size", "0.5x0.5", "-o", "site.pcd"})));
  ASSERT_TRUE(succeeded(graspmap({"convert", "site.pcd", "-o", "site.ply"})));
  EXPECT_EQ(transform_of("site.ply").matrix(), transform_of("site.pcd").matrix());
  // Three locations on the ground in the map's frame, and one outside the site.
  std::ostringstream points;
  points << "x,y,z\n";
  for (const Vector3d& place :
       {Vector3d(0, 0, 0), Vector3d(0.15, -0.1, 0), Vector3d(-0.2, 0.2, 0), Vector3d(2, 2, 0)}) {
    const Vector3d p = map_from_ground * place;
    points << p.x() << "," << p.y() << "," << p.z() << "\n";
  }
  write_text(scratch("points.csv"), points.str());
  for (const std::string frame : {"terrain", "input"}) {
    const std::string map = frame + ".pcd";
    ASSERT_TRUE(succeeded(
        graspmap({"score", "site.ply", "--curvature-radius", "0", "--frame", frame, "-o", map})));
    EXPECT_EQ(transform_of(map).matrix().isIdentity(1e-9), false);
    ASSERT_TRUE(succeeded(
        graspmap({"lookup", map, "points.csv", "--points-frame", "map", "-o", frame + ".csv"})));
    const std::string answers = content(frame + ".csv");
    std::istringstream lines(answers);
    std::string line;
    std::getline(lines, line);
    for (const char* found : {"1", "1", "1", "0"}) {
      std::getline(lines, line);
      std::istringstream cells(line);
      std::string cell;
      for (int n = 0; n < 4; ++n) std::getline(cells, cell, ',');
      EXPECT_EQ(cell, found) << line;
    }
    EXPECT_TRUE(
        succeeded(graspmap({"render", map, "--points", "points.csv", "--points-frame", "map",
                            "--width", "64", "--height", "64", "-o", frame + ".png"})));
  }
  // The results do not depend on the frame of the map.
  EXPECT_EQ(json_of("terrain.csv.json").at("results").at("found"), 3);
}

TEST(Crop, PointsOfAMapThatWasNotCropped) {
  graspmap_test::write_terrain();
  ASSERT_TRUE(
      succeeded(graspmap({"score", "terrain.pcd", "--curvature-radius", "0", "-o", "map.pcd"})));
  write_text(scratch("points.csv"), "x,y,z\n0,0,0\n");
  EXPECT_TRUE(bad_input(
      graspmap({"lookup", "map.pcd", "points.csv", "--points-frame", "map", "-o", "out.csv"}),
      {.file = "map.pcd", .field = "--points-frame", .value = "map"}));
  EXPECT_TRUE(bad_input(graspmap({"render", "terrain.pcd", "--points", "points.csv",
                                  "--points-frame", "map", "-o", "out.png"}),
                        {.file = "terrain.pcd", .field = "--points-frame", .value = "map"}));
}

TEST(Crop, SiteAgainstTheMapItCameFrom) {
  write_mesh_map();
  ASSERT_TRUE(
      succeeded(graspmap({"crop", "map.ply", "--size", "1x1.5", "--center", "-o", "site.ply"})));
  const auto compared = [](const Words& words) {
    const auto result = graspmap(words);
    EXPECT_TRUE(succeeded(result));
    return nlohmann::json::parse(result.standard_output);
  };
  // Both ways, to the single precision of the files.
  EXPECT_LT(
      compared({"compare", "site.ply", "map.ply", "--transform", "crop", "--json"}).at("max_m"),
      2e-6);
  EXPECT_LT(compared({"compare", "map.ply", "site.ply", "--transform", "crop", "--json", "--box",
                      "-0.5,-0.75,-1,0.5,0.75,1"})
                .at("max_m"),
            2e-6);
  EXPECT_TRUE(bad_input(graspmap({"compare", "map.ply", "map.ply", "--transform", "crop"}),
                        {.file = "map.ply", .field = "--transform", .value = "crop"}));
  const nlohmann::json check = compared(
      {"compare", "--edges", "site.ply", "--truth", "map.ply", "--truth-frame", "map", "--json"});
  EXPECT_LT(check.at("max_m"), 2e-6);
  EXPECT_TRUE(bad_input(
      graspmap({"compare", "--edges", "map.ply", "--truth", "map.ply", "--truth-frame", "map"}),
      {.file = "map.ply", .field = "--truth-frame", .value = "map"}));
}

}  // namespace crop_test
