#include <gtest/gtest.h>

#include <cmath>

#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "tests/tools/tool_test_support.h"

namespace simulate_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::wrong_usage;

TEST(SimulateScene, OptionsOfTheOtherOutputAreRefused) {
  for (const char* name : {"--spacing", "--count", "--jitter", "--noise", "--seed"})
    EXPECT_TRUE(bad_input(graspmap({"simulate", "scene", "--mesh", name, "0.25", "-o", "s.ply"}),
                          {.field = name}))
        << name;
  for (const char* name : {"--edge-length", "--chord-error"})
    EXPECT_TRUE(bad_input(graspmap({"simulate", "scene", name, "0.25", "-o", "s.ply"}),
                          {.field = name, .about = "--mesh"}));
}

TEST(SimulateScene, SamplesLieOnTheShapes) {
  ASSERT_TRUE(succeeded(graspmap({"simulate", "scene", "--spacing", "0.03", "-o", "a.pcd"})));
  const libmap::PointCloud cloud = libmap::read_cloud(scratch("a.pcd")).cloud;
  ASSERT_TRUE(cloud.has_normals());
  const std::vector<double>& shapes = cloud.find_field("shape")->values;
  std::size_t on_largest = 0;
  for (std::size_t n = 0; n < cloud.size(); ++n) {
    // The hemisphere of 0.25 m stands at (-1, -1, 0); it is shape 5 of the file.
    if (shapes[n] != 5.0) continue;
    ++on_largest;
    EXPECT_NEAR((cloud.positions[n] - Eigen::Vector3d(-1, -1, 0)).norm(), 0.25, 1e-6);
    EXPECT_NEAR(cloud.find_field("curvature_max")->values[n], 4.0, 1e-5);
  }
  // 2 pi r^2 / spacing^2 = 436.
  EXPECT_NEAR(static_cast<double>(on_largest), 436.0, 40.0);
}

TEST(SimulateScene, SeedsDecideTheBytes) {
  const auto scene = [](const char* seed, const char* output) {
    return succeeded(graspmap({"simulate", "scene", "--spacing", "0.05", "--seed", seed, "--noise",
                               "0.001", "-o", output}));
  };
  ASSERT_TRUE(scene("1", "a.pcd"));
  ASSERT_TRUE(scene("1", "b.pcd"));
  ASSERT_TRUE(scene("2", "c.pcd"));
  EXPECT_EQ(content("a.pcd"), content("b.pcd"));
  EXPECT_NE(content("a.pcd"), content("c.pcd"));
}

TEST(SimulateScene, OwnSceneAsMesh) {
  graspmap_test::write_text(scratch("mine.yaml"),
                            "shapes:\n  - {shape: plane, size_x_m: 1, size_y_m: 1}\n"
                            "  - {shape: sphere, radius_m: 0.2}\n");
  ASSERT_TRUE(succeeded(
      graspmap({"simulate", "scene", "--scene", "mine.yaml", "--mesh", "-o", "mine.ply"})));
  const libmap::TriangleMesh mesh = libmap::read_mesh(scratch("mine.ply")).mesh;
  // The plane without the circle, and the hemisphere: 1 + pi r^2.
  EXPECT_NEAR(libmap::surface_area(mesh), 1.0 + M_PI * 0.04, 1e-3);
}

TEST(SimulateScene, BadInputIsOneLine) {
  graspmap_test::write_text(scratch("bad.yaml"), "shapes:\n  - {shape: spere, radius_m: 0.2}\n");
  EXPECT_TRUE(
      bad_input(graspmap({"simulate", "scene", "--scene", "bad.yaml", "-o", "a.pcd"}),
                {.file = "bad.yaml", .field = "shapes[0].shape (line 2)", .value = "spere"}));
  EXPECT_TRUE(
      bad_input(graspmap({"simulate", "scene", "--scene", "primitive_shape", "-o", "a.pcd"}),
                {.field = "scene", .value = "primitive_shape"}));
  EXPECT_TRUE(bad_input(graspmap({"simulate", "scene", "--spacing", "1e-6", "-o", "a.pcd"}),
                        {.field = "spacing_m", .value = "1e-06"}));
  EXPECT_TRUE(wrong_usage(graspmap({"simulate", "scnee", "-o", "a.pcd"}), {"scnee", "scene"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("a.pcd")));
}

TEST(Mask, AsTextEqualsTheAuthorsProgram) {
  GRASPMAP_REQUIRE_REFERENCE();
  ASSERT_TRUE(succeeded(graspmap({"mask", "--method", "thesis", "-o", "mask.txt"})));
  const std::string reference = graspmap_test::read_text(graspmap_test::reference_folder() /
                                                         "gtd/mask.thesis.scar-e.10mm.txt");
  const std::string mask = content("mask.txt");
  // The first line is a comment in both.
  EXPECT_EQ(mask.substr(mask.find('\n')), reference.substr(reference.find('\n')));
}

TEST(Mask, AsCloudAndImage) {
  ASSERT_TRUE(succeeded(
      graspmap({"mask", "--gripper", "hubrobo", "--voxel-size", "0.004", "-o", "mask.ply"})));
  ASSERT_TRUE(succeeded(graspmap({"mask", "-o", "mask.png"})));
  const libmap::PointCloud cloud = libmap::read_cloud(scratch("mask.ply")).cloud;
  EXPECT_GT(cloud.size(), 100U);
  EXPECT_NE(cloud.find_field("layer"), nullptr);
  EXPECT_EQ(content("mask.png").substr(1, 3), "PNG");
}

TEST(Mask, BadInputIsOneLine) {
  EXPECT_TRUE(bad_input(graspmap({"mask", "--gripper", "scare", "-o", "mask.txt"}),
                        {.field = "gripper", .value = "scare"}));
  EXPECT_TRUE(bad_input(graspmap({"mask", "--voxel-size", "1", "-o", "mask.txt"}),
                        {.field = "voxel_size_m", .value = "1"}));
  EXPECT_TRUE(
      bad_input(graspmap({"mask", "-o", "mask.doc"}), {.file = "mask.doc",
                                                       .field = "extension",
                                                       .value = ".doc",
                                                       .bound = ".pcd, .ply, .csv or .vtp"}));
}

}  // namespace simulate_test
