// graspmap mesh into a folder, in shares and after a kill.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <thread>

#include "libmap/io/cloud_io.h"
#include "tests/support/running_program.h"
#include "tests/tools/tool_test_support.h"

namespace mesh_shares_test {

namespace fs = std::filesystem;

using graspmap_test::bad_input;
using graspmap_test::expect_same_tiles;
using graspmap_test::graspmap;
using graspmap_test::json_of;
using graspmap_test::pieces_in;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using Words = std::vector<std::string>;

// A bumpy square, and above it a strip of 0.05 m2 through four tiles.
void write_cloud() {
  libmap::PointCloud cloud;
  const auto add = [&](double x, double y, double z) {
    cloud.positions.emplace_back(x, y, z);
    cloud.normals.emplace_back(0, 0, 1);
  };
  for (int i = 0; i < 60; ++i)
    for (int j = 0; j < 60; ++j)
      add(0.02 * i - 0.6, 0.02 * j - 0.6, 0.01 * std::sin(0.5 * i) * std::cos(0.4 * j));
  for (int i = -25; i <= 25; ++i)
    for (int j = -1; j <= 1; ++j) add(0.02 * i, 0.02 * j + 0.1, 0.5);
  libmap::write_cloud(scratch("cloud.pcd"), cloud);
}

Words mesh_words(const std::string& output, const Words& more = {}) {
  Words words = {"mesh",        "cloud.pcd", "-o",         output, "--cell-size",          "0.02",
                 "--tile-size", "0.3",       "--max-hole", "0",    "--min-island-area-m2", "0.1"};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

TEST(MeshShares, TogetherAreTheFolderOfOneRun) {
  write_cloud();
  ASSERT_TRUE(succeeded(graspmap(mesh_words("whole"))));
  EXPECT_EQ(json_of("whole.json").at("results").at("islands_across_tiles"), 1);
  for (const std::string share : {"3/3", "1/3"})
    ASSERT_TRUE(succeeded(graspmap(mesh_words("shared", {"--tile", share}))));
  EXPECT_FALSE(fs::exists(scratch("shared")));
  // Pieces of other parameters do not mix, and one share does not remove those of others.
  EXPECT_TRUE(
      bad_input(graspmap(mesh_words("shared", {"--tile", "2/3", "--smoothing-iterations", "3"})),
                {.file = "shared.progress", .about = "--force"}));
  EXPECT_TRUE(bad_input(graspmap(mesh_words("shared", {"--tile", "2/3", "--force"})),
                        {.file = "cloud.pcd", .field = "--force"}));
  EXPECT_TRUE(bad_input(graspmap(mesh_words("shared", {"--tile", "4/3"})),
                        {.file = "cloud.pcd", .field = "--tile", .value = "4/3"}));
  ASSERT_TRUE(succeeded(graspmap(mesh_words("shared", {"--tile", "2/3"}))));
  expect_same_tiles("shared", "whole");
  // A share is run again, as by a queue that lost a task.
  const auto written = std::filesystem::last_write_time(scratch("shared.json"));
  ASSERT_TRUE(succeeded(graspmap(mesh_words("shared", {"--tile", "1/3"}))));
  EXPECT_EQ(std::filesystem::last_write_time(scratch("shared.json")), written);
  expect_same_tiles("shared", "whole");
  // A run of all tiles replaces tiles of other parameters.
  ASSERT_TRUE(succeeded(graspmap(mesh_words("other", {"--tile", "1/2"}))));
  ASSERT_TRUE(succeeded(graspmap(mesh_words("other", {"--smoothing-iterations", "1"}))));
  EXPECT_FALSE(pieces_in("other") == pieces_in("whole"));
  EXPECT_FALSE(fs::exists(scratch("other.progress")));
}

// Files of completed tiles that are not empty.
std::vector<fs::path> done_pieces(const std::string& progress) {
  std::vector<fs::path> pieces;
  std::error_code ignored;
  const fs::path journal = scratch(progress) / "progress/1_of_1.jsonl";
  const std::string lines = fs::exists(journal) ? graspmap_test::read_text(journal) : std::string();
  for (const auto& entry : fs::directory_iterator(scratch(progress) / "tiles", ignored))
    if (lines.find("\"" + entry.path().stem().string() + "\"") != std::string::npos)
      pieces.push_back(entry.path());
  return pieces;
}

// Identifies a file, to distinguish it from a copy with the same content.
ino_t inode_of(const fs::path& path) {
  struct stat status {};
  return stat(path.c_str(), &status) == 0 ? status.st_ino : 0;
}

TEST(MeshShares, AKilledRunIsResumed) {
  write_cloud();
  ASSERT_TRUE(succeeded(graspmap(mesh_words("whole"))));
  {
    Words words = mesh_words("killed");
    words.insert(words.begin(), graspmap_test::build_folder() / "graspmap");
    graspmap_test::RunningProgram running(words, {.folder = scratch("")});
    while (done_pieces("killed.progress").size() < 2 && !running.has_ended())
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    kill(running.process(), SIGKILL);
    running.wait();
  }
  ASSERT_FALSE(fs::exists(scratch("killed"))) << "it has dozens of pieces";
  std::map<std::string, ino_t> before;
  for (const fs::path& piece : done_pieces("killed.progress"))
    before[piece.filename()] = inode_of(piece);
  ASSERT_GE(before.size(), 2U);
  ASSERT_TRUE(succeeded(graspmap(mesh_words("killed"))));
  expect_same_tiles("killed", "whole");
  std::size_t kept = 0;
  for (const auto& [name, inode] : before)
    kept += inode_of(scratch("killed") / name) == inode ? 1 : 0;
  EXPECT_GE(kept + 4, before.size()) << "the strip's four pieces are written anew without it";
  EXPECT_GT(kept, 0U);
}

TEST(MeshShares, NothingIsLeftOfABadInput) {
  libmap::PointCloud cloud;
  cloud.positions = {{0, 0, 0}, {0.01, 0, 0}};
  cloud.normals = {{0, 0, 1}, {0, 0, -1}};
  libmap::write_cloud(scratch("cloud.pcd"), cloud);
  EXPECT_TRUE(bad_input(graspmap(mesh_words("none")), {.file = "cloud.pcd"}));
  EXPECT_EQ(graspmap_test::names_in_scratch(), Words{"cloud.pcd"});
  ASSERT_TRUE(succeeded(graspmap(mesh_words("none", {"--dry-run"}))));
  EXPECT_EQ(graspmap_test::names_in_scratch(), Words{"cloud.pcd"});
  EXPECT_TRUE(bad_input(graspmap(mesh_words("one.ply", {"--tile", "1/2"})), {.field = "--tile"}));
}

}  // namespace mesh_shares_test
