#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "libmap/camera/image_codec.h"
#include "libmap/core/pose.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "tests/tools/tool_test_support.h"

namespace compare_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::names_in_scratch;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::warned;
using Words = std::vector<std::string>;

// A square of 1 m at z = 0, and a grid of points over its left half, 3 mm above, one 30 mm.
void write_square_and_points() {
  libmap::TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  libmap::write_mesh(scratch("square.ply"), mesh);
  libmap::PointCloud cloud;
  for (int x = 0; x <= 50; ++x)
    for (int y = 0; y <= 100; ++y) cloud.positions.emplace_back(0.01 * x, 0.01 * y, 0.003);
  cloud.positions[0].z() = 0.03;
  cloud.add_field("views", libmap::ScalarType::uint16);
  libmap::write_cloud(scratch("points.ply"), cloud);
}

nlohmann::json compared(const Words& more) {
  Words words = {"compare", "points.ply", "square.ply", "--json"};
  words.insert(words.end(), more.begin(), more.end());
  const auto result = graspmap(words);
  EXPECT_TRUE(succeeded(result));
  return nlohmann::json::parse(result.standard_output);
}

TEST(Compare, DistancesAndCompleteness) {
  write_square_and_points();
  const nlohmann::json json = compared({});
  EXPECT_EQ(json.at("points"), 51 * 101);
  EXPECT_NEAR(json.at("median_m"), 0.003, 1e-8);
  EXPECT_NEAR(json.at("p95_m"), 0.003, 1e-8);
  EXPECT_NEAR(json.at("max_m"), 0.03, 1e-8);
  EXPECT_NEAR(json.at("rmse_m"), std::sqrt((5150 * 9e-6 + 9e-4) / 5151), 1e-8);
  // The left half and as far beyond as 10 mm in space reach along the surface.
  EXPECT_NEAR(json.at("completeness"), 0.5 + std::sqrt(1e-4 - 9e-6), 0.003);
  EXPECT_NEAR(compared({"--within", "0.0025"}).at("completeness"), 0.0, 1e-9);
  EXPECT_TRUE(names_in_scratch() == (std::vector<std::string>{"points.ply", "square.ply"}));
}

// Points 1, 2 and 3 mm above the square, each with an expected error of 1.4 mm.
TEST(Compare, SharesWithinStatedDeviations) {
  write_square_and_points();
  EXPECT_FALSE(compared({}).contains("within_one_deviation"));
  libmap::PointCloud cloud;
  for (int x = 0; x < 30; ++x) cloud.positions.emplace_back(0.03 * x, 0.5, 0.001 * (1 + x % 3));
  cloud.add_field("expected_error", libmap::ScalarType::float32).values.assign(30, 0.0014);
  cloud.fields.back().values[0] = 0.0009;  // beyond one, within two
  libmap::write_cloud(scratch("points.ply"), cloud);
  const nlohmann::json json = compared({});
  EXPECT_NEAR(json.at("within_one_deviation"), 9.0 / 30.0, 1e-9);
  EXPECT_NEAR(json.at("within_two_deviations"), 20.0 / 30.0, 1e-9);
}

TEST(Compare, TransformAndBox) {
  write_square_and_points();
  const nlohmann::json moved = compared({"--transform=1,0,-0.003,0,0,90"});
  EXPECT_NEAR(moved.at("median_m"), 0, 1e-8) << "turned about z it lies over the square again";
  EXPECT_NEAR(moved.at("completeness"), 0.51, 0.01);
  const nlohmann::json boxed = compared({"--box=0.1,0.1,-1,0.2,0.2,1"});
  EXPECT_NEAR(static_cast<double>(boxed.at("points")), 121, 22);  // points on the border
  EXPECT_EQ(boxed.at("completeness"), 1.0);
  EXPECT_NEAR(static_cast<double>(boxed.at("surface_samples")), 200, 60);
}

TEST(Compare, CloudWithDistances) {
  write_square_and_points();
  ASSERT_TRUE(succeeded(graspmap(
      {"compare", "points.ply", "square.ply", "--transform", "0,0,1,0,0,0", "-o", "out.ply"})));
  const libmap::PointCloud cloud = libmap::read_cloud(scratch("out.ply")).cloud;
  ASSERT_NE(cloud.find_field("distance"), nullptr);
  EXPECT_NE(cloud.find_field("views"), nullptr) << "its own fields stay";
  EXPECT_NEAR(cloud.find_field("distance")->values[1], 1.003, 1e-6);
  EXPECT_NEAR(cloud.positions[1].z(), 1.003, 1e-6);
  const nlohmann::json manifest = json_of("out.ply.json");
  EXPECT_EQ(manifest.at("parameters").at("transform"), "0,0,1,0,0,0");
  EXPECT_NEAR(manifest.at("results").at("median_m"), 1.003, 1e-6);
}

// A bumpy square of 1 m, its corners as points of the cloud `hills.ply` of the same name.
libmap::TriangleMesh hills() {
  constexpr std::uint32_t n = 41;
  libmap::TriangleMesh mesh;
  for (std::uint32_t y = 0; y < n; ++y)
    for (std::uint32_t x = 0; x < n; ++x) {
      const double u = static_cast<double>(x) / (n - 1);
      const double v = static_cast<double>(y) / (n - 1);
      mesh.vertices.emplace_back(u, v, 0.06 * std::sin(9 * u + 1) * std::cos(7 * v));
    }
  for (std::uint32_t y = 0; y + 1 < n; ++y)
    for (std::uint32_t x = 0; x + 1 < n; ++x) {
      const std::uint32_t a = y * n + x;
      mesh.triangles.push_back({a, a + 1, a + n});
      mesh.triangles.push_back({a + 1, a + n + 1, a + n});
    }
  return mesh;
}

nlohmann::json compared_as_json(Words words) {
  words.insert(words.begin(), "compare");
  words.emplace_back("--json");
  const auto result = graspmap(words);
  EXPECT_TRUE(succeeded(result));
  return nlohmann::json::parse(result.standard_output);
}

TEST(Compare, SignedDistancesAndBothWays) {
  write_square_and_points();
  const nlohmann::json json = compared({});
  EXPECT_EQ(json.at("a_kind"), "cloud");
  EXPECT_EQ(json.at("b_kind"), "mesh");
  EXPECT_NEAR(json.at("bias_m"), (5150 * 0.003 + 0.03) / 5151, 1e-8);
  EXPECT_NEAR(json.at("precision"), 5150.0 / 5151, 1e-12) << "all but the one at 30 mm";
  const nlohmann::json below = compared({"--transform=0,0,-0.006,0,0,0"});
  EXPECT_NEAR(below.at("bias_m"), (5150 * -0.003 + 0.024) / 5151, 1e-8);
  EXPECT_NEAR(below.at("median_m"), 0.003, 1e-8);
  ASSERT_TRUE(succeeded(graspmap(
      {"compare", "points.ply", "square.ply", "--transform=0,0,-0.006,0,0,0", "-o", "out.ply"})));
  const libmap::PointCloud cloud = libmap::read_cloud(scratch("out.ply")).cloud;
  EXPECT_NEAR(cloud.find_field("signed_distance")->values[1], -0.003, 1e-8);
  EXPECT_NEAR(cloud.find_field("distance")->values[1], 0.003, 1e-8);
}

TEST(Compare, MeshIsSampledByAreaNotByItsVertices) {
  // One square of two triangles against one 2 mm above whose left half has all the vertices.
  libmap::TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0.002}, {1, 0, 0.002}, {1, 1, 0.012}, {0, 1, 0.012}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  libmap::write_mesh(scratch("tilted.ply"), mesh);
  write_square_and_points();
  const nlohmann::json json = compared_as_json({"tilted.ply", "square.ply"});
  EXPECT_EQ(json.at("a_kind"), "mesh");
  EXPECT_EQ(json.at("points"), 20001) << "20000 a square meter, 5e-5 of it for the tilt";
  // z is uniform from 2 to 12 mm.
  EXPECT_NEAR(json.at("mean_m"), 0.007, 5e-5);
  EXPECT_NEAR(json.at("rmse_m"), std::sqrt(0.007 * 0.007 + 1e-4 / 12), 5e-5);
  EXPECT_NEAR(json.at("p95_m"), 0.0115, 2e-5);
  EXPECT_NEAR(json.at("precision"), 0.8, 0.005);
  EXPECT_NEAR(json.at("completeness"), 0.8, 0.005);
  EXPECT_EQ(json, compared_as_json({"tilted.ply", "square.ply", "--threads", "1"}));
  EXPECT_NE(json.at("mean_m"),
            compared_as_json({"tilted.ply", "square.ply", "--seed", "2"}).at("mean_m"));
  EXPECT_EQ(compared_as_json({"tilted.ply", "square.ply", "--samples-per-m2", "100"}).at("points"),
            101);
  // A mesh that covers a part alone.
  mesh.vertices = {{0, 0, 0}, {0.5, 0, 0}, {0.5, 1, 0}, {0, 1, 0}};
  libmap::write_mesh(scratch("left.ply"), mesh);
  const nlohmann::json left = compared_as_json({"left.ply", "square.ply"});
  EXPECT_EQ(left.at("precision"), 1.0);
  EXPECT_NEAR(left.at("completeness"), 0.51, 0.004);
}

TEST(Compare, CloudAsReference) {
  libmap::PointCloud reference;
  for (int x = 0; x <= 100; ++x)
    for (int y = 0; y <= 100; ++y) reference.positions.emplace_back(0.01 * x, 0.01 * y, 0.0);
  libmap::write_cloud(scratch("bare.ply"), reference);
  reference.normals.assign(reference.size(), {0, 0, 1});
  libmap::write_cloud(scratch("oriented.ply"), reference);
  libmap::PointCloud cloud;
  for (int n = 0; n < 1000; ++n)
    cloud.positions.emplace_back(graspmap_test::uniform(0.1, 0.9), graspmap_test::uniform(0.1, 0.9),
                                 -0.002);
  libmap::write_cloud(scratch("cloud.ply"), cloud);
  const nlohmann::json oriented = compared_as_json({"cloud.ply", "oriented.ply"});
  EXPECT_NEAR(oriented.at("mean_m"), 0.002, 1e-7) << "gaps do not count";
  EXPECT_NEAR(oriented.at("max_m"), 0.002, 1e-7);
  EXPECT_NEAR(oriented.at("bias_m"), -0.002, 1e-7);
  EXPECT_EQ(oriented.at("surface_samples"), 101 * 101);
  const nlohmann::json bare = compared_as_json({"cloud.ply", "bare.ply"});
  EXPECT_TRUE(bare.at("bias_m").is_null());
  // To the nearest point of a lattice: 4 mm along it on the mean.
  EXPECT_NEAR(bare.at("mean_m"), 0.0045, 3e-4);
  ASSERT_TRUE(succeeded(graspmap({"compare", "cloud.ply", "bare.ply", "-o", "out.ply"})));
  EXPECT_EQ(libmap::read_cloud(scratch("out.ply")).cloud.find_field("signed_distance"), nullptr);
}

TEST(Compare, IcpFindsTheMotion) {
  const libmap::TriangleMesh mesh = hills();
  libmap::write_mesh(scratch("hills.ply"), mesh);
  libmap::PointCloud cloud;
  const libmap::Pose motion = libmap::make_pose_from_rpy({0.02, -0.01, 0.03}, {2, 1, -3});
  for (const Eigen::Vector3d& vertex : mesh.vertices)
    if (vertex.x() > 0.1 && vertex.x() < 0.9 && vertex.y() > 0.1 && vertex.y() < 0.9)
      cloud.positions.push_back(motion * vertex);
  libmap::write_cloud(scratch("moved.csv"), cloud);
  const nlohmann::json json = compared_as_json({"moved.csv", "hills.ply", "--icp"});
  EXPECT_LT(json.at("rmse_m"), 1e-6);
  const nlohmann::json& icp = json.at("icp");
  EXPECT_EQ(icp.at("converged"), true);
  EXPECT_EQ(icp.at("free_motions"), 0);
  EXPECT_NEAR(icp.at("turned_deg"), Eigen::AngleAxisd(motion.linear()).angle() * 180 / M_PI, 1e-3);
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column)
      EXPECT_NEAR(json.at("b_from_a")
                      .at(static_cast<std::size_t>(row))
                      .at(static_cast<std::size_t>(column)),
                  motion.inverse().matrix()(row, column), 1e-6);
  EXPECT_GT(compared_as_json({"moved.csv", "hills.ply"}).at("rmse_m"), 0.01);
  // The printed transform and the matrix are valid values of --transform.
  const auto plain = graspmap({"compare", "moved.csv", "hills.ply", "--icp", "-o", "out.ply"});
  ASSERT_TRUE(succeeded(plain));
  const std::size_t begin = plain.standard_output.find("transform: ") + 11;
  const std::string transform =
      plain.standard_output.substr(begin, plain.standard_output.find('\n', begin) - begin);
  EXPECT_LT(compared_as_json({"moved.csv", "hills.ply", "--transform=" + transform}).at("rmse_m"),
            1e-6);
  const nlohmann::json manifest = json_of("out.ply.json");
  EXPECT_TRUE(manifest.at("results").at("icp_converged"));
  const auto matrix = manifest.at("transforms").at("b_from_a").get<std::vector<double>>();
  std::string rows = "# b_from_a\n";
  for (std::size_t n = 0; n < 12; ++n)
    rows += nlohmann::json(matrix[n]).dump() + (n % 4 == 3 ? "\n" : " ");
  graspmap_test::write_text(scratch("matrix.txt"), rows + "0 0 0 1\n");
  EXPECT_LT(compared_as_json({"moved.csv", "hills.ply", "--transform", "matrix.txt"}).at("rmse_m"),
            1e-6);
}

TEST(Compare, IcpTriesQuarterTurns) {
  const libmap::TriangleMesh mesh = hills();
  libmap::write_mesh(scratch("hills.ply"), mesh);
  libmap::PointCloud cloud;
  const libmap::Pose motion = libmap::make_pose_from_rpy({0.01, -0.01, 0.02}, {1, -1, 91});
  for (const Eigen::Vector3d& vertex : mesh.vertices)
    if (vertex.x() > 0.1 && vertex.x() < 0.9 && vertex.y() > 0.1 && vertex.y() < 0.9)
      cloud.positions.push_back(motion * vertex);
  libmap::write_cloud(scratch("turned.csv"), cloud);
  const auto result = graspmap({"compare", "turned.csv", "hills.ply", "--icp", "-o", "out.ply"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_TRUE(warned(result, {"ICP", "270 degrees"}));
  const auto found = json_of("out.ply.json").at("transforms").at("b_from_a");
  const Eigen::Matrix4d truth = motion.inverse().matrix();
  for (int n = 0; n < 12; ++n)
    EXPECT_NEAR(found.at(static_cast<std::size_t>(n)).get<double>(), truth(n / 4, n % 4), 1e-6);
}

TEST(Compare, IcpSaysWhatItCannotDo) {
  write_square_and_points();
  const auto flat = graspmap({"compare", "points.ply", "square.ply", "--icp"});
  ASSERT_TRUE(succeeded(flat));
  EXPECT_TRUE(warned(flat, {"3 of 6"}));
  EXPECT_NE(flat.standard_output.find("transform: 0.0000000,0.0000000,-0.0030000,"),
            std::string::npos)
      << flat.standard_output;
  EXPECT_TRUE(bad_input(
      graspmap({"compare", "points.ply", "square.ply", "--icp", "--transform", "0,0,1,0,0,0"}),
      {.file = "points.ply",
       .field = "share of points within 0.2 m of the surface",
       .value = "0.0 %",
       .bound = ">= 10.0 % and at least 6 points"}));
  const auto short_run =
      graspmap({"compare", "points.ply", "square.ply", "--icp", "--icp-max-iterations", "1"});
  EXPECT_TRUE(warned(short_run, {"ICP", "1 iterations"}));
  EXPECT_TRUE(bad_input(graspmap({"compare", "square.ply", "points.ply", "--icp"}),
                        {.file = "points.ply"}));
}

TEST(Compare, ImageOfSignedDistances) {
  write_square_and_points();
  // The left half lies above the square, the right one below it.
  libmap::PointCloud cloud;
  for (int x = 0; x < 100; ++x)
    for (int y = 0; y < 100; ++y)
      cloud.positions.emplace_back(0.005 + 0.01 * x, 0.005 + 0.01 * y, x < 50 ? 0.004 : -0.004);
  libmap::write_cloud(scratch("halves.ply"), cloud);
  ASSERT_TRUE(succeeded(graspmap({"compare", "halves.ply", "square.ply", "--image", "map.png"})));
  const libmap::ColorImage image = libmap::decode_color(content("map.png"));
  std::size_t red = 0;
  std::size_t blue = 0;
  double red_column = 0;
  double blue_column = 0;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width * 3 / 4; ++x) {
      const libmap::Color& color = image.at(x, y);
      if (color == libmap::Color{180, 4, 38}) {
        ++red;
        red_column += x;
      } else if (color == libmap::Color{59, 76, 192}) {
        ++blue;
        blue_column += x;
      }
    }
  ASSERT_GT(red, 10000U);
  EXPECT_NEAR(static_cast<double>(red) / static_cast<double>(blue), 1.0, 0.05);
  EXPECT_LT(red_column / static_cast<double>(red), blue_column / static_cast<double>(blue));
  EXPECT_NEAR(json_of("map.png.json").at("results").at("rmse_m"), 0.004, 1e-8);
  EXPECT_TRUE(bad_input(graspmap({"compare", "halves.ply", "square.ply", "--image", "map.jpg"}),
                        {.file = "map.jpg"}));
}

TEST(Compare, ExtremesAreOneShortLine) {
  write_square_and_points();
  const std::vector<std::pair<Words, graspmap_test::ExpectedError>> extremes = {
      {{"--samples-per-m2", "1e300"},
       {.file = "square.ply", .field = "number of samples", .value = "1e+300 (1e+300 per m2)"}},
      {{"--samples-per-m2", "1e12"},
       {.file = "square.ply", .field = "number of samples", .value = "1e+12 (1e+12 per m2)"}},
      {{"--within", "nan"}, {.field = "--within", .value = "nan", .bound = "> 0"}},
      {{"--transform", "0,0,1e308,0,0,0"},
       {.file = "points.ply", .field = "distance of the centers", .value = "inf m"}},
      {{"--box=-1e308,0,0,1e308,0,0"}, {.file = "points.ply", .field = "--box"}},
      {{"--icp", "--icp-max-distance", "-1"},
       {.field = "--icp-max-distance", .value = "-1", .bound = "> 0"}}};
  for (const auto& [words, expected] : extremes) {
    Words all = {"compare", "points.ply", "square.ply"};
    all.insert(all.end(), words.begin(), words.end());
    const auto result = graspmap(all);
    EXPECT_TRUE(bad_input(result, expected));
    EXPECT_LT(result.standard_error.size(), 200U) << result.standard_error;
  }
}

TEST(Compare, OnePointIsAReference) {
  libmap::PointCloud cloud;
  cloud.positions = {{0, 0, 0}};
  libmap::write_cloud(scratch("one.ply"), cloud);
  cloud.positions = {{0.3, 0, 0.4}};
  libmap::write_cloud(scratch("other.ply"), cloud);
  graspmap_test::write_text(scratch("t.txt"), "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
  const auto result =
      graspmap({"compare", "other.ply", "one.ply", "--transform", "t.txt", "-o", "d.ply"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_NE(result.standard_output.find("rmse: 500.00 mm"), std::string::npos)
      << result.standard_output;
  EXPECT_EQ(graspmap_test::json_of("d.ply.json").at("inputs").size(), 3U) << "the transform too";
}

TEST(Compare, TransformFilesThatAreNone) {
  write_square_and_points();
  const auto refused = [](const std::string& text) {
    graspmap_test::write_text(scratch("t.txt"), text);
    return graspmap({"compare", "points.ply", "square.ply", "--transform", "t.txt"});
  };
  EXPECT_TRUE(bad_input(refused("1 0 0 0\n0 1 0 0\n0 0 1 0\n"),
                        {.file = "t.txt", .field = "rows", .value = "3"}));
  EXPECT_TRUE(
      bad_input(refused("1 0 0\n0 1 0\n0 0 1\n0 0 0\n"), {.file = "t.txt", .field = "line 1"}));
  EXPECT_TRUE(bad_input(refused("1 0 0 0\n0 1 0 0\n0 0 x 0\n0 0 0 1\n"),
                        {.file = "t.txt", .field = "line 3", .value = "x"}));
  EXPECT_TRUE(bad_input(refused("2 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"), {.file = "t.txt"}));
  EXPECT_TRUE(bad_input(refused("1 0 0 0\n0 1 0 0\n0 0 -1 0\n0 0 0 1\n"), {.file = "t.txt"}));
  EXPECT_TRUE(bad_input(refused("1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 1 1\n"), {.file = "t.txt"}));
  EXPECT_TRUE(bad_input(refused(""), {.file = "t.txt", .field = "rows", .value = "0"}));
}

TEST(Compare, BadInput) {
  write_square_and_points();
  EXPECT_TRUE(
      bad_input(graspmap({"compare", "points.ply", "square.ply", "--transform", "1e300,0,0,0,0,0"}),
                {.file = "points.ply", .field = "distance of the centers", .value = "inf m"}));
  const auto run = [](const Words& more) {
    Words words = {"compare", "points.ply", "square.ply"};
    words.insert(words.end(), more.begin(), more.end());
    return graspmap(words);
  };
  EXPECT_TRUE(bad_input(run({"--transform", "1,2,3"}), {.field = "--transform", .value = "1,2,3"}));
  EXPECT_TRUE(bad_input(run({"--transform", "1,2,3,4,5,nan"}),
                        {.field = "--transform", .value = "1,2,3,4,5,nan"}));
  EXPECT_TRUE(bad_input(run({"--transform", "1,2,3,4,5,6,7"}),
                        {.field = "--transform", .value = "1,2,3,4,5,6,7"}));
  EXPECT_TRUE(bad_input(run({"--box", "1,0,0,0,1,1"}), {.field = "--box", .value = "1,0,0,0,1,1"}));
  EXPECT_TRUE(bad_input(run({"--box", "5,5,5,6,6,6"}), {.file = "points.ply", .field = "--box"}));
  EXPECT_TRUE(
      bad_input(run({"--within", "0"}), {.field = "--within", .value = "0", .bound = "> 0"}));
  EXPECT_TRUE(bad_input(run({"-o", "square.ply"}), {.file = "square.ply"}));
  EXPECT_TRUE(bad_input(graspmap({"compare", "none.ply", "square.ply"}), {.file = "none.ply"}));
  libmap::write_cloud(scratch("empty.ply"), {});
  EXPECT_TRUE(bad_input(graspmap({"compare", "points.ply", "empty.ply"}),
                        {.file = "empty.ply", .field = "points of the cloud"}));
}

}  // namespace compare_test
