#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "libmap/camera/image_codec.h"
#include "libmap/core/file_output.h"
#include "libmap/core/manifest.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/io/mesh_io.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/mesh/ray_caster.h"
#include "libmap/mesh/surface_distance.h"
#include "libmap/poses/trajectory_io.h"
#include "libmap/scan/scan_source.h"
#include "libmap/texture/textured_mesh_io.h"
#include "tests/libmap/mesh/mesh_samples.h"
#include "tests/libmap/scan/sample_database.h"
#include "tests/libmap/texture/textured_samples.h"
#include "tests/tools/tool_test_support.h"

namespace texture_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::data_folder;
using graspmap_test::ended_with;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::names_in_scratch;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::warned;
using Words = std::vector<std::string>;

std::string scan_file() { return data_folder() / "scans" / "site_full.db"; }

// A part of the true surface of the scans, in the frame of their true poses, and six of these.
void write_site_part(const std::string& name) {
  libmap::Trajectory poses =
      trajectory_of(libmap::open_scan(scan_file())->graph(), libmap::PoseSource::ground_truth);
  libmap::Trajectory some;
  for (std::size_t i = 0; i < poses.size(); i += 7) some.push_back(poses[i]);
  libmap::write_trajectory(scratch("six.tum"), {some, {}}, true);
  const libmap::TriangleMesh site = libmap::transform_mesh(
      libmap::read_mesh(data_folder() / "scans" / "site_ground_truth_mesh.ply").mesh,
      libmap::make_pose_from_rpy({0, 0, 0}, {0, 0, 90}));
  std::vector<bool> keep;
  for (const libmap::Triangle& triangle : site.triangles)
    keep.push_back(site.vertices[triangle[0]].head<2>().cwiseAbs().maxCoeff() < 0.6);
  libmap::write_mesh(scratch(name), libmap::select_triangles(site, keep));
}

Words texture_words(const std::string& output) {
  return {"texture", "site.ply", "--scan", scan_file(), "--poses", "six.tum", "-o", output};
}

Words operator+(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

// Expects the colors of a frame of the scan on the surface that it shows.
void expect_colors_of_photographs(const libmap::TexturedMesh& model) {
  const auto scan = libmap::open_scan(scan_file());
  const auto& node = scan->graph().nodes[14];
  const auto view = libmap::camera_views(scan->read_frame(node.id))[0];
  const libmap::Pose camera_from_world =
      (*node.truth_from_base * view.color_camera.base_from_camera).inverse();
  double error = 0.0;
  int count = 0;
  for (std::uint32_t t = 0; t < model.mesh.triangles.size(); t += 7) {
    const Eigen::Vector3d point =
        camera_from_world * libmap::position_on(model.mesh, {t, 0.3, 0.3});
    const auto pixel = libmap::project_point(view.color_camera, point);
    if (!pixel || !(pixel->minCoeff() > 5 && pixel->x() < 506 && pixel->y() < 418)) continue;
    const int column = static_cast<int>(std::lround(pixel->x()));
    const int row = static_cast<int>(std::lround(pixel->y()));
    const double depth = static_cast<double>(view.depth.at(column, row));
    if (std::abs(depth - point.z()) > 0.02) continue;
    const Eigen::Vector3f color = graspmap_test::texture_color(model, t, 0.3, 0.3);
    for (std::size_t c = 0; c < 3; ++c)
      error += std::abs(static_cast<double>(color[static_cast<Eigen::Index>(c)]) -
                        view.color.at(column, row)[c]) /
               3.0;
    ++count;
  }
  EXPECT_GT(count, 500);
  EXPECT_LT(error / count, 8.0);
}

TEST(Texture, RealScanAsObjAndGlb) {
  GRASPMAP_REQUIRE_DATA();
  write_site_part("site.ply");
  const std::size_t triangles = libmap::read_mesh(scratch("site.ply")).mesh.triangles.size();
  for (const std::string name : {"model.obj", "model.glb"}) {
    ASSERT_TRUE(succeeded(graspmap(texture_words(name))));
    const libmap::TexturedMesh model = libmap::read_textured_mesh(scratch(name));
    EXPECT_EQ(model.mesh.triangles.size(), triangles);
    ASSERT_EQ(model.pages.size(), 1U);
    const nlohmann::json results = json_of(name + ".json").at("results");
    EXPECT_EQ(results.at("photographs"), 6);
    EXPECT_EQ(results.at("exposure_gains").size(), 18U);
    EXPECT_EQ(results.at("seen_triangles").get<std::size_t>() +
                  results.at("unseen_triangles").get<std::size_t>(),
              triangles);
    EXPECT_GT(results.at("seen_m2"), 0.5);
    EXPECT_LT(results.at("seams_m"), 0.7 * results.at("seams_before_m").get<double>());
    EXPECT_LT(results.at("color_spread"), 0.15);
    EXPECT_EQ(json_of(name + ".json").at("inputs").size(), 3U);
    expect_colors_of_photographs(model);
  }
  EXPECT_EQ(names_in_scratch(), (Words{"model.glb", "model.glb.json", "model.mtl", "model.obj",
                                       "model.obj.json", "model_0.png", "site.ply", "six.tum"}));
  // Both show the same.
  for (const std::string name : {"model.obj", "model.glb"})
    ASSERT_TRUE(succeeded(graspmap({"render", name, "--color", "texture", "--view", "oblique",
                                    "--width", "320", "--height", "240", "-o", name + ".png"})));
  const libmap::ColorImage a = libmap::decode_color(content("model.obj.png"));
  const libmap::ColorImage b = libmap::decode_color(content("model.glb.png"));
  std::size_t different = 0;
  std::set<libmap::Color> colors;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    different += std::abs(a.pixels[i][0] - b.pixels[i][0]) > 8 ? 1 : 0;
    colors.insert(a.pixels[i]);
  }
  EXPECT_LT(different, a.pixels.size() / 100);
  EXPECT_GT(colors.size(), 1000U) << "a texture has many colors";
  EXPECT_TRUE(bad_input(graspmap({"render", "site.ply", "--color", "texture", "-o", "p.png"}),
                        {.file = "site.ply", .field = "color mode", .value = "texture"}));
}

TEST(Texture, SameBytesForAnyNumberOfThreads) {
  GRASPMAP_REQUIRE_DATA();
  write_site_part("site.ply");
  for (const std::string threads : {"1", "2", "5"})
    ASSERT_TRUE(succeeded(graspmap(texture_words(threads + ".glb") + Words{"--threads", threads})));
  EXPECT_TRUE(content("1.glb") == content("2.glb"));
  EXPECT_TRUE(content("1.glb") == content("5.glb"));
}

TEST(Texture, SmallPagesAndOldOnes) {
  GRASPMAP_REQUIRE_DATA();
  write_site_part("site.ply");
  ASSERT_TRUE(succeeded(graspmap(texture_words("m.obj") + Words{"--texture-size", "128"})));
  const int pages = json_of("m.obj.json").at("results").at("pages");
  EXPECT_GT(pages, 5);
  EXPECT_EQ(libmap::read_textured_mesh(scratch("m.obj")).pages.size(),
            static_cast<std::size_t>(pages));
  EXPECT_TRUE(std::filesystem::exists(scratch("m_4.png")));
  // Fewer pages in another format: the earlier ones go.
  const auto result =
      graspmap(texture_words("m.obj") +
               Words{"--texture-size", "256", "--max-pages", "2", "--image-format", "jpeg"});
  ASSERT_TRUE(succeeded(result));
  EXPECT_TRUE(warned(result, {"texels"}));
  EXPECT_EQ(libmap::read_textured_mesh(scratch("m.obj")).pages.size(), 2U);
  EXPECT_EQ(names_in_scratch(),
            (Words{"m.mtl", "m.obj", "m.obj.json", "m_0.jpg", "m_1.jpg", "site.ply", "six.tum"}));
}

TEST(Texture, FilesOfOthersStay) {
  GRASPMAP_REQUIRE_DATA();
  write_site_part("site.ply");
  graspmap_test::write_text(scratch("m.mtl"), "newmtl mine\n");
  EXPECT_TRUE(ended_with(graspmap(texture_words("m.obj") + Words{"--quiet"}),
                         {.file = "m.mtl", .about = "--force"}));
  EXPECT_EQ(content("m.mtl"), "newmtl mine\n");
  EXPECT_EQ(names_in_scratch(), (Words{"m.mtl", "site.ply", "six.tum"}));
  ASSERT_TRUE(succeeded(graspmap(texture_words("m.obj") + Words{"--force"})));
  EXPECT_NE(content("m.mtl").find("map_Kd m_0.png"), std::string::npos);
}

TEST(Texture, BadInput) {
  GRASPMAP_REQUIRE_DATA();
  write_site_part("site.ply");
  EXPECT_TRUE(ended_with(
      graspmap(texture_words("m.ply")),
      {.file = "m.ply", .field = "extension", .value = ".ply", .bound = ".obj or .glb"}));
  EXPECT_TRUE(
      ended_with(graspmap({"texture", "none.ply", "--scan", scan_file(), "-o", "m.obj", "--quiet"}),
                 {.file = "none.ply"}));
  EXPECT_TRUE(
      ended_with(graspmap(texture_words("m.obj") + Words{"--texture-size", "32"}),
                 {.field = "--texture-size", .value = "32", .bound = ">= 64 and <= 16384"}));
  EXPECT_TRUE(ended_with(graspmap(texture_words("none/m.obj")), {.file = "none/m.obj"}));
  // Poses of another frame.
  libmap::Trajectory poses =
      trajectory_of(libmap::open_scan(scan_file())->graph(), libmap::PoseSource::ground_truth);
  poses.resize(3);
  for (libmap::TrajectoryPose& pose : poses) pose.world_from_base.translation().x() += 500.0;
  libmap::write_trajectory(scratch("far.tum"), {poses, {}}, true);
  EXPECT_TRUE(ended_with(graspmap({"texture", "site.ply", "--scan", scan_file(), "--poses",
                                   "far.tum", "-o", "m.obj", "--quiet"}),
                         {.file = "site.ply", .about = "3 photographs"}));
  EXPECT_EQ(names_in_scratch(), (Words{"far.tum", "site.ply", "six.tum"}));
  ASSERT_TRUE(succeeded(graspmap(texture_words("m.obj") + Words{"--dry-run"})));
  EXPECT_EQ(names_in_scratch(), (Words{"far.tum", "site.ply", "six.tum"}));
}

TEST(Texture, PosesThatTheScanLacksAreNamed) {
  libmap::write_mesh(scratch("site.ply"), graspmap_test::square_mesh(0.0));
  const std::filesystem::path scan = scratch("scan.db");
  graspmap_test::write_sample(scan);
  const auto texture = [](const Words& more) {
    return graspmap(Words{"texture", "site.ply", "--scan", "scan.db", "-o", "m.glb"} + more);
  };
  graspmap_test::execute(scan, "UPDATE Node SET ground_truth_pose = NULL WHERE id = 1");
  EXPECT_TRUE(
      ended_with(texture({"--frame", "ground-truth"}),
                 {.file = "scan.db", .field = "common poses", .value = "2", .bound = ">= 3"}));
  graspmap_test::execute(scan, "UPDATE Node SET ground_truth_pose = NULL");
  EXPECT_TRUE(ended_with(texture({"--frame", "ground-truth"}),
                         {.file = "scan.db", .field = "--frame", .value = "ground-truth"}));
  graspmap_test::execute(scan, "UPDATE Node SET pose = x'01' WHERE id = 1");
  EXPECT_TRUE(ended_with(texture({"--strict"}), {.file = "scan.db", .about = "node 1: pose"}));
  graspmap_test::execute(scan, "UPDATE Node SET pose = NULL");
  graspmap_test::execute(scan, "UPDATE Admin SET opt_ids = NULL, opt_poses = NULL");
  EXPECT_TRUE(ended_with(texture({}), {.file = "scan.db", .about = "--poses"}));
  EXPECT_EQ(names_in_scratch(), (Words{"scan.db", "site.ply"}));
}

TEST(Texture, RemembersThatTheMeshComesFromTheTrueFrame) {
  GRASPMAP_REQUIRE_DATA();
  write_site_part("site.ply");
  libmap::Manifest manifest;
  manifest.command = "mesh";
  manifest.transforms.emplace_back("ground_truth_from_poses", libmap::Pose::Identity());
  libmap::write_text(scratch("site.ply.json"), libmap::to_json(manifest));
  ASSERT_TRUE(succeeded(graspmap({"crop", "site.ply", "--size", "0.8x0.8", "-o", "cropped.ply"})));
  for (const char* mesh : {"site.ply", "cropped.ply"}) {
    Words words = texture_words("part.glb");
    words[1] = mesh;
    words.insert(words.end(), {"--force"});
    const auto result = graspmap(words);
    ASSERT_TRUE(succeeded(result));
    EXPECT_TRUE(json_of("part.glb.json").at("results").contains("trajectory_rmse_m"));
    words.insert(words.end(), {"--frame", "poses"});
    ASSERT_TRUE(succeeded(graspmap(words)));
    EXPECT_FALSE(json_of("part.glb.json").at("results").contains("trajectory_rmse_m"));
  }
}

TEST(Texture, CroppedSitesCarryThePosesWithThem) {
  GRASPMAP_REQUIRE_DATA();
  write_site_part("site.ply");
  ASSERT_TRUE(succeeded(graspmap(texture_words("whole.glb"))));
  ASSERT_TRUE(succeeded(graspmap({"crop", "site.ply", "--size", "0.8x0.8", "-o", "cropped.ply"})));
  Words words = texture_words("part.glb");
  words[1] = "cropped.ply";
  const auto result = graspmap(words);
  ASSERT_TRUE(succeeded(result));
  EXPECT_EQ(json_of("part.glb.json").at("frame"), "site");
  EXPECT_TRUE(json_of("part.glb.json").at("transforms").contains("site_from_map"));
  // Colors at equal positions are equal.
  const auto whole = libmap::read_textured_mesh(scratch("whole.glb"));
  const auto part = libmap::read_textured_mesh(scratch("part.glb"));
  const libmap::SurfaceDistance surface(whole.mesh);
  const libmap::RayCaster caster(whole.mesh);
  const auto manifest = libmap::read_manifest_of(scratch("part.glb"));
  const libmap::Pose map_from_site = manifest->find_transform("site_from_map")->inverse();
  double error = 0.0;
  double moved = 0.0;
  int count = 0;
  for (std::uint32_t t = 0; t < part.mesh.triangles.size(); t += 5, ++count) {
    const Eigen::Vector3d place = libmap::position_on(part.mesh, {t, 0.3, 0.3});
    const libmap::SurfacePoint found = surface.nearest(map_from_site * place);
    EXPECT_LT(found.distance_m, 1e-4);
    moved += (map_from_site * place - place).norm();
    const Eigen::Vector3d up =
        libmap::area_normal(whole.mesh, whole.mesh.triangles[found.triangle]).normalized();
    const auto hit = caster.cast(found.position + 1e-3 * up, -up, 0.0, 2e-3);
    ASSERT_TRUE(hit);
    error +=
        static_cast<double>((graspmap_test::texture_color(part, t, 0.3, 0.3) -
                             graspmap_test::texture_color(whole, hit->triangle, hit->u, hit->v))
                                .cwiseAbs()
                                .mean());
  }
  EXPECT_GT(moved / count, 0.001);
  EXPECT_LT(error / count, 3.0);
}

}  // namespace texture_test
