#include <gtest/gtest.h>

#include "libmap/core/table.h"
#include "libmap/mesh/mesh_io.h"
#include "tests/tools/tool_test_support.h"

namespace grasp_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::write_text;

// Bumps of 1 x 1 m.
void write_ground() {
  libmap::TriangleMesh mesh;
  constexpr int count = 101;
  for (int i = 0; i < count; ++i)
    for (int j = 0; j < count; ++j) {
      const double x = 0.01 * i - 0.5;
      const double y = 0.01 * j - 0.5;
      mesh.vertices.emplace_back(x, y, 0.05 * std::cos(31 * x) * std::cos(27 * y));
    }
  for (std::uint32_t i = 0; i + 1 < count; ++i)
    for (std::uint32_t j = 0; j + 1 < count; ++j) {
      const std::uint32_t n = i * count + j;
      mesh.triangles.push_back({n, n + count, n + count + 1});
      mesh.triangles.push_back({n, n + count + 1, n + 1});
    }
  libmap::write_mesh(scratch("ground.ply"), mesh);
  write_text(scratch("places.csv"),
             "place,x,y,z\nA,0,0,0.05\nB,0.2,0.1,-0.045\nC,-0.1,0.12,0.05\n");
}

const std::vector<std::string> usual = {"grasp",    "ground.ply", "--points", "places.csv",
                                        "--trials", "4",          "--draws",  "4"};

std::vector<std::string> with(std::vector<std::string> words) {
  words.insert(words.begin(), usual.begin(), usual.end());
  return words;
}

TEST(GraspCommand, TableManifestAndEvaluation) {
  write_ground();
  ASSERT_TRUE(succeeded(graspmap(with({"-o", "trials.csv", "--more-loads", "1,40"}))));
  const libmap::Table table = libmap::read_csv(scratch("trials.csv"));
  ASSERT_EQ(table.rows.size(), 3U);
  EXPECT_EQ(table.columns[0], "place");
  for (const char* name : {"graspable", "hold_probability", "force_median_n", "limiting_direction",
                           "unseen", "fails_load", "graspable_1", "hold_probability_40"})
    EXPECT_TRUE(table.find_column(name)) << name;
  for (std::size_t row = 0; row < 3; ++row) {
    const double probability = table.number(row, table.column("hold_probability"));
    EXPECT_EQ(table.number(row, table.column("graspable")), probability >= 0.5 ? 1 : 0);
    EXPECT_GE(table.number(row, table.column("hold_probability_1")), probability);
    EXPECT_LE(table.number(row, table.column("hold_probability_40")), probability);
  }
  const auto results = json_of("trials.csv.json").at("results");
  EXPECT_EQ(results.at("locations"), 3);
  EXPECT_EQ(results.at("parameters_sha256").get<std::string>().size(), 64U);
  ASSERT_TRUE(succeeded(graspmap(with({"-o", "other.csv", "--seed", "2"}))));
  EXPECT_EQ(json_of("other.csv.json").at("results").at("parameters_sha256"),
            results.at("parameters_sha256"));
  EXPECT_NE(content("other.csv"), content("trials.csv"));
  ASSERT_TRUE(succeeded(graspmap(with({"-o", "rough.csv", "--friction", "0.6"}))));
  EXPECT_NE(json_of("rough.csv.json").at("results").at("parameters_sha256"),
            results.at("parameters_sha256"));
  // The verdicts are a field test: beside a second run's probabilities.
  auto again = usual;
  again[3] = "trials.csv";
  for (const char* word : {"-o", "again.csv", "--seed", "2", "--load", "40", "--prefix", "again_"})
    again.emplace_back(word);
  ASSERT_TRUE(succeeded(graspmap(again)));
  ASSERT_TRUE(succeeded(graspmap({"evaluate", "again.csv", "-o", "evaluation", "--label",
                                  "graspable_1", "--score", "again_hold_probability"})));
}

TEST(GraspCommand, BadInputIsOneLine) {
  write_ground();
  const auto refused = [](const std::vector<std::string>& words,
                          const std::vector<std::string>& parts) {
    return bad_input(graspmap(with(words)), parts);
  };
  for (const auto& [flag, value] :
       {std::pair{"--friction", "-0.1"}, {"--load", "0"}, {"--more-loads", "x"}})
    EXPECT_TRUE(refused({"-o", "t.csv", flag, value}, {flag, value}));
  for (const char* flag : {"--trials", "--draws"})
    EXPECT_TRUE(bad_input(
        graspmap({"grasp", "ground.ply", "--points", "places.csv", "-o", "t.csv", flag, "0"}),
        {flag, "0"}));
  EXPECT_TRUE(refused({"-o", "t.txt"}, {"t.txt", ".csv"}));
  EXPECT_TRUE(refused({"-o", "t.csv", "--set", "gripper.fingers.count=0"}, {"fingers.count"}));
  EXPECT_TRUE(refused({"-o", "t.csv", "--set", "gripper.fingers.cuont=3"}, {"fingers.cuont"}));
  std::string gripper =
      graspmap_test::read_text(graspmap_test::source_folder() / "data/grippers/scar-e.yaml");
  write_text(scratch("palm.yaml"), gripper.substr(0, gripper.find("fingers:")));
  EXPECT_TRUE(refused({"-o", "t.csv", "--gripper", "palm.yaml"}, {"palm.yaml", "fingers"}));
  ASSERT_TRUE(succeeded(graspmap({"mask", "--gripper", "palm.yaml", "-o", "mask.txt"})));
  write_text(scratch("part.yaml"), gripper.substr(0, gripper.find("  curl_deg")));
  EXPECT_TRUE(
      refused({"-o", "t.csv", "--gripper", "part.yaml"}, {"part.yaml", "fingers.curl_deg"}));
  const auto on = [](const std::string& mesh, const std::string& places) {
    return graspmap({"grasp", mesh, "--points", places, "-o", "t.csv"});
  };
  write_text(scratch("off.csv"), "x,y,z\n0,0,0.05\n0,0,1\n");
  EXPECT_TRUE(bad_input(on("ground.ply", "off.csv"), {"off.csv", "location 2", "0.05 m"}));
  write_text(scratch("nan.csv"), "x,y,z\n0,nan,0.05\n");
  EXPECT_TRUE(bad_input(on("ground.ply", "nan.csv"), {"nan.csv", "row 1"}));
  write_text(scratch("none.csv"), "x,y,z\n");
  EXPECT_TRUE(bad_input(on("ground.ply", "none.csv"), {"none.csv"}));
  write_text(scratch("taken.csv"), "x,y,z,graspable\n0,0,0.05,1\n");
  EXPECT_TRUE(bad_input(on("ground.ply", "taken.csv"), {"taken.csv", "graspable"}));
  write_text(scratch("points.ply"),
             "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
             "property float z\nend_header\n0 0 0\n");
  EXPECT_TRUE(bad_input(on("points.ply", "places.csv"), {"points.ply"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("t.csv")));
}

}  // namespace grasp_test
