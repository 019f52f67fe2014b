// Sheets of several files, tables of several maps, and sections of masks by the commands.
#include <gtest/gtest.h>

#include "libgtd/gripper/gripper_io.h"
#include "libgtd/gripper/gripper_mask.h"
#include "libmap/camera/image_codec.h"
#include "libmap/core/table.h"
#include "libmap/io/cloud_io.h"
#include "tests/tools/tool_test_support.h"

namespace sheet_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::scratch;
using graspmap_test::succeeded;

void write_map(const char* name, const char* method) {
  graspmap_test::write_terrain();
  ASSERT_TRUE(succeeded(graspmap({"score", "terrain.pcd", "--method", method, "-o", name})));
}

TEST(Sheet, MapsAndImagesInOne) {
  write_map("a.pcd", "corrected");
  write_map("b.pcd", "thesis");
  ASSERT_TRUE(succeeded(graspmap({"render", "a.pcd", "-o", "c.png", "--width", "200"})));
  for (const char* name : {"one.png", "two.png"})
    ASSERT_TRUE(succeeded(graspmap({"render", "a.pcd", "b.pcd", "c.png", "-o", name, "--columns",
                                    "3", "--cell-width", "120", "--captions", "corrected|thesis"},
                                   {{"DISPLAY", ""}})));
  EXPECT_EQ(content("one.png"), content("two.png"));
  const libmap::ColorImage image = libmap::decode_color(content("one.png"));
  EXPECT_GT(image.width, 3 * 120);
  const auto manifest = graspmap_test::json_of("one.png.json");
  EXPECT_EQ(manifest["inputs"].size(), 3U);
  EXPECT_EQ(manifest["results"]["cells"], 3);
}

TEST(Sheet, BadInputIsOneLine) {
  write_map("a.pcd", "corrected");
  graspmap_test::write_text(scratch("broken.png"), "\x89PNG and no more");
  EXPECT_TRUE(bad_input(graspmap({"render", "none.pcd", "-o", "s.png"}), {.file = "none.pcd"}));
  EXPECT_TRUE(bad_input(graspmap({"render", "broken.png", "-o", "s.png"}),
                        {.file = "broken.png", .field = "extension", .value = ".png"}));
  graspmap_test::write_text(scratch("empty.csv"), "x,y,z\n");
  EXPECT_TRUE(
      bad_input(graspmap({"render", "a.pcd", "empty.csv", "-o", "s.png"}), {.file = "empty.csv"}));
  EXPECT_TRUE(bad_input(graspmap({"render", "a.pcd", "-o", "s.jpg"}), {.file = "s.jpg"}));
  EXPECT_TRUE(bad_input(graspmap({"render", "a.pcd", "-o", "s.png", "--captions", "a|b"}),
                        {.field = "--captions", .value = "2", .bound = "<= 1"}));
  EXPECT_TRUE(bad_input(graspmap({"render", "a.pcd", "-o", "s.png", "--row-titles", "a|b"}),
                        {.field = "row_titles", .value = "2", .bound = "<= 1"}));
  EXPECT_TRUE(bad_input(graspmap({"render", "a.pcd", "-o", "a.pcd"}), {.file = "a.pcd"}));
  for (const auto& [flag, name] :
       {std::pair{"--no-legend", "--legend"}, std::pair{"--no-axes", "--axes"},
        std::pair{"--width=300", "--width"}, std::pair{"--camera-target=1,2,3", "--camera-target"}})
    EXPECT_TRUE(
        bad_input(graspmap({"render", "a.pcd", "a.pcd", "-o", "s.png", flag}), {.field = name}));
  EXPECT_FALSE(std::filesystem::exists(scratch("s.png")));
}

TEST(Summarize, TablesOfTwoMaps) {
  write_map("a.pcd", "corrected");
  write_map("b.pcd", "thesis");
  graspmap_test::write_text(scratch("e.csv"),
                            "region,x,y,z,to_x,to_y,to_z,radius,graspable,why\n"
                            "left,-0.1,0,0,,,,0.05,1,\nright,0.1,0,0,,,,0.05,0,\n");
  ASSERT_TRUE(succeeded(graspmap({"analyze", "a.pcd", "b.pcd", "a.pcd", "-o", "sum", "--names",
                                  "a|b", "--pairs", "--expected", "e.csv"})));
  const libmap::Table maps = libmap::read_csv(scratch("sum/maps.csv"));
  ASSERT_EQ(maps.rows.size(), 3U);
  EXPECT_EQ(maps.rows[1][0], "b");
  EXPECT_EQ(maps.rows[1][maps.column("method")], "thesis");
  EXPECT_EQ(maps.rows[2][0], "a.pcd");
  EXPECT_EQ(maps.rows[0][maps.column("solid_voxel_threshold")], "120");
  EXPECT_GT(maps.number(0, maps.column("voxel_positives")), 20.0);
  const libmap::Table regions = libmap::read_csv(scratch("sum/regions.csv"));
  EXPECT_EQ(regions.rows.size(), 6U);
  const libmap::Table pairs = libmap::read_csv(scratch("sum/pairs.csv"));
  ASSERT_EQ(pairs.rows.size(), 3U);
  // A map agrees with itself in all.
  EXPECT_EQ(pairs.number(1, pairs.column("accuracy")), 1.0);
  EXPECT_EQ(pairs.number(1, pairs.column("score_difference_rms")), 0.0);
}

TEST(Summarize, BadInputIsOneLine) {
  write_map("a.pcd", "corrected");
  graspmap_test::write_text(scratch("e.csv"), "region,x,y,z\n");
  EXPECT_TRUE(bad_input(graspmap({"analyze", "terrain.pcd", "-o", "sum"}),
                        {.file = "terrain.pcd", .field = "score"}));
  EXPECT_TRUE(bad_input(graspmap({"analyze", "a.pcd", "-o", "sum", "--expected", "e.csv"}),
                        {.file = "e.csv", .field = "graspable"}));
  EXPECT_TRUE(bad_input(graspmap({"analyze", "a.pcd", "a.pcd", "-o", "sum", "--cutoff", "high"}),
                        {.file = "a.pcd", .field = "--cutoff", .value = "high"}));
  EXPECT_TRUE(bad_input(graspmap({"analyze", "a.pcd", "a.pcd", "-o", "sum", "--names", "a|b|c"}),
                        {.field = "--names", .value = "3", .bound = "<= 2"}));
  for (const auto& [name, value] : {std::pair{"--cutoff", "0.5"}, std::pair{"--names", "a"},
                                    std::pair{"--varied", "solid_voxel_threshold"}})
    EXPECT_TRUE(
        bad_input(graspmap({"analyze", "a.pcd", "-o", "sum", name, value}), {.field = name}));
  EXPECT_TRUE(bad_input(graspmap({"analyze", "a.pcd", "a.pcd", "-o", "sum", "--stride", "0.4"}),
                        {.field = "--stride"}));
  EXPECT_TRUE(
      bad_input(graspmap({"analyze", "a.pcd", "a.pcd", "-o", "sum", "--varied", "none", "--quiet"}),
                {.file = "maps.csv", .field = "column 'none'"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("sum")));
}

TEST(Summarize, ChartsOfTheVariedParameter) {
  write_map("a.pcd", "corrected");
  write_map("b.pcd", "thesis");
  graspmap_test::write_text(scratch("e.csv"),
                            "region,x,y,z,to_x,to_y,to_z,radius,graspable,why\n"
                            "left,-0.1,0,0,,,,0.05,1,\nright,0.1,0,0,,,,0.05,0,\n");
  ASSERT_TRUE(succeeded(graspmap({"analyze", "a.pcd", "b.pcd", "-o", "sum", "--expected", "e.csv",
                                  "--varied", "solid_voxel_threshold", "--series", "method"})));
  for (const char* name : {"histograms", "graspable_share", "voxel_youden", "place_youden"}) {
    const std::string svg = content("sum/" + std::string(name) + ".svg");
    const bool of_maps = name == std::string("histograms");
    EXPECT_NE(svg.find(of_maps ? "a.pcd" : "corrected"), std::string::npos) << name;
    EXPECT_FALSE(libmap::decode_color(content("sum/" + std::string(name) + ".png")).empty());
  }
}

TEST(Summarize, PairsThatLieApartAreNamed) {
  write_map("a.pcd", "corrected");
  libmap::PointCloud far = graspmap_test::bumpy_terrain();
  for (Eigen::Vector3d& point : far.positions) point.x() += 8.0;
  libmap::write_cloud(scratch("far.pcd"), far);
  ASSERT_TRUE(succeeded(graspmap({"score", "far.pcd", "-o", "b.pcd"})));
  ASSERT_TRUE(succeeded(graspmap({"analyze", "a.pcd", "b.pcd", "-o", "sum"})));
  const graspmap_test::ProgramResult result = graspmap(
      {"analyze", "a.pcd", "b.pcd", "-o", "pairs", "--names", "|far", "--pairs", "--quiet"});
  EXPECT_TRUE(bad_input(result, {.file = "a.pcd and far"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("pairs")));
}

bool near(const libmap::Color& a, const libmap::Color& b) {
  int difference = 0;
  for (std::size_t c = 0; c < 3; ++c) difference = std::max(difference, std::abs(a[c] - b[c]));
  return difference <= 2;
}

// The squares of the sections, found in the image by their colors alone, against the mask.
TEST(Mask, SectionsShowTheMask) {
  ASSERT_TRUE(succeeded(graspmap(
      {"mask", "--method", "envelope", "--sections", "--cell-width", "400", "-o", "s.png"})));
  const libmap::ColorImage image = libmap::decode_color(content("s.png"));
  const auto mask = libgtd::make_gripper_mask(
      libgtd::read_gripper(graspmap_test::source_folder() / "data/grippers/scar-e.yaml"),
      {.method = libgtd::Method::envelope, .voxel_size_m = 0.01, .extra_void_layers = 1});
  const libmap::Color solid{0, 114, 178};
  const libmap::Color pale_solid{150, 200, 226};
  const libmap::Color empty{205, 211, 218};
  const libmap::Color pale_empty{252, 240, 214};
  const libmap::Color pivot{213, 94, 0};
  const auto is_voxel = [&](const libmap::Color& color) {
    return near(color, solid) || near(color, pale_solid) || near(color, empty) ||
           near(color, pale_empty) || near(color, pivot);
  };
  // Cells of 400 pixels, 10 apart and from the left; the legend is to the right of them.
  constexpr int cell_step = 410;
  const auto bounds_from = [&](int left, int right) {
    std::array<int, 4> box{10000, -1, 10000, -1};
    for (int y = 0; y < image.height; ++y)
      for (int x = left; x < right; ++x) {
        if (!is_voxel(image.at(x, y))) continue;
        box = {std::min(box[0], x), std::max(box[1], x), std::min(box[2], y), std::max(box[3], y)};
      }
    return box;
  };
  for (int cell = 0; cell < 3; ++cell) {
    const auto [left, right, top, bottom] =
        bounds_from(10 + cell * cell_step, (cell + 1) * cell_step);
    const int rows = cell == 0 ? mask.layers : mask.side;
    const double pitch = (right - left + 1.0) / mask.side;
    EXPECT_NEAR((bottom - top + 1.0) / rows, pitch, 0.2);
    for (int u = 0; u < mask.side; ++u) {
      for (int v = 0; v < rows; ++v) {
        const int y = cell == 0 ? mask.pivot_xy : v;
        const int z = cell == 0 ? v : (cell == 1 ? mask.solid_layers - 1 : 0);
        const bool counted = mask.is_counted(u, y, z);
        libmap::Color wanted = mask.is_solid(u, y, z) ? (counted ? solid : pale_solid)
                                                      : (counted ? empty : pale_empty);
        if (u == mask.pivot_xy && y == mask.pivot_xy && z == mask.pivot_z) wanted = pivot;
        const libmap::Color found = image.at(static_cast<int>(left + (u + 0.5) * pitch),
                                             static_cast<int>(bottom + 1 - (v + 0.5) * pitch));
        ASSERT_TRUE(near(found, wanted)) << cell << ": " << u << ", " << v;
      }
    }
  }
}

TEST(Mask, SectionsBadInput) {
  EXPECT_TRUE(bad_input(graspmap({"mask", "--sections", "-o", "m.txt"}), {.file = "m.txt"}));
  EXPECT_TRUE(bad_input(graspmap({"mask", "--sections", "--section-layer", "99", "-o", "m.png"}),
                        {.field = "section_layer", .value = "99", .bound = ">= 0 and <= 9"}));
}

TEST(Mask, OptionsOfAnotherOutputAreRefused) {
  EXPECT_TRUE(bad_input(graspmap({"mask", "--section-layer", "2", "-o", "m.png"}),
                        {.field = "--section-layer"}));
  EXPECT_TRUE(bad_input(graspmap({"mask", "--cell-width", "99", "-o", "m.png"}),
                        {.field = "--cell-width"}));
  EXPECT_TRUE(bad_input(graspmap({"mask", "--view", "top", "-o", "m.txt"}), {.field = "--view"}));
  EXPECT_TRUE(bad_input(graspmap({"mask", "--sections", "--view", "top", "-o", "m.png"}),
                        {.field = "--view"}));
}

TEST(Sheet, HowPlacesAreMarkedNeedsPlaces) {
  graspmap_test::write_terrain();
  for (const auto& [name, value] :
       {std::pair{"--verdict", "graspable"}, std::pair{"--label", "none"},
        std::pair{"--points-frame", "map"}})
    EXPECT_TRUE(bad_input(graspmap({"render", "terrain.pcd", name, value, "-o", "s.png"}),
                          {.file = "terrain.pcd", .field = name, .about = "--points"}));
}

}  // namespace sheet_test
