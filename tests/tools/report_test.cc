#include <gtest/gtest.h>

#include <filesystem>

#include "tests/tools/tool_test_support.h"

namespace report_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::write_terrain;
using graspmap_test::wrong_usage;

// run/map.pcd with two looked-up points.
void make_run() {
  write_terrain();
  std::filesystem::create_directories(scratch("run/inner"));
  graspmap_test::write_text(scratch("points.csv"),
                            "place,x,y,z,graspable\nP<1>,0,0,0,1\nP2,0.1,0,0,0\n");
  ASSERT_TRUE(succeeded(graspmap({"score", "terrain.pcd", "-o", "run/map.pcd", "--frame", "input",
                                  "--solid-voxel-threshold", "1"})));
  ASSERT_TRUE(succeeded(graspmap({"lookup", "run/map.pcd", "points.csv", "-o", "run/lookup.csv"})));
}

TEST(Report, OfARun) {
  make_run();
  ASSERT_TRUE(succeeded(graspmap({"report", "run", "--title", "A & B"})));
  const std::string html = content("run/report.html");
  EXPECT_NE(html.find("<h1>A &amp; B</h1>"), std::string::npos);
  EXPECT_NE(html.find("P&lt;1&gt;"), std::string::npos);
  EXPECT_NE(html.find("OrbitControls"), std::string::npos);
  EXPECT_NE(html.find("Permission is hereby granted"), std::string::npos);
  EXPECT_EQ(html.find("src=\"http"), std::string::npos);
  EXPECT_EQ(json_of("run/report.html.json").at("results").at("bytes"), html.size());
  // The bytes are equal, and the first report is not part of the second.
  ASSERT_TRUE(succeeded(graspmap({"report", "run", "--title", "A & B", "--threads", "1"})));
  EXPECT_EQ(content("run/report.html"), html);
}

TEST(Report, LargeMapsAreDownsampled) {
  make_run();
  ASSERT_TRUE(succeeded(
      graspmap({"report", "run", "-o", "r.html", "--max-cells", "500", "--max-size-mb", "1.5"})));
  const std::string html = content("r.html");
  EXPECT_NE(html.find("one voxel shown for each cube of"), std::string::npos);
  EXPECT_LE(html.size(), 1'500'000U);
}

// A store is downsampled tile by tile to the cells of the same map in one file, walls included.
TEST(Report, AStoreIsShownAsItsMap) {
  std::string corner = "x,y,z\n";
  for (int a = 0; a < 120; ++a)
    for (int b = 0; b < 120; ++b)
      corner += std::to_string(0.01 * a) + "," + std::to_string(0.01 * b) + ",0\n" +
                std::to_string(0.01 * a) + ",1.2," + std::to_string(0.01 * b) + "\n";
  graspmap_test::write_text(scratch("corner.csv"), corner);
  const auto view_of = [](const std::string& folder, const std::string& map) {
    std::filesystem::create_directories(scratch(folder));
    EXPECT_TRUE(succeeded(
        graspmap({"score", "corner.csv", "-o", folder + "/" + map, "--method", "corrected",
                  "--plane", "none", "--curvature-radius", "0", "--tile-size", "0.25"})));
    EXPECT_TRUE(
        succeeded(graspmap({"report", folder, "-o", folder + ".html", "--max-cells", "2000"})));
    const std::string html = content(folder + ".html");
    const std::size_t begin = html.find("class=\"map-data\">");
    EXPECT_NE(begin, std::string::npos);
    return html.substr(begin, html.find("</script>", begin) - begin);
  };
  const std::string view = view_of("file", "map.pcd");
  EXPECT_GT(view.size(), 2000U);
  EXPECT_TRUE(view_of("store", "map.tiles") == view);
}

TEST(Report, TheRemovedOutlineNamesTheNewWay) {
  make_run();
  EXPECT_TRUE(wrong_usage(graspmap({"report", "run", "--outline", "study", "-o", "r.html"}),
                          {"--outline"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("r.html")));
}

TEST(Report, WithoutThreeJs) {
  make_run();
  EXPECT_TRUE(bad_input(graspmap({"report", "run", "-o", "r.html", "--three", "none"}),
                        {.file = "none/three.min.js", .about = "--no-3d"}));
  ASSERT_TRUE(succeeded(graspmap({"report", "run", "-o", "r.html", "--three", "none", "--no-3d"})));
  EXPECT_EQ(content("r.html").find("<canvas"), std::string::npos);
  EXPECT_NE(content("r.html").find("P&lt;1&gt;"), std::string::npos);
}

TEST(Report, BadInputIsSaid) {
  EXPECT_TRUE(bad_input(graspmap({"report", "none", "-o", "r.html"}), {.file = "none"}));
  std::filesystem::create_directory(scratch("empty"));
  EXPECT_TRUE(bad_input(graspmap({"report", "empty"}), {.file = "empty"}));
  graspmap_test::write_text(scratch("empty/a.txt"), "text");
  EXPECT_TRUE(bad_input(graspmap({"report", "empty", "-o", "r.pdf"}), {.file = "r.pdf"}));
  EXPECT_TRUE(bad_input(graspmap({"report", "empty", "--max-size-mb", "0.1"}),
                        {.field = "--max-size-mb", .value = "0.1", .bound = ">= 1 and <= 1000"}));
  EXPECT_TRUE(succeeded(graspmap({"report", "empty"})));
}

}  // namespace report_test
