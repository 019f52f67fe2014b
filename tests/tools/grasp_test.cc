#include <gtest/gtest.h>

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <thread>

#include "libmap/cloud/cloud_io.h"
#include "libmap/core/table.h"
#include "libmap/core/text.h"
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

// A map of the ground, as voxels of 4 cm, in a terrain frame that is turned and moved. The ground's
// squares of 1 m are four tiles.
const libmap::PointCloud& write_map() {
  static libmap::PointCloud map;
  write_ground();
  const auto cloud = libmap::read_cloud(scratch("ground.ply")).cloud;
  libmap::write_cloud(scratch("terrain.pcd"), cloud);
  EXPECT_TRUE(succeeded(graspmap(
      {"score", "terrain.pcd", "--voxel-size", "0.04", "--up", "0,0,1", "-o", "map.pcd"})));
  map = libmap::read_cloud(scratch("map.pcd")).cloud;
  return map;
}

std::vector<std::string> map_words(const std::string& output,
                                   const std::vector<std::string>& more = {}) {
  std::vector<std::string> words = {"grasp", "ground.ply", "--map", "map.pcd",     "-o",
                                    output,  "--trials",   "8",     "--map-draws", "2"};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

TEST(GraspCommand, EveryVoxelOfAMap) {
  const libmap::PointCloud map = write_map();
  ASSERT_GT(map.size(), 300u);
  ASSERT_TRUE(succeeded(graspmap(map_words("held.pcd", {"--sequential", "off"}))));
  EXPECT_FALSE(std::filesystem::exists(scratch("held.pcd.progress")));
  const libmap::PointCloud held = libmap::read_cloud(scratch("held.pcd")).cloud;
  EXPECT_EQ(held.positions, map.positions);
  EXPECT_EQ(held.colors, map.colors);
  ASSERT_EQ(held.fields.size(), map.fields.size() + 5);
  for (std::size_t n = 0; n < map.fields.size(); ++n) EXPECT_EQ(held.fields[n], map.fields[n]);
  const char* names[] = {"hold_probability", "holding_force_n", "limiting_direction",
                         "grasp_unseen", "grasp_trials"};
  for (std::size_t n = 0; n < 5; ++n) {
    EXPECT_EQ(held.fields[map.fields.size() + n].name, names[n]);
    EXPECT_EQ(held.fields[map.fields.size() + n].type, libmap::ScalarType::float32);
  }
  const auto value = [&](const char* name, std::size_t n) {
    return held.find_field(name)->values[n];
  };
  // The same as at the voxels' centers in the mesh's frame.
  const auto manifest = libmap::read_manifest_of(scratch("held.pcd"));
  const libmap::Pose* terrain_from_input = manifest->find_transform("terrain_from_input");
  ASSERT_NE(terrain_from_input, nullptr);
  EXPECT_FALSE(terrain_from_input->isApprox(libmap::Pose::Identity(), 1e-6));
  std::string places = "x,y,z\n";
  std::vector<std::size_t> voxels;
  std::size_t held_count = 0;
  for (std::size_t n = 0; n < held.size(); ++n) {
    held_count += value("hold_probability", n) >= 0.5 ? 1 : 0;
    if (value("grasp_trials", n) == 0) {
      for (const char* name : {"hold_probability", "holding_force_n", "grasp_unseen"})
        EXPECT_EQ(value(name, n), 0);
      EXPECT_EQ(value("limiting_direction", n), -1);
      continue;
    }
    EXPECT_EQ(value("grasp_trials", n), 16);
    // Without any force there is no direction.
    EXPECT_TRUE(value("limiting_direction", n) >= 0 || value("holding_force_n", n) == 0);
    if (n % 40 != 0) continue;
    voxels.push_back(n);
    const Eigen::Vector3d place = terrain_from_input->inverse() * held.positions[n];
    places += libmap::to_text(place.x()) + "," + libmap::to_text(place.y()) + "," +
              libmap::to_text(place.z()) + "\n";
  }
  EXPECT_GT(held_count, 10u);
  EXPECT_EQ(manifest->find_result("grasp_holding") != nullptr, true);
  write_text(scratch("voxels.csv"), places);
  ASSERT_TRUE(succeeded(graspmap({"grasp", "ground.ply", "--points", "voxels.csv", "-o", "v.csv",
                                  "--trials", "8", "--draws", "2"})));
  const libmap::Table table = libmap::read_csv(scratch("v.csv"));
  ASSERT_EQ(table.rows.size(), voxels.size());
  for (std::size_t row = 0; row < voxels.size(); ++row) {
    EXPECT_NEAR(table.number(row, table.column("hold_probability")),
                value("hold_probability", voxels[row]), 1e-6);
    EXPECT_NEAR(table.number(row, table.column("force_median_n")),
                value("holding_force_n", voxels[row]), 1e-4);
    EXPECT_NEAR(table.number(row, table.column("unseen")), value("grasp_unseen", voxels[row]),
                1e-6);
  }
  // It is still a map.
  for (const char* name : {"zero_plane_m", "voxel_size_m", "method", "graspability_threshold"})
    EXPECT_NE(manifest->find_parameter(name), nullptr) << name;
  EXPECT_NE(manifest->find_result("lattice_origin_m"), nullptr);
  EXPECT_EQ(manifest->frame, "terrain");
  ASSERT_TRUE(
      succeeded(graspmap({"lookup", "held.pcd", "places.csv", "--column", "p=hold_probability",
                          "-o", "looked.csv", "--max-distance", "0.05"})));
  EXPECT_FALSE(libmap::read_csv(scratch("looked.csv")).rows[0].back().empty());
  for (const char* command : {"footholds", "analyze"})
    EXPECT_TRUE(succeeded(graspmap(
        {command, "held.pcd", "-o", command + std::string(*command == 'f' ? ".csv" : "")})));
  EXPECT_TRUE(succeeded(graspmap({"render", "held.pcd", "--color", "field", "--field",
                                  "hold_probability", "-o", "held.png"})));
}

TEST(GraspCommand, MapsAreTheSameForThreadsAndAfterAKill) {
  write_map();
  ASSERT_TRUE(succeeded(graspmap(map_words("one.pcd", {"--threads", "1"}))));
  ASSERT_TRUE(succeeded(graspmap(map_words("two.pcd", {"--threads", "4"}))));
  EXPECT_EQ(content("one.pcd"), content("two.pcd"));
  const auto progress = scratch("killed.pcd.progress");
  const auto tiles = [&] {
    std::size_t count = 0;
    if (std::filesystem::exists(progress))
      for (const auto& entry : std::filesystem::directory_iterator(progress))
        count +=
            entry.path().extension() == ".txt" && !entry.path().filename().string().starts_with(".")
                ? 1
                : 0;
    return count;
  };
  const std::string program = (graspmap_test::build_folder() / "graspmap").string();
  std::vector<std::string> words = map_words("killed.pcd", {"--quiet"});
  const std::string folder = graspmap_test::scratch_folder().string();  // it has this process's id
  const pid_t child = fork();
  if (child == 0) {
    setpgid(0, 0);
    std::vector<char*> arguments = {const_cast<char*>("graspmap")};
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    if (chdir(folder.c_str()) != 0) _exit(1);
    execv(program.c_str(), arguments.data());
    _exit(1);
  }
  setpgid(child, child);
  while (tiles() < 2) {
    ASSERT_EQ(waitpid(child, nullptr, WNOHANG), 0);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  kill(-child, SIGKILL);
  waitpid(child, nullptr, 0);
  EXPECT_FALSE(std::filesystem::exists(scratch("killed.pcd")));
  ASSERT_GE(tiles(), 2u);
  // A tile that is not whole, and one that says something else: it is read, not made again.
  const auto kept = [&](const std::string& name) {
    return graspmap_test::read_text(progress / name);
  };
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(progress))
    names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  const std::string whole = kept(names[0]);
  write_text(progress / names[0], whole.substr(0, whole.size() / 2));
  ASSERT_TRUE(succeeded(graspmap(words)));
  EXPECT_EQ(content("killed.pcd"), content("one.pcd"));
  EXPECT_FALSE(std::filesystem::exists(progress));
  std::filesystem::create_directory(progress);
  const std::size_t line = whole.find('\n') + 1;
  std::string other = whole;  // another probability of its first voxel
  other[line] = other[line] == '1' ? '0' : '1';
  write_text(progress / names[0], other);
  words.emplace_back("--force");
  ASSERT_TRUE(succeeded(graspmap(words)));
  EXPECT_NE(content("killed.pcd"), content("one.pcd"));
  // Of another seed: made again.
  std::filesystem::create_directory(progress);
  write_text(progress / names[0], other);
  words.insert(words.end(), {"--seed", "2"});
  ASSERT_TRUE(succeeded(graspmap(words)));
  ASSERT_TRUE(succeeded(graspmap(map_words("seed.pcd", {"--seed", "2"}))));
  EXPECT_EQ(content("killed.pcd"), content("seed.pcd"));
  EXPECT_NE(content("killed.pcd"), content("one.pcd"));
}

TEST(GraspCommand, BadMaps) {
  write_map();
  EXPECT_TRUE(graspmap_test::wrong_usage(graspmap({"grasp", "ground.ply", "-o", "t.pcd"}),
                                         {"--points", "--map"}));
  EXPECT_TRUE(graspmap_test::wrong_usage(graspmap(map_words("t.pcd", {"--points", "places.csv"})),
                                         {"--points", "--map"}));
  for (const auto& [flag, value] :
       {std::pair{"--scenes", "s"}, {"--more-loads", "5"}, {"--prefix", "p"}})
    EXPECT_TRUE(bad_input(graspmap(map_words("t.pcd", {flag, value})), {flag}));
  EXPECT_TRUE(bad_input(graspmap(map_words("t.txt")), {"t.txt"}));
  EXPECT_TRUE(bad_input(graspmap(map_words("map.pcd")), {"map.pcd"}));
  auto map = libmap::read_cloud(scratch("map.pcd")).cloud;
  map.add_field("holding_force_n", libmap::ScalarType::float32);
  libmap::write_cloud(scratch("taken.pcd"), map);
  auto words = map_words("t.pcd");
  words[3] = "taken.pcd";
  EXPECT_TRUE(bad_input(graspmap(words), {"taken.pcd", "holding_force_n"}));
  for (Eigen::Vector3d& position : map.positions) position.x() += 7;
  map.fields.clear();
  libmap::write_cloud(scratch("far.pcd"), map);
  words[3] = "far.pcd";
  EXPECT_TRUE(bad_input(graspmap(words), {"far.pcd", "mesh", "0.05 m"}));
  libmap::write_cloud(scratch("none.pcd"), {});
  words[3] = "none.pcd";
  EXPECT_TRUE(bad_input(graspmap(words), {"none.pcd"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("t.pcd")));
  EXPECT_FALSE(std::filesystem::exists(scratch("t.pcd.progress")));
}

}  // namespace grasp_test
