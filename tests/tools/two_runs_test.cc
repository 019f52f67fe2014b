// Two simultaneous runs with the same output: the second fails at once and changes nothing.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <thread>

#include "libmap/core/output_lock.h"
#include "libmap/io/cloud_io.h"
#include "tests/support/running_program.h"
#include "tests/tools/tool_test_support.h"

namespace two_runs_test {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

using graspmap_test::content;
using graspmap_test::ended_with;
using graspmap_test::graspmap;
using graspmap_test::ProgramResult;
using graspmap_test::RunningProgram;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using Words = std::vector<std::string>;

std::vector<std::string> temporaries() {
  std::vector<std::string> names;
  std::error_code code;
  for (auto entry = fs::recursive_directory_iterator(scratch(""), code);
       !code && entry != fs::recursive_directory_iterator(); entry.increment(code)) {
    const std::string name = entry->path().filename().string();
    if (name.find(".partial") != std::string::npos) names.push_back(name);
  }
  return names;
}

// Returns true if the temporary manifest exists, which claims the outputs of the run.
bool claims() {
  const auto names = temporaries();
  return std::any_of(names.begin(), names.end(),
                     [](const std::string& name) { return name.ends_with(".partial.json"); });
}

bool wait_for_claim(const RunningProgram& program) {
  while (!program.has_ended()) {
    if (claims()) return true;
    std::this_thread::sleep_for(1ms);
  }
  return false;
}

// Returns true if the program was stopped during its work; a short run may end before.
bool stopped_at_work(const RunningProgram& program) {
  if (!wait_for_claim(program)) return false;
  std::this_thread::sleep_for(5ms);
  kill(program.process(), SIGSTOP);
  siginfo_t info{};
  waitid(P_PID, static_cast<id_t>(program.process()), &info, WSTOPPED | WEXITED | WNOWAIT);
  return !program.has_ended() && claims();
}

// Runs the command twice at once; the first is stopped while the second runs.
void expect_one_of_two(const Words& words, const std::string& output) {
  Words line = words;
  line.insert(line.begin(), (graspmap_test::build_folder() / "graspmap").string());
  std::optional<RunningProgram> first;
  for (int attempt = 0;; ++attempt) {
    ASSERT_LT(attempt, 50) << "it was never caught at work";
    first.emplace(line, graspmap_test::ProgramSurroundings{.folder = scratch("")});
    if (stopped_at_work(*first)) break;
    kill(first->process(), SIGCONT);
    ASSERT_TRUE(succeeded(first->wait()));
    fs::remove_all(scratch(output));
    fs::remove(scratch(output + ".json"));
  }
  const ProgramResult second = graspmap(words);
  kill(first->process(), SIGCONT);
  EXPECT_TRUE(ended_with(second, {.file = output, .kind = libmap::ErrorKind::failed}));
  EXPECT_EQ(std::count(second.standard_error.begin(), second.standard_error.end(), '\n'), 1);
  EXPECT_TRUE(succeeded(first->wait()));
  EXPECT_TRUE(fs::exists(scratch(output)));
  EXPECT_TRUE(fs::exists(scratch(output + ".json")));
  EXPECT_TRUE(temporaries().empty());
}

TEST(TwoRuns, IntoAFile) {
  libmap::write_cloud(scratch("t.pcd"), graspmap_test::bumpy_terrain(1.2));
  expect_one_of_two({"score", "t.pcd", "-o", "o.pcd", "--quiet"}, "o.pcd");
}

TEST(TwoRuns, IntoAFolderOfFiles) {
  expect_one_of_two({"simulate", "site", "--edge-length", "0.03", "-o", "o", "--quiet"}, "o");
  expect_one_of_two({"simulate", "site", "--edge-length", "0.03", "-o", "new/o/", "--quiet"},
                    "new/o");
}

TEST(TwoRuns, IntoAFolderThatIsReplaced) {
  expect_one_of_two({"simulate", "terrain", "--size", "6", "-o", "o", "--quiet"}, "o");
}

TEST(TwoRuns, OfAReport) {
  libmap::write_cloud(scratch("t.pcd"), graspmap_test::bumpy_terrain());
  ASSERT_TRUE(succeeded(graspmap({"score", "t.pcd", "-o", "m.pcd", "--quiet"})));
  expect_one_of_two({"report", ".", "-o", "o.html", "--no-3d", "--quiet"}, "o.html");
}

// A store that other shares use is not replaced.
TEST(TwoRuns, IntoAStoreOfTiles) {
  libmap::write_cloud(scratch("t.pcd"), graspmap_test::bumpy_terrain(0.6));
  const Words share = {"score", "t.pcd", "-o", "m.tiles", "--tile", "1/2", "--quiet"};
  ASSERT_TRUE(succeeded(graspmap(share)));
  const auto refused = [](const ProgramResult& result) {
    return ended_with(result, {.file = "m.tiles", .kind = libmap::ErrorKind::failed});
  };
  const std::string plan = content("m.tiles/progress/plan.json");
  {
    const libmap::FileLock working(scratch("m.tiles/progress/1_of_2.jsonl"));
    EXPECT_TRUE(refused(graspmap({"score", "t.pcd", "-o", "m.tiles", "--force", "--quiet"})));
    EXPECT_EQ(content("m.tiles/progress/plan.json"), plan);
    EXPECT_TRUE(succeeded(graspmap({"score", "t.pcd", "-o", "m.tiles", "--tile", "2/2"})));
  }
  EXPECT_TRUE(succeeded(graspmap({"score", "t.pcd", "-o", "m.tiles", "--force", "--quiet"})));
}

// Leftovers of a killed run do not block later runs.
TEST(TwoRuns, AKilledRunHoldsNothing) {
  libmap::write_cloud(scratch("t.pcd"), graspmap_test::bumpy_terrain(1.2));
  const Words words = {"score", "t.pcd", "-o", "o.pcd", "--quiet"};
  Words line = words;
  line.insert(line.begin(), (graspmap_test::build_folder() / "graspmap").string());
  RunningProgram killed(line, {.folder = scratch("")});
  ASSERT_TRUE(wait_for_claim(killed));
  kill(killed.process(), SIGKILL);
  EXPECT_EQ(killed.wait().exit_code, 128 + SIGKILL);
  EXPECT_TRUE(succeeded(graspmap(words)));
  EXPECT_TRUE(temporaries().empty());
}

// As one that was killed while it wrote the first output of a folder.
TEST(TwoRuns, AFolderOfWhatAKilledRunLeftIsNobodys) {
  const Words words = {"simulate", "site", "--edge-length", "0.1", "-o", "o", "--quiet"};
  fs::create_directory(scratch("o"));
  graspmap_test::write_text(scratch("o/.mesh.partial.ply"), "half");
  EXPECT_TRUE(succeeded(graspmap(words)));
  EXPECT_TRUE(temporaries().empty());
  fs::remove_all(scratch("o"));
  fs::remove(scratch("o.json"));
  fs::create_directory(scratch("o"));
  graspmap_test::write_text(scratch("o/.partial"), "mine");
  graspmap_test::write_text(scratch("o/mine"), "mine");
  EXPECT_TRUE(graspmap_test::bad_input(graspmap(words), {.file = "o"}));
}

}  // namespace two_runs_test
