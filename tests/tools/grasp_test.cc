#include <gtest/gtest.h>

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <set>
#include <string>
#include <thread>

#include "libmap/core/table.h"
#include "libmap/core/text.h"
#include "libmap/io/cloud_io.h"
#include "libmap/io/mesh_io.h"
#include "libmap/mesh/mesh_parts.h"
#include "tests/tools/tool_test_support.h"

namespace grasp_test {

using graspmap_test::bad_input;
using graspmap_test::content;
using graspmap_test::ExpectedError;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using graspmap_test::warned;
using graspmap_test::write_text;
using graspmap_test::wrong_usage;

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
  ASSERT_TRUE(
      succeeded(graspmap(with({"-o", "rough.csv", "--set", "gripper.engagement.friction=0.6"}))));
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

TEST(GraspCommand, FitsPullsAndPlansTheNext) {
  write_ground();
  write_text(scratch("pulls.csv"), "ground,tilt_deg,force_n\nlevel,0,9\nlevel,45,8\n");
  const std::vector<std::string> fit = {"grasp", "level",  "--fit",    "pulls.csv",
                                        "-o",    "f.yaml", "--trials", "4"};
  ASSERT_TRUE(succeeded(graspmap(fit)));
  const auto results = json_of("f.yaml.json").at("results");
  EXPECT_EQ(results.at("pull_tests"), 2);
  EXPECT_GT(results.at("level_after_median_n"), results.at("level_before_median_n"));
  EXPECT_LT(results.at("spine_force_limit_n.low"), results.at("spine_force_limit_n.high"));
  // The file is a gripper of all commands.
  ASSERT_TRUE(succeeded(graspmap(with({"-o", "fitted.csv", "--gripper", "f.yaml"}))));
  ASSERT_TRUE(succeeded(graspmap({"grasp", "ground.ply", "--points", "places.csv", "--plan", "2",
                                  "--gripper", "f.yaml", "-o", "plan.csv", "--trials", "4"})));
  const libmap::Table plan = libmap::read_csv(scratch("plan.csv"));
  ASSERT_FALSE(plan.rows.empty());
  EXPECT_LE(plan.rows.size(), 2U);
  for (const char* column : {"place", "x", "tilt_deg", "azimuth_deg", "load_n"})
    EXPECT_TRUE(plan.find_column(column)) << column;
  const auto refused = [&](const std::string& table, const ExpectedError& expected) {
    write_text(scratch("bad.csv"), table);
    return bad_input(graspmap({"grasp", "ground.ply", "--fit", "bad.csv", "-o", "b.yaml"}),
                     expected);
  };
  EXPECT_TRUE(refused("x,y,z,force_n\n", {.file = "bad.csv", .field = "pull tests"}));
  EXPECT_TRUE(
      refused("x,y,z,force_n\n0,0,9,3\n", {.file = "bad.csv", .field = "row 1", .value = "0,0,9"}));
  EXPECT_TRUE(refused(
      "x,y,z,force_n\n0,0,0.05,-3\n",
      {.file = "bad.csv", .field = "row 1, force_n", .value = "-3", .bound = ">= 0 and <= 1e+05"}));
  EXPECT_TRUE(refused("x,y,z,held\n0,0,0.05,1\n",
                      {.file = "bad.csv", .field = "row 1, load_n", .bound = "> 0"}));
  EXPECT_FALSE(std::filesystem::exists(scratch("b.yaml")));
}

TEST(GraspCommand, BadInputIsOneLine) {
  write_ground();
  const auto refused = [](const std::vector<std::string>& words, const ExpectedError& expected) {
    return bad_input(graspmap(with(words)), expected);
  };
  for (const auto& [flag, value] : {std::pair{"--load", "0"}, {"--more-loads", "x"}})
    EXPECT_TRUE(refused({"-o", "t.csv", flag, value}, {.field = flag, .value = value}));
  for (const char* flag : {"--trials", "--draws"})
    EXPECT_TRUE(bad_input(
        graspmap({"grasp", "ground.ply", "--points", "places.csv", "-o", "t.csv", flag, "0"}),
        {.field = flag, .value = "0"}));
  const auto former = graspmap(with({"-o", "t.csv", "--asperity-min", "30"}));
  EXPECT_TRUE(wrong_usage(former, {"gripper.engagement.asperity_min_deg"}));
  EXPECT_TRUE(refused({"-o", "t.txt"}, {.file = "t.txt"}));
  EXPECT_TRUE(refused({"-o", "t.csv", "--set", "gripper.fingers.count=0"},
                      {.field = "fingers.count", .value = "0", .bound = ">= 1 and <= 64"}));
  EXPECT_TRUE(refused({"-o", "t.csv", "--set", "gripper.engagement.friction=-0.1"},
                      {.field = "engagement.friction", .value = "-0.1", .bound = ">= 0"}));
  EXPECT_TRUE(
      refused({"-o", "t.csv", "--set", "gripper.fingers.cuont=3"}, {.field = "fingers.cuont"}));
  std::string gripper =
      graspmap_test::read_text(graspmap_test::source_folder() / "data/grippers/scar-e.yaml");
  write_text(scratch("palm.yaml"), gripper.substr(0, gripper.find("fingers:")));
  EXPECT_TRUE(refused({"-o", "t.csv", "--gripper", "palm.yaml"},
                      {.file = "palm.yaml", .field = "fingers"}));
  ASSERT_TRUE(succeeded(graspmap({"mask", "--gripper", "palm.yaml", "-o", "mask.txt"})));
  write_text(scratch("part.yaml"), gripper.substr(0, gripper.find("  curl_deg")));
  EXPECT_TRUE(refused({"-o", "t.csv", "--gripper", "part.yaml"},
                      {.file = "part.yaml", .field = "fingers.curl_deg"}));
  const auto on = [](const std::string& mesh, const std::string& places) {
    return graspmap({"grasp", mesh, "--points", places, "-o", "t.csv"});
  };
  write_text(scratch("off.csv"), "x,y,z\n0,0,0.05\n0,0,1\n");
  EXPECT_TRUE(bad_input(on("ground.ply", "off.csv"),
                        {.file = "off.csv", .field = "location 2", .value = "0,0,1"}));
  write_text(scratch("nan.csv"), "x,y,z\n0,nan,0.05\n");
  EXPECT_TRUE(bad_input(on("ground.ply", "nan.csv"), {.file = "nan.csv", .field = "row 1"}));
  write_text(scratch("none.csv"), "x,y,z\n");
  EXPECT_TRUE(bad_input(on("ground.ply", "none.csv"), {.file = "none.csv"}));
  write_text(scratch("taken.csv"), "x,y,z,graspable\n0,0,0.05,1\n");
  EXPECT_TRUE(
      bad_input(on("ground.ply", "taken.csv"), {.file = "taken.csv", .field = "graspable"}));
  write_text(scratch("points.ply"),
             "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
             "property float z\nend_header\n0 0 0\n");
  EXPECT_TRUE(
      bad_input(on("points.ply", "places.csv"), {.file = "points.ply", .field = "triangles"}));
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

// With two trials for each voxel.
std::vector<std::string> quick_words(const std::string& output,
                                     const std::vector<std::string>& more = {}) {
  std::vector<std::string> words = map_words(output, more);
  words[7] = "2";
  words[9] = "1";
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
  // Predictions of the map are replaced; its score is not.
  ASSERT_EQ(held.fields.size(), map.fields.size() + 3);
  const std::set<std::string> replaced = {"hold_probability",    "holding_force_n",
                                          "holding_force_low_n", "holding_force_high_n",
                                          "trial_spread",        "parameter_spread"};
  for (std::size_t n = 0; n < map.fields.size(); ++n) {
    EXPECT_EQ(held.fields[n].name, map.fields[n].name);
    EXPECT_EQ(held.fields[n] == map.fields[n], replaced.count(map.fields[n].name) == 0);
  }
  const char* names[] = {"limiting_direction", "grasp_unseen", "grasp_trials"};
  for (std::size_t n = 0; n < 3; ++n) {
    EXPECT_EQ(held.fields[map.fields.size() + n].name, names[n]);
    EXPECT_EQ(held.fields[map.fields.size() + n].type, libmap::ScalarType::float32);
  }
  const auto value = [&](const char* name, std::size_t n) {
    return held.find_field(name)->values[n];
  };
  // The results equal those at the voxels' centers in the mesh's frame.
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
    EXPECT_NEAR(table.number(row, table.column("force_p95_n")),
                value("holding_force_high_n", voxels[row]), 1e-4);
    EXPECT_NEAR(table.number(row, table.column("parameter_spread")),
                value("parameter_spread", voxels[row]), 1e-4);
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

// The finished tiles of a store.
std::vector<std::filesystem::path> tiles_in(const std::string& store) {
  std::vector<std::filesystem::path> files;
  if (std::filesystem::exists(scratch(store) / "tiles"))
    for (const auto& entry : std::filesystem::directory_iterator(scratch(store) / "tiles"))
      if (!entry.path().filename().string().starts_with(".")) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

// Arguments for the same map in dozens of tiles, so that a run has not ended when a test notices
// its first two tiles, even on a busy machine.
std::vector<std::string> on_many_tiles(std::vector<std::string> words) {
  EXPECT_TRUE(succeeded(graspmap({"score", "terrain.pcd", "--voxel-size", "0.04", "--up", "0,0,1",
                                  "--tile-size", "0.12", "-o", "map.tiles", "--force"})));
  words[3] = "map.tiles";
  return words;
}

// Kills `graspmap WORDS...` once two tiles are in the store.
void kill_after_two_tiles(std::vector<std::string> words, const std::string& store) {
  const std::string program = (graspmap_test::build_folder() / "graspmap").string();
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
  while (tiles_in(store).size() < 2) {
    ASSERT_EQ(waitpid(child, nullptr, WNOHANG), 0);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  kill(-child, SIGKILL);
  waitpid(child, nullptr, 0);
}

TEST(GraspCommand, MapsAreTheSameForThreadsAndAfterAKill) {
  write_map();
  ASSERT_TRUE(succeeded(graspmap(map_words("one.pcd", {"--threads", "1"}))));
  ASSERT_TRUE(succeeded(graspmap(map_words("two.pcd", {"--threads", "4"}))));
  EXPECT_EQ(content("one.pcd"), content("two.pcd"));
  std::vector<std::string> words =
      on_many_tiles(map_words("killed.pcd", {"--quiet", "--threads", "1"}));
  const std::string progress = "killed.pcd.progress";
  kill_after_two_tiles(words, progress);
  EXPECT_FALSE(std::filesystem::exists(scratch("killed.pcd")));
  auto tiles = tiles_in(progress);
  ASSERT_GE(tiles.size(), 2u);
  // Only a truncated tile is made again.
  const std::string whole = graspmap_test::read_text(tiles[0]);
  write_text(tiles[0], whole.substr(0, whole.size() / 2));
  ASSERT_TRUE(succeeded(graspmap(words)));
  EXPECT_EQ(content("killed.pcd"), content("one.pcd"));
  EXPECT_FALSE(std::filesystem::exists(scratch(progress)));
  // Tiles of another seed are not taken.
  words.insert(words.end(), {"--force", "--seed", "2"});
  kill_after_two_tiles(words, progress);
  words.back() = "3";
  ASSERT_TRUE(succeeded(graspmap(words)));
  ASSERT_TRUE(succeeded(graspmap(map_words("seed.pcd", {"--seed", "3"}))));
  EXPECT_EQ(content("killed.pcd"), content("seed.pcd"));
  EXPECT_NE(content("killed.pcd"), content("one.pcd"));
}

TEST(GraspCommand, SharesOfAMapAreTheMap) {
  write_map();
  ASSERT_TRUE(succeeded(graspmap(map_words("whole.pcd"))));
  const std::vector<std::string> held = on_many_tiles(map_words("held.tiles"));
  const auto share = [&](const std::string& part) {
    auto words = held;
    words.insert(words.end(), {"--tile", part, "--quiet", "--threads", "1"});
    return words;
  };
  ASSERT_TRUE(succeeded(graspmap(share("2/3"))));
  EXPECT_TRUE(bad_input(graspmap({"convert", "held.tiles", "-o", "t.pcd"}),
                        {.file = "held.tiles", .about = "33 of 100"}));
  // A share that was killed, and that has lost a tile since.
  kill_after_two_tiles(share("1/3"), "held.tiles");
  std::filesystem::remove(tiles_in("held.tiles").front());
  for (const char* part : {"2/3", "3/3", "1/3"}) ASSERT_TRUE(succeeded(graspmap(share(part))));
  ASSERT_TRUE(succeeded(graspmap({"info", "--verify", "held.tiles"})));
  ASSERT_TRUE(succeeded(graspmap({"convert", "held.tiles", "-o", "merged.pcd"})));
  EXPECT_EQ(content("merged.pcd"), content("whole.pcd"));
  // The store is a map for other commands.
  ASSERT_TRUE(
      succeeded(graspmap({"lookup", "held.tiles", "places.csv", "--column", "p=hold_probability",
                          "-o", "looked.csv", "--max-distance", "0.05"})));
  // Another seed is another map.
  EXPECT_TRUE(bad_input(graspmap(map_words("held.tiles", {"--seed", "2"})),
                        {.file = "held.tiles", .about = "--force"}));
  EXPECT_TRUE(bad_input(graspmap(map_words("held.tiles", {"--force", "--tile", "1/3"})),
                        {.field = "--force"}));
  ASSERT_TRUE(succeeded(graspmap(map_words("held.tiles", {"--seed", "2", "--force"}))));
  ASSERT_TRUE(succeeded(graspmap(map_words("seed.pcd", {"--seed", "2"}))));
  ASSERT_TRUE(succeeded(graspmap({"convert", "held.tiles", "-o", "merged.pcd", "--force"})));
  EXPECT_EQ(content("merged.pcd"), content("seed.pcd"));
}

// For a mesh in tiles, gripper and ground at a seam are those of the whole mesh, and the result
// does not depend on the tiles of the map.
TEST(GraspCommand, OnAMeshInPieces) {
  write_map();
  const libmap::TriangleMesh whole = libmap::read_mesh(scratch("ground.ply")).mesh;
  std::filesystem::create_directories(scratch("pieces"));
  for (const bool left : {true, false}) {
    std::vector<bool> keep;
    for (const libmap::Triangle& triangle : whole.triangles)
      keep.push_back((libmap::center_of(whole, triangle).x() < 0.1) == left);
    libmap::write_mesh(scratch(left ? "pieces/a.ply" : "pieces/b.ply"),
                       libmap::select_triangles(whole, keep));
  }
  ASSERT_TRUE(succeeded(graspmap(map_words("whole.pcd"))));
  auto words = map_words("pieces.pcd");
  words[1] = "pieces";
  ASSERT_TRUE(succeeded(graspmap(words)));
  const auto expected = libmap::read_cloud(scratch("whole.pcd")).cloud;
  const auto found = libmap::read_cloud(scratch("pieces.pcd")).cloud;
  ASSERT_EQ(found.positions, expected.positions);
  std::size_t different = 0;
  for (const char* name : {"hold_probability", "holding_force_n", "grasp_unseen"})
    for (std::size_t n = 0; n < found.size(); ++n)
      different +=
          std::abs(found.find_field(name)->values[n] - expected.find_field(name)->values[n]) > 1e-4;
  // Sums over triangles have another order.
  EXPECT_LE(different, found.size() / 200);
  const std::string bytes = content("pieces.pcd");
  words = on_many_tiles(words);
  words.emplace_back("--force");
  ASSERT_TRUE(succeeded(graspmap(words)));
  EXPECT_EQ(content("pieces.pcd"), bytes);
}

TEST(GraspCommand, MapsInAllFormats) {
  write_map();
  ASSERT_TRUE(succeeded(graspmap(quick_words("held.pcd"))));
  for (const char* format : {".ply", ".csv", ".vtp"}) {
    ASSERT_TRUE(succeeded(graspmap(quick_words(std::string("held") + format))));
    ASSERT_TRUE(
        succeeded(graspmap({"convert", "held.pcd", "-o", std::string("converted") + format})));
    EXPECT_EQ(content(std::string("held") + format), content(std::string("converted") + format));
  }
  for (const char* name : {"t.obj", "t.txt", "t"})
    EXPECT_TRUE(
        bad_input(graspmap(quick_words(name)),
                  {.file = name, .field = "extension", .bound = ".pcd, .ply, .csv or .vtp"}));
}

// The error of a mesh made by fuse and mesh, and a constant error, in shares and in one run.
TEST(GraspCommand, SurfaceError) {
  write_map();
  libmap::TriangleMesh mesh = libmap::read_mesh(scratch("ground.ply")).mesh;
  const auto with_errors = [&](double error_m, double beyond_m) {
    std::vector<double> errors;
    for (const Eigen::Vector3d& vertex : mesh.vertices)
      errors.push_back(vertex.x() > 0.2 ? beyond_m : error_m);
    mesh.vertex_fields = {{"expected_error", libmap::ScalarType::float32, errors}};
    libmap::write_mesh(scratch("ground.ply"), mesh);
  };
  const auto run_to = [](const std::string& output, const std::vector<std::string>& more) {
    return graspmap(quick_words(output, more));
  };
  const auto refused = [&](const std::string& error, const ExpectedError& expected) {
    return bad_input(run_to("t.pcd", {"--surface-error", error}), expected);
  };
  EXPECT_TRUE(refused("mesh", {.file = "ground.ply", .field = "expected_error"}));
  with_errors(0.0, 0.0);
  ASSERT_TRUE(succeeded(run_to("without.pcd", {})));
  for (const char* none : {"mesh", "0"}) {
    ASSERT_TRUE(succeeded(run_to("zero.pcd", {"--force", "--surface-error", none})));
    EXPECT_EQ(content("zero.pcd"), content("without.pcd")) << none;
  }
  with_errors(0.002, 0.02);
  ASSERT_TRUE(succeeded(run_to("with.pcd", {"--surface-error", "mesh"})));
  for (const char* share : {"2/2", "1/2"})
    ASSERT_TRUE(succeeded(run_to("with.tiles", {"--surface-error", "mesh", "--tile", share})));
  ASSERT_TRUE(succeeded(graspmap({"convert", "with.tiles", "-o", "merged.pcd"})));
  EXPECT_EQ(content("merged.pcd"), content("with.pcd"));
  EXPECT_TRUE(bad_input(run_to("with.tiles", {"--surface-error", "0.002"}),
                        {.file = "with.tiles", .about = "--force"}));
  // Ground with a large error is marked.
  const auto without = libmap::read_cloud(scratch("without.pcd")).cloud;
  const auto with = libmap::read_cloud(scratch("with.pcd")).cloud;
  const auto mesh_from_map = libmap::read_manifest_of(scratch("with.pcd"))
                                 ->find_transform("terrain_from_input")
                                 ->inverse();
  int marked = 0;
  for (std::size_t n = 0; n < with.size(); ++n) {
    const auto value = [&](const libmap::PointCloud& map, const char* name) {
      return map.find_field(name)->values[n];
    };
    const double x = (mesh_from_map * with.positions[n]).x();
    if (value(with, "grasp_trials") == 0 || x < 0.35) continue;
    ++marked;
    EXPECT_GT(value(with, "grasp_unseen"), 0.4);
    EXPECT_GE(value(with, "grasp_unseen"), value(without, "grasp_unseen") - 1e-6);
  }
  EXPECT_GT(marked, 20);
  for (const char* error : {"x", "0.006", "-0.001", "nan"})
    EXPECT_TRUE(refused(error, {.file = "ground.ply", .field = "--surface-error", .value = error}));
}

TEST(GraspCommand, BadMaps) {
  write_map();
  EXPECT_TRUE(graspmap_test::wrong_usage(graspmap({"grasp", "ground.ply", "-o", "t.pcd"}),
                                         {"--points", "--map"}));
  EXPECT_TRUE(graspmap_test::wrong_usage(graspmap(map_words("t.pcd", {"--points", "places.csv"})),
                                         {"--points", "--map"}));
  for (const auto& [flag, value] :
       {std::pair{"--scenes", "s"}, {"--more-loads", "5"}, {"--prefix", "p"}})
    EXPECT_TRUE(bad_input(graspmap(map_words("t.pcd", {flag, value})),
                          {.field = flag, .about = "--points"}));
  EXPECT_TRUE(bad_input(graspmap(map_words("t.pcd", {"--tile", "1/2"})),
                        {.file = "t.pcd", .field = "--tile"}));
  EXPECT_TRUE(bad_input(graspmap(map_words("t.tiles", {"--tile", "3/2"})),
                        {.field = "--tile", .value = "3/2"}));
  EXPECT_TRUE(bad_input(graspmap(with({"-o", "t.csv", "--tile", "1/2"})),
                        {.field = "--tile", .about = "--map"}));
  EXPECT_TRUE(bad_input(graspmap(map_words("map.pcd")), {.file = "map.pcd"}));
  auto map = libmap::read_cloud(scratch("map.pcd")).cloud;
  map.add_field("grasp_trials", libmap::ScalarType::float32);
  libmap::write_cloud(scratch("taken.pcd"), map);
  auto words = map_words("t.pcd");
  words[3] = "taken.pcd";
  EXPECT_TRUE(bad_input(graspmap(words), {.file = "taken.pcd", .field = "grasp_trials"}));
  for (Eigen::Vector3d& position : map.positions) position.x() += 7;
  map.fields.pop_back();
  libmap::write_cloud(scratch("far.pcd"), map);
  words[3] = "far.pcd";
  EXPECT_TRUE(bad_input(graspmap(words), {.file = "far.pcd"}));
  libmap::write_cloud(scratch("none.pcd"), {});
  words[3] = "none.pcd";
  EXPECT_TRUE(bad_input(graspmap(words), {.file = "none.pcd", .field = "points of the map"}));
  map.fields.clear();
  libmap::write_cloud(scratch("bare.pcd"), map);
  words[3] = "bare.pcd";
  EXPECT_TRUE(bad_input(graspmap(words), {.file = "bare.pcd", .field = "score"}));
  for (const char* left : {"t.pcd", "t.pcd.progress", "t.tiles"})
    EXPECT_FALSE(std::filesystem::exists(scratch(left))) << left;
}

TEST(GraspCommand, MapsMostlyBesideTheMeshAreReported) {
  libmap::PointCloud map = write_map();
  const auto result_of_map_moved_by = [&](double shift_m) {
    for (Eigen::Vector3d& position : map.positions) position.x() += shift_m;
    libmap::write_cloud(scratch("moved.pcd"), map);
    std::filesystem::copy_file(scratch("map.pcd.json"), scratch("moved.pcd.json"),
                               std::filesystem::copy_options::overwrite_existing);
    auto words = quick_words("t.pcd", {"--force"});
    words[3] = "moved.pcd";
    const auto result = graspmap(words);
    EXPECT_TRUE(succeeded(result));
    return result;
  };
  EXPECT_FALSE(warned(result_of_map_moved_by(0.2), {}));
  EXPECT_TRUE(
      warned(result_of_map_moved_by(0.5), {"of " + std::to_string(map.size()) + " voxels"}));
}

}  // namespace grasp_test
