#include <gtest/gtest.h>

#include "libmap/core/table.h"
#include "libmap/io/mesh_io.h"
#include "tests/tools/tool_test_support.h"

namespace simulate_site_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::wrong_usage;

const char* const small_site =
    "ground: {size_x_m: 1.2, size_y_m: 1.2}\n"
    "layout: {site_size_m: 1, free_square_m: 0}\n"
    "field_points: {count: 8}\n"
    "rocks:\n"
    "  - {name: A, height_m: 0.3}\n"
    "  - {name: B, shape: cobble, height_m: 0.18}\n";

TEST(SimulateSite, MeshPointsAndSiteFile) {
  graspmap_test::write_text(scratch("mine.yaml"), small_site);
  ASSERT_TRUE(succeeded(graspmap(
      {"simulate", "site", "--site", "mine.yaml", "--edge-length", "0.02", "-o", "site"})));
  const libmap::TriangleMesh mesh = libmap::read_mesh(scratch("site/mesh.ply")).mesh;
  EXPECT_EQ(mesh.vertex_colors.size(), mesh.vertices.size());
  ASSERT_EQ(mesh.face_fields.size(), 1U);
  EXPECT_EQ(mesh.face_fields[0].name, "rock");
  const libmap::Table table = libmap::read_csv(scratch("site/field_points.csv"));
  ASSERT_EQ(table.rows.size(), 8U);
  EXPECT_FALSE(table.find_column("graspable"));
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    const Eigen::Vector3d point(table.number(row, table.column("x")),
                                table.number(row, table.column("y")),
                                table.number(row, table.column("z")));
    double nearest = 1.0;
    for (const Eigen::Vector3d& vertex : mesh.vertices)
      nearest = std::min(nearest, (vertex - point).norm());
    EXPECT_LT(nearest, 1e-4);
  }
  EXPECT_EQ(json_of("site.json").at("results").at("rocks"), 2);
}

TEST(SimulateSite, TheWrittenSiteFileMakesItAgain) {
  graspmap_test::write_text(scratch("mine.yaml"), small_site);
  const auto run = [](const char* site, const char* seed, const char* threads, const char* output) {
    return succeeded(graspmap({"simulate", "site", "--site", site, "--seed", seed, "--threads",
                               threads, "--edge-length", "0.03", "-o", output}));
  };
  ASSERT_TRUE(run("mine.yaml", "7", "1", "a"));
  ASSERT_TRUE(run("mine.yaml", "7", "4", "b"));
  ASSERT_TRUE(run("a/site.yaml", "0", "0", "c"));
  ASSERT_TRUE(run("mine.yaml", "8", "0", "d"));
  for (const char* file : {"mesh.ply", "field_points.csv", "site.yaml"}) {
    const std::string first = content(std::string("a/") + file);
    EXPECT_EQ(first, content(std::string("b/") + file)) << file;
    EXPECT_EQ(first, content(std::string("c/") + file)) << file;
    EXPECT_NE(first, content(std::string("d/") + file)) << file;
  }
}

TEST(SimulateSite, BadInputIsOneLine) {
  graspmap_test::write_text(scratch("bad.yaml"), "rocks:\n  - {height_m: 0.3, widht_m: 1}\n");
  graspmap_test::write_text(scratch("bare.yaml"), "ground: {size_x_m: 1}\n");
  const auto site = [](std::vector<std::string> words) {
    std::vector<std::string> all = {"simulate", "site"};
    all.insert(all.end(), words.begin(), words.end());
    return graspmap(all);
  };
  EXPECT_TRUE(bad_input(site({"--site", "bad.yaml", "-o", "out"}),
                        {.file = "bad.yaml", .field = "rocks[0].widht_m (line 2)"}));
  EXPECT_TRUE(bad_input(site({"--site", "rock", "-o", "out"}), {.field = "site", .value = "rock"}));
  EXPECT_TRUE(bad_input(site({"--site", "bare.yaml", "-o", "out"}),
                        {.file = "bare.yaml", .field = "rocks"}));
  EXPECT_TRUE(bad_input(site({"-o", "site.ply"}), {.file = "site.ply"}));
  EXPECT_TRUE(bad_input(site({"--edge-length", "0.0001", "-o", "out"}),
                        {.field = "edge_length_m", .value = "1e-04"}));
  EXPECT_TRUE(bad_input(site({"--edge-length", "0", "-o", "out"}),
                        {.field = "--edge-length", .value = "0", .bound = "> 0"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("out")));
}

TEST(SimulateSite, DryRunWritesNothing) {
  graspmap_test::write_text(scratch("mine.yaml"), small_site);
  ASSERT_TRUE(succeeded(graspmap({"simulate", "site", "--site", "mine.yaml", "--edge-length",
                                  "0.03", "--dry-run", "-o", "site"})));
  EXPECT_FALSE(std::filesystem::exists(scratch("site")));
}

}  // namespace simulate_site_test
