// Commands whose outputs are folders of tiles.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "libmap/camera/image_codec.h"
#include "libmap/geometry/spatial_index.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "libmap/texture/textured_mesh_io.h"
#include "tests/tools/tool_test_support.h"

namespace mesh_tiles_test {

namespace fs = std::filesystem;

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::data_folder;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using Words = std::vector<std::string>;

const Words mesh_of_terrain = {"mesh",        "terrain", "-o",          "surface",
                               "--cell-size", "0.03",    "--tile-size", "1.5"};

void simulate_terrain() {
  ASSERT_TRUE(succeeded(graspmap({"simulate", "terrain", "--size", "3x2", "--spacing", "0.03",
                                  "--tile-size", "1", "-o", "terrain"})));
}

std::size_t files_in(const std::string& folder) {
  const fs::directory_iterator entries(scratch(folder));
  return static_cast<std::size_t>(std::distance(begin(entries), end(entries)));
}

TEST(Pieces, FromTerrainToMap) {
  simulate_terrain();
  ASSERT_TRUE(succeeded(graspmap(mesh_of_terrain)));
  EXPECT_EQ(files_in("surface"), 10U);
  ASSERT_TRUE(succeeded(graspmap({"mesh", "terrain", "-o", "whole.ply", "--cell-size", "0.03"})));
  const nlohmann::json whole = json_of("whole.ply.json").at("results");
  const nlohmann::json parts = json_of("surface.json").at("results");
  for (const char* name : {"points", "triangles"}) EXPECT_EQ(parts.at(name), whole.at(name));
  EXPECT_NEAR(parts.at("area_m2"), whole.at("area_m2"), 1e-6);
  // A folder of tiles is read as one mesh, with duplicate vertices on seams.
  EXPECT_EQ(libmap::read_mesh(scratch("surface")).mesh.vertices.size(), parts.at("vertices"));
  EXPECT_GT(parts.at("vertices"), whole.at("vertices"));
  EXPECT_EQ(json_of("surface.json").at("inputs").size(), 12U);

  ASSERT_TRUE(succeeded(
      graspmap({"crop", "surface", "-o", "site", "--level", "none", "--box", "0.2,0.1,1.4,1.9"})));
  EXPECT_EQ(files_in("site"), 2U);
  EXPECT_NEAR(json_of("site.json").at("results").at("size_m").at(0), 1.2, 1e-6);
  ASSERT_TRUE(succeeded(graspmap({"resample", "site", "-o", "samples", "--radius", "0.02"})));
  const libmap::PointCloud samples = libmap::read_cloud(scratch("samples")).cloud;
  const nlohmann::json results = json_of("samples.json").at("results");
  EXPECT_EQ(samples.size(), results.at("points"));
  EXPECT_GE(results.at("smallest_distance_m"), 0.02);
  const libmap::PointTree tree(samples.positions);
  for (const Eigen::Vector3d& position : samples.positions)
    ASSERT_GE(tree.nearest(position, 2)[1].square_m2, 0.02 * 0.02);
  EXPECT_TRUE(succeeded(graspmap({"score", "samples", "-o", "map.pcd", "--voxel-size", "0.03"})));
}

TEST(Pieces, FoldersAreReplacedWholeAndForeignOnesAreNot) {
  simulate_terrain();
  ASSERT_TRUE(succeeded(graspmap(mesh_of_terrain)));
  Words larger = mesh_of_terrain;
  larger.back() = "4";
  ASSERT_TRUE(succeeded(graspmap(larger)));
  EXPECT_EQ(files_in("surface"), 3U);
  std::ofstream(scratch("surface") / "notes.txt") << "mine";
  EXPECT_TRUE(bad_input(graspmap(larger), {.file = "surface"}));
  EXPECT_EQ(files_in("surface"), 4U);
  EXPECT_TRUE(bad_input(graspmap({"mesh", "terrain", "-o", "terrain", "--cell-size", "0.03"}),
                        {.file = "terrain"}));
  EXPECT_TRUE(bad_input(graspmap({"mesh", "terrain", "-o", "other"}),
                        {.field = "cell_size_m", .value = "0", .bound = "> 0"}));
  EXPECT_TRUE(
      bad_input(graspmap({"mesh", "terrain", "-o", "other", "--cell-size", "0.03", "--report"}),
                {.field = "--report"}));
  EXPECT_TRUE(bad_input(graspmap({"resample", "surface", "-o", "other", "--count", "100"}),
                        {.field = "count", .value = "100", .bound = "0"}));
  EXPECT_FALSE(fs::exists(scratch("other")));
}

TEST(Pieces, FusedCloudIsThatOfOneFile) {
  GRASPMAP_REQUIRE_DATA();
  const std::string scan = data_folder() / "scans" / "site_tiny_q.db";
  ASSERT_TRUE(succeeded(graspmap({"fuse", scan, "-o", "cloud.pcd"})));
  ASSERT_TRUE(succeeded(graspmap({"fuse", scan, "-o", "cloud", "--tile-size", "1"})));
  EXPECT_GT(files_in("cloud"), 4U);
  const auto sorted = [](const std::string& path) {
    std::vector<std::array<double, 4>> rows;
    const libmap::PointCloud cloud = libmap::read_cloud(scratch(path)).cloud;
    for (std::size_t n = 0; n < cloud.size(); ++n) {
      const Eigen::Vector3d& place = cloud.positions[n];
      rows.push_back({place.x(), place.y(), place.z(), cloud.fields[1].values[n]});
    }
    std::sort(rows.begin(), rows.end());
    return rows;
  };
  EXPECT_EQ(sorted("cloud"), sorted("cloud.pcd"));
  EXPECT_EQ(json_of("cloud.json").at("results").at("points"),
            json_of("cloud.pcd.json").at("results").at("points"));
}

TEST(Pieces, OneModelPerPiece) {
  GRASPMAP_REQUIRE_DATA();
  const std::string scan = data_folder() / "scans" / "site_tiny_q.db";
  ASSERT_TRUE(succeeded(graspmap(
      {"fuse", scan, "-o", "cloud", "--tile-size", "2", "--corrected-poses", "poses.tum"})));
  ASSERT_TRUE(succeeded(
      graspmap({"mesh", "cloud", "-o", "mesh", "--cell-size", "0.03", "--tile-size", "2"})));
  Words texture = {"texture", "mesh", "--scan", scan, "--poses", "poses.tum", "-o", "model"};
  ASSERT_TRUE(succeeded(graspmap(texture)));
  EXPECT_EQ(files_in("model"), files_in("mesh"));
  const nlohmann::json results = json_of("model.json").at("results");
  EXPECT_EQ(results.at("tiles"), files_in("mesh"));
  EXPECT_EQ(json_of("model.json").at("inputs").size(), files_in("mesh") + 2);
  std::size_t triangles = 0;
  std::size_t pages = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(scratch("model"))) {
    const libmap::TexturedMesh model = libmap::read_textured_mesh(entry.path());
    triangles += model.mesh.triangles.size();
    pages += model.pages.size();
  }
  EXPECT_EQ(results.at("triangles"), triangles);
  EXPECT_EQ(results.at("pages"), pages);
  EXPECT_EQ(json_of("mesh.json").at("results").at("triangles").get<std::size_t>() +
                results.at("triangles_by_cutting").get<std::size_t>(),
            triangles);
  for (const std::string share : {"2/2", "1/2"})
    ASSERT_TRUE(succeeded(graspmap({"fuse", scan, "-o", "cloud_in_shares", "--tile-size", "2",
                                    "--tile", share, "--corrected-poses", "again.tum"})));
  graspmap_test::expect_same_tiles("cloud_in_shares", "cloud");
  EXPECT_EQ(content("again.tum"), content("poses.tum"));
  texture.back() = "shared";
  for (const std::string share : {"2/3", "3/3", "1/3"}) {
    EXPECT_FALSE(fs::exists(scratch("shared")));
    Words words = texture;
    words.insert(words.end(), {"--tile", share});
    ASSERT_TRUE(succeeded(graspmap(words)));
  }
  graspmap_test::expect_same_tiles("shared", "model");
  // The image equals that of the model in one file.
  texture.back() = "model.glb";
  ASSERT_TRUE(succeeded(graspmap(texture)));
  for (const std::string name : {"model", "model.glb"})
    ASSERT_TRUE(succeeded(graspmap({"render", name, "--color", "texture", "--width", "320",
                                    "--height", "240", "-o", name + ".png"})));
  const libmap::ColorImage a = libmap::decode_color(content("model.png"));
  const libmap::ColorImage b = libmap::decode_color(content("model.glb.png"));
  ASSERT_EQ(a.pixels.size(), b.pixels.size());
  std::size_t different = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i)
    different += std::abs(a.pixels[i][0] - b.pixels[i][0]) > 8 ? 1 : 0;
  EXPECT_LT(different, a.pixels.size() / 100);
}

}  // namespace mesh_tiles_test
