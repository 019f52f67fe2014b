#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "libmap/io/mesh_io.h"
#include "tests/tools/tool_test_support.h"

namespace grasp_scenes_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::ProgramResult;
using graspmap_test::scratch;
using graspmap_test::succeeded;

// Flat ground and three places on it.
void make_site() {
  graspmap_test::write_text(scratch("floor.off"),
                            "OFF\n4 2 0\n-1 -1 0\n1 -1 0\n1 1 0\n-1 1 0\n3 0 1 2\n3 0 2 3\n");
  graspmap_test::write_text(scratch("points.csv"),
                            "place,x,y,z\nP1,0,0,0\nP2,0.2,0,0\nA/B,0,0.2,0\n");
}

ProgramResult grasp(const std::vector<std::string>& more) {
  std::vector<std::string> words = {"grasp", "floor.off", "--points", "points.csv", "-o",
                                    "t.csv", "--trials",  "2",        "--draws",    "2"};
  words.insert(words.end(), more.begin(), more.end());
  return graspmap(words);
}

std::vector<std::string> names_in(const std::string& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(scratch(folder)))
    names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

TEST(GraspScenes, OneForEachPlace) {
  make_site();
  ASSERT_TRUE(succeeded(grasp({})));
  const std::string plain = content("t.csv");
  ASSERT_TRUE(succeeded(grasp({"--scenes", "scenes"})));
  EXPECT_EQ(content("t.csv"), plain);
  EXPECT_EQ(names_in("scenes"), (std::vector<std::string>{"A_B.ply", "P1.ply", "P2.ply"}));
  const libmap::TriangleMesh scene = libmap::read_mesh(scratch("scenes/P1.ply")).mesh;
  EXPECT_EQ(scene.vertex_colors.size(), scene.vertices.size());
  const std::string result = json_of("scenes.json").at("results").at("A_B.ply");
  EXPECT_NE(result.find("hold"), std::string::npos);
  EXPECT_NE(result.find("the load is 5 N"), std::string::npos);
  // The bytes do not depend on the number of threads.
  ASSERT_TRUE(succeeded(grasp({"--scenes", "again", "--threads", "1"})));
  for (const std::string name : {"A_B.ply", "P1.ply", "P2.ply"})
    EXPECT_TRUE(content("scenes/" + name) == content("again/" + name)) << name;
}

TEST(GraspScenes, OfListedPlacesOrRows) {
  make_site();
  ASSERT_TRUE(succeeded(grasp({"--scenes", "scenes", "--scene-locations", "P2,A/B"})));
  EXPECT_EQ(names_in("scenes"), (std::vector<std::string>{"A_B.ply", "P2.ply"}));
  graspmap_test::write_text(scratch("points.csv"), "x,y,z\n0,0,0\n0.2,0,0\n");
  ASSERT_TRUE(succeeded(grasp({"--scenes", "rows", "--scene-of", "2"})));
  EXPECT_EQ(names_in("rows"), std::vector<std::string>{"2.ply"});
  ASSERT_TRUE(succeeded(grasp({"--scenes", "dry", "--dry-run"})));
  EXPECT_FALSE(std::filesystem::exists(scratch("dry")));
}

TEST(GraspScenes, BadInputIsOneLineAndWritesNothing) {
  make_site();
  EXPECT_TRUE(bad_input(grasp({"--scenes", "scenes", "--scene-locations", "P3"}),
                        {.file = "points.csv", .field = "--scene-locations", .value = "P3"}));
  EXPECT_TRUE(bad_input(grasp({"--scene-locations", "P1"}),
                        {.field = "--scene-locations", .about = "--scenes"}));
  graspmap_test::write_text(scratch("points.csv"), "place,x,y,z\nA/B,0,0,0\nA:B,0.2,0,0\n");
  EXPECT_TRUE(bad_input(grasp({"--scenes", "scenes"}),
                        {.file = "points.csv", .field = "place", .value = "'A:B'"}));
  EXPECT_TRUE(succeeded(grasp({"--scenes", "one", "--scene-locations", "A:B"})));
  std::string many = "x,y,z\n";
  for (int n = 0; n < 101; ++n) many += "0,0,0\n";
  graspmap_test::write_text(scratch("points.csv"), many);
  EXPECT_TRUE(
      bad_input(grasp({"--scenes", "scenes"}),
                {.file = "points.csv", .field = "locations", .value = "101", .bound = "<= 100"}));
  make_site();
  std::filesystem::create_directory(scratch("mine"));
  graspmap_test::write_text(scratch("mine/a.txt"), "mine");
  EXPECT_TRUE(bad_input(grasp({"--scenes", "mine"}), {.file = "mine"}));
  graspmap_test::write_text(scratch("file"), "mine");
  EXPECT_TRUE(bad_input(grasp({"--scenes", "file"}), {.file = "file"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("scenes")));
}

TEST(GraspScenes, AreDrawnAndShownInTheReport) {
  make_site();
  std::filesystem::create_directory(scratch("run"));
  ASSERT_TRUE(succeeded(grasp({"--scenes", "run/scenes", "--scene-locations", "P1"})));
  ASSERT_TRUE(succeeded(graspmap({"render", "run/scenes/P1.ply", "--view", "oblique", "--width",
                                  "400", "--height", "300", "-o", "p.png"})));
  // Another mesh in the folder is not a scene.
  std::filesystem::copy_file(scratch("run/scenes/P1.ply"), scratch("run/scenes/other.ply"));
  ASSERT_TRUE(succeeded(graspmap({"report", "run"})));
  const std::string html = content("run/report.html");
  EXPECT_NE(html.find("P1: "), std::string::npos);
  EXPECT_NE(html.find("\"mesh\":"), std::string::npos);
  EXPECT_EQ(html.find("\"mesh\":"), html.rfind("\"mesh\":"));
  EXPECT_NE(html.find("contact by spines</li>"), std::string::npos);
  EXPECT_NE(html.find("OrbitControls"), std::string::npos);
  ASSERT_TRUE(succeeded(graspmap({"report", "run", "--no-3d", "-o", "flat.html"})));
  EXPECT_EQ(content("flat.html").find("<canvas"), std::string::npos);
  // A broken scene is reported.
  graspmap_test::write_text(scratch("run/scenes/P1.ply"), "ply\n");
  ASSERT_TRUE(succeeded(graspmap({"report", "run", "-o", "broken.html"})));
  EXPECT_NE(content("broken.html").find("P1.ply</code> cannot be shown"), std::string::npos);
}

}  // namespace grasp_scenes_test
