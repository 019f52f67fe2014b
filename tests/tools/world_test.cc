#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <thread>

#include "libmap/core/file_output.h"
#include "libmap/core/manifest.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "libmap/texture/textured_mesh_io.h"
#include "tests/libmap/world/world_samples.h"
#include "tests/support/running_program.h"
#include "tests/tools/tool_test_support.h"

namespace world_tool_test {

namespace fs = std::filesystem;
using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::names_in_scratch;
using graspmap_test::scratch;
using graspmap_test::succeeded;

void write_site() {
  libmap::TriangleMesh mesh = graspmap_test::ground_with_boulder();
  for (const Eigen::Vector3d& v : mesh.vertices)
    mesh.vertex_colors.push_back({static_cast<std::uint8_t>(128 + 1000 * v.z()), 90, 60});
  libmap::write_mesh(scratch("site.ply"), mesh);
}

// A map of the ground with three classes of scores, moved by `x_m`, and footholds of it.
void write_map(const std::string& name, double x_m) {
  libmap::PointCloud map;
  for (double x = -0.3; x < 0.3; x += 0.02)
    for (double y = -0.3; y < -0.1; y += 0.02)
      map.positions.emplace_back(x + x_m, y, graspmap_test::wavy_height(x, y));
  std::vector<double>& score = map.add_field("score", libmap::ScalarType::float32).values;
  for (std::size_t n = 0; n < map.size(); ++n) score[n] = 0.35 + 0.3 * static_cast<double>(n % 3);
  for (const char* name_of_axis : {"approach_x", "approach_y", "approach_z"})
    map.add_field(name_of_axis, libmap::ScalarType::float32)
        .values.assign(map.size(), std::string(name_of_axis) == "approach_z" ? 1.0 : 0.0);
  libmap::write_cloud(scratch(name), map);
}

std::map<std::string, std::string> files_of(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file())
      files[fs::relative(entry.path(), folder).string()] = libmap::read_whole_file(entry.path());
  return files;
}

TEST(WorldCommand, TheSameBytesForAnyNumberOfThreadsAndASecondRun) {
  write_site();
  write_map("map.ply", 0.0);
  const std::vector<std::string> words = {"convert", "site.ply", "-o",          "rocks.world",
                                          "--map",   "map.ply",  "--footholds", "map.ply",
                                          "--rig",   "scar-e",   "--gravity",   "mars"};
  ASSERT_TRUE(succeeded(graspmap(words)));
  const auto first = files_of(scratch("rocks.world"));
  EXPECT_TRUE(first.contains("meshes/site_visual_0_0.png"));
  EXPECT_TRUE(first.contains("meshes/site_score_2.obj"));
  EXPECT_FALSE(first.contains("meshes/site_score_3.obj"));
  EXPECT_NE(first.at("world.xml").find("foothold_300"), std::string::npos);
  std::vector<std::string> again = words;
  again.insert(again.end(), {"--threads", "1"});
  ASSERT_TRUE(succeeded(graspmap(again)));
  EXPECT_EQ(files_of(scratch("rocks.world")), first);
  const auto manifest = json_of("rocks.world.json");
  const auto& results = manifest["results"];
  EXPECT_EQ(results["models"], 1);
  EXPECT_EQ(results["score_points"], 300);
  EXPECT_EQ(results["footholds"], 300);
  EXPECT_LE(results["collision_deviation_m"], 0.002);
  EXPECT_GT(results["collision_triangles"], 100);
  EXPECT_LT(results["collision_triangles"], results["visual_triangles"]);
  EXPECT_TRUE(manifest["transforms"].contains("site_from_robot"));
}

// The frame of the site, and one model for each tile with the same seams.
TEST(WorldCommand, TilesAreModels) {
  fs::create_directory(scratch("tiles"));
  libmap::write_mesh(scratch("tiles/x0.ply"), graspmap_test::wavy_ground(0.4, 0.01, -0.2));
  libmap::write_mesh(scratch("tiles/x1.ply"), graspmap_test::wavy_ground(0.4, 0.01, 0.2));
  ASSERT_TRUE(succeeded(graspmap({"convert", "tiles", "-o", "tiles.world"})));
  const auto files = files_of(scratch("tiles.world"));
  for (const char* name : {"meshes/x0_collision.obj", "meshes/x1_field.bin", "meshes/x1.glb"})
    EXPECT_TRUE(files.contains(name)) << name;
  EXPECT_NE(files.at("world.sdf").find("<model name=\"x1\">"), std::string::npos);
  EXPECT_EQ(json_of("tiles.world.json")["results"]["models"], 2);
  EXPECT_EQ(json_of("tiles.world.json")["results"]["missing_cells"], 0);
  EXPECT_EQ(json_of("tiles.world.json")["results"]["balls"], 0);
}

// A texture is kept as it is, and only used by its own triangles.
TEST(WorldCommand, TexturedSite) {
  libmap::TexturedMesh model;
  model.mesh = graspmap_test::wavy_ground(0.4);
  const std::size_t count = model.mesh.triangles.size();
  model.texture_coordinates.assign(count,
                                   {Eigen::Vector2f(0.1F, 0.2F), {0.9F, 0.2F}, {0.5F, 0.8F}});
  model.page_of_triangle.assign(count, 0);
  for (std::size_t t = count / 2; t < count; ++t) model.page_of_triangle[t] = 1;
  for (const std::uint8_t red : {std::uint8_t{10}, std::uint8_t{200}}) {
    model.pages.emplace_back(8, 4);
    for (libmap::Color& color : model.pages.back().pixels) color = {red, 20, 30};
  }
  for (const libmap::ModelFile& file : libmap::textured_mesh_files(scratch("site.glb"), model))
    file.write(file.path);
  ASSERT_TRUE(succeeded(graspmap({"convert", "site.glb", "-o", "textured.world"})));
  const auto files = files_of(scratch("textured.world"));
  for (const std::size_t n : {0U, 1U}) {
    const std::string stem = "meshes/site_visual_" + std::to_string(n);
    ASSERT_TRUE(files.contains(stem + ".obj"));
    EXPECT_NE(files.at("world.xml").find("site_visual_" + std::to_string(n) + "_0.png"),
              std::string::npos);
    const libmap::TexturedMesh part =
        libmap::read_textured_mesh(scratch("textured.world") / (stem + ".obj"));
    EXPECT_EQ(part.mesh.triangles.size(), count / 2);
    ASSERT_EQ(part.pages.size(), 1U);
    EXPECT_EQ(part.pages[0].pixels[0],
              (libmap::Color{n == 0 ? std::uint8_t{10} : std::uint8_t{200}, 20, 30}));
    EXPECT_NEAR(part.texture_coordinates[0][1].x(), 0.9, 1e-6);
  }
  const libmap::TexturedMesh whole =
      libmap::read_textured_mesh(scratch("textured.world/meshes/site.glb"));
  EXPECT_EQ(whole.pages.size(), 2U);
  EXPECT_EQ(whole.mesh.triangles.size(), count);
}

// The georeference is in the manifest and in a comment of each file.
TEST(WorldCommand, Georeference) {
  write_site();
  libmap::Manifest manifest;
  manifest.command = "crop";
  manifest.georeference = libmap::Georeference{
      .crs_wkt = "LOCAL_CS[\"a--b\"]", .unit_m = 1.0, .origin_m = {500000.25, 4000000.5, -3.0}};
  graspmap_test::write_text(libmap::manifest_path(scratch("site.ply")), libmap::to_json(manifest));
  ASSERT_TRUE(succeeded(graspmap({"convert", "site.ply", "-o", "geo.world"})));
  const auto written = libmap::read_manifest_of(scratch("geo.world"));
  ASSERT_TRUE(written && written->georeference);
  EXPECT_EQ(*written->georeference, *manifest.georeference);
  for (const char* file : {"world.sdf", "world.xml", "world.urdf"})
    EXPECT_NE(libmap::read_whole_file(scratch("geo.world") / file)
                  .find("georeference: offset 500000.25 4000000.5 -3 m, CRS LOCAL_CS[\"a- -b\"]"),
              std::string::npos)
        << file;
}

// A killed run leaves nothing that looks like a world and does not disturb the next run.
TEST(WorldCommand, KilledRunLeavesNoWorld) {
  write_site();
  ASSERT_TRUE(succeeded(graspmap({"convert", "site.ply", "-o", "site.world"})));
  const auto expected = files_of(scratch("site.world"));
  fs::remove_all(scratch("site.world"));
  fs::remove(scratch("site.world.json"));
  int killed = 0;
  for (int wait_ms = 5; wait_ms < 1000; wait_ms *= 2) {
    graspmap_test::RunningProgram running({(graspmap_test::build_folder() / "graspmap").string(),
                                           "convert", "site.ply", "-o", "site.world"},
                                          {.folder = scratch("")});
    std::this_thread::sleep_for(std::chrono::milliseconds(wait_ms));
    if (running.has_ended()) break;
    kill(running.process(), SIGKILL);
    running.wait();
    ++killed;
    EXPECT_FALSE(fs::exists(scratch("site.world"))) << wait_ms;
    EXPECT_FALSE(fs::exists(scratch("site.world.json"))) << wait_ms;
  }
  EXPECT_GT(killed, 0);
  fs::remove_all(scratch("site.world"));
  ASSERT_TRUE(succeeded(graspmap({"convert", "site.ply", "-o", "site.world", "--force"})));
  EXPECT_TRUE(files_of(scratch("site.world")) == expected);
  for (const std::string& name : names_in_scratch())
    EXPECT_EQ(name.find(".partial"), std::string::npos) << name;
}

TEST(WorldCommand, FramesAreNamed) {
  write_site();
  ASSERT_TRUE(succeeded(graspmap({"crop", "site.ply", "--box=-0.3,-0.3,0.3,0.3", "--center",
                                  "--level", "none", "-o", "part.ply", "--quiet"})));
  ASSERT_TRUE(succeeded(graspmap({"convert", "part.ply", "-o", "part.world"})));
  for (const char* file : {"world.sdf", "world.xml", "world.urdf"})
    EXPECT_NE(libmap::read_whole_file(scratch("part.world") / file).find("site_from_map"),
              std::string::npos);
  EXPECT_EQ(json_of("part.world.json")["transforms"]["site_from_map"],
            json_of("part.ply.json")["transforms"]["site_from_map"]);
}

TEST(WorldCommand, BadInputWritesNothing) {
  write_site();
  write_map("other.ply", 5.0);
  graspmap_test::write_text(scratch("empty.ply"),
                            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
                            "property float y\nproperty float z\nelement face 0\n"
                            "property list uchar int vertex_indices\nend_header\n"
                            "0 0 0\n1 0 0\n0 1 0\n");
  graspmap_test::write_text(scratch("none.yaml"), "depth_scale_m: 0.001\ncameras: []\n");
  graspmap_test::write_text(
      scratch("name.yaml"),
      "cameras:\n  - name: a::b\n    image_width: 64\n    image_height: 36\n    camera_matrix: "
      "[33, 0, 31, 0, 33, 17, 0, 0, 1]\n    position_m: [0, 0, 0]\n    roll_pitch_yaw_deg: [0, 0, "
      "0]\n");
  const auto before = names_in_scratch();
  const auto convert = [](std::vector<std::string> words) {
    words.insert(words.begin(), "convert");
    return graspmap(words);
  };
  EXPECT_TRUE(bad_input(convert({"empty.ply", "-o", "x.world"}),
                        {.file = "empty.ply", .field = "triangles"}));
  EXPECT_TRUE(bad_input(convert({"site.ply", "-o", "x.world", "--map", "other.ply"}),
                        {.file = "other.ply", .field = "points on the surface", .value = "0"}));
  EXPECT_TRUE(bad_input(convert({"site.ply", "-o", "x.world", "--rig", "none.yaml"}),
                        {.file = "none.yaml"}));
  EXPECT_TRUE(bad_input(convert({"site.ply", "-o", "x.world", "--rig", "name.yaml"}),
                        {.file = "name.yaml", .field = "name of a camera", .value = "a::b"}));
  EXPECT_TRUE(bad_input(convert({"site.ply", "-o", "a::b.world"}),
                        {.file = "a::b.world", .field = "name", .value = "a::b"}));
  EXPECT_TRUE(bad_input(convert({"site.ply", "-o", "world.world"}),
                        {.file = "world.world", .field = "name", .value = "world"}));
  EXPECT_TRUE(bad_input(convert({"site.ply", "-o", "x.world", "--gravity", "venus"}),
                        {.field = "--gravity", .value = "venus"}));
  EXPECT_TRUE(bad_input(convert({"site.ply", "-o", "x.world", "--map", "site.ply"}),
                        {.file = "site.ply", .field = "score"}));
  EXPECT_EQ(names_in_scratch(), before);
}

}  // namespace world_tool_test
