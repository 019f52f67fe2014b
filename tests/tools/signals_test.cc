// Commands ended by a signal: they leave no partial outputs and no processes, do not change earlier
// outputs, and have the exit status of the signal. Runs that end before the signal count too.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <map>
#include <ostream>
#include <thread>

#include "libmap/io/cloud_io.h"
#include "tests/support/running_program.h"
#include "tests/tools/tool_test_support.h"

namespace signals_test {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

using graspmap_test::graspmap;
using graspmap_test::ProgramResult;
using graspmap_test::RunningProgram;
using graspmap_test::scratch;
using graspmap_test::succeeded;
using Words = std::vector<std::string>;

std::map<std::string, std::string> all_files() {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(scratch("")))
    files[entry.path().string()] =
        entry.is_regular_file() ? graspmap_test::read_text(entry.path()) : "";
  return files;
}

// Their content differs from run to run.
bool holds_times(const std::string& name) {
  return name.ends_with(".json") || name.ends_with(".txt");
}

bool is_claimed() {
  for (const auto& entry : fs::directory_iterator(scratch("")))
    if (entry.path().filename().string().starts_with('.')) return true;
  return false;
}

// The processes that `process` has started and that still run.
std::vector<pid_t> children_of(pid_t process) {
  std::vector<pid_t> children;
  std::error_code code;
  const fs::path tasks = "/proc/" + std::to_string(process) + "/task";
  for (auto task = fs::directory_iterator(tasks, code); !code && task != fs::directory_iterator();
       task.increment(code)) {
    std::ifstream list(task->path() / "children");
    for (pid_t child = 0; list >> child;) children.push_back(child);
  }
  return children;
}

bool all_end(const std::vector<pid_t>& processes) {
  for (const pid_t process : processes)
    for (int n = 0; kill(process, 0) == 0; ++n) {
      if (n > 1000) return false;
      std::this_thread::sleep_for(10ms);
    }
  return true;
}

enum class To { process, group };

struct Told {
  double moment;  // a share of the undisturbed time; below 0: as soon as the output is claimed
  std::vector<int> signals;
  To whom = To::process;
};

const Told told[] = {{-1, {SIGINT}},
                     {0.3, {SIGTERM}},
                     {0.6, {SIGINT, SIGINT}},
                     {-1, {SIGTERM, SIGINT, SIGTERM}, To::group},
                     {0.9, {SIGHUP}, To::group}};

ProgramResult run_and_tell(const Words& words, const Told& one, Clock::duration undisturbed) {
  Words line = words;
  line.insert(line.begin(), (graspmap_test::build_folder() / "graspmap").string());
  RunningProgram program(line, {.folder = scratch("")}, true);
  if (one.moment < 0)
    while (!is_claimed() && !program.has_ended()) std::this_thread::sleep_for(1ms);
  else
    std::this_thread::sleep_for(undisturbed * one.moment);
  const pid_t process = program.process();
  const std::vector<pid_t> children = children_of(process);
  for (const int signal : one.signals) kill(one.whom == To::group ? -process : process, signal);
  ProgramResult result = program.wait();
  EXPECT_TRUE(all_end(children));
  return result;
}

// Returns the number of runs that a signal ended.
int tell_all_moments(const Words& words) {
  const Clock::time_point start = Clock::now();
  EXPECT_TRUE(succeeded(graspmap(words)));
  const Clock::duration undisturbed = Clock::now() - start;
  const auto before = all_files();
  int ended = 0;
  for (const Told& one : told) {
    SCOPED_TRACE("told at " + std::to_string(one.moment) + " by signal " +
                 std::to_string(one.signals.front()));
    const ProgramResult result = run_and_tell(words, one, undisturbed);
    if (result.exit_code != 0) {
      ++ended;
      bool is_one = false;
      for (const int signal : one.signals) is_one = is_one || result.exit_code == 128 + signal;
      EXPECT_TRUE(is_one) << "exit code " << result.exit_code;
      EXPECT_EQ(result.standard_error.find("error"), std::string::npos) << result.standard_error;
    }
    const auto after = all_files();
    for (const auto& [name, content] : after) EXPECT_TRUE(before.contains(name)) << name;
    for (const auto& [name, content] : before) {
      EXPECT_TRUE(after.contains(name)) << name;
      if (!holds_times(name) && after.contains(name)) {
        EXPECT_TRUE(after.at(name) == content) << name << " has changed";
      }
    }
  }
  return ended;
}

void make_terrain() { libmap::write_cloud(scratch("t.pcd"), graspmap_test::bumpy_terrain(1.6)); }

void make_small_terrain() { graspmap_test::write_terrain(); }

void make_mesh() {
  ASSERT_TRUE(
      succeeded(graspmap({"simulate", "site", "--edge-length", "0.05", "-o", "site", "--quiet"})));
}

void make_scan() {
  make_mesh();
  ASSERT_TRUE(succeeded(
      graspmap({"simulate", "scan", "site/mesh.ply", "--frames", "4", "-o", "s.db", "--quiet"})));
}

void make_bag() {
  make_mesh();
  ASSERT_TRUE(succeeded(graspmap({"simulate", "cameras", "site/mesh.ply", "-o", "rig"})));
  ASSERT_TRUE(succeeded(graspmap({"convert", "rig", "-o", "rig.bag", "--quiet"})));
}

struct Case {
  const char* name;
  void (*make_inputs)();
  Words words;
};

void PrintTo(const Case& given, std::ostream* out) { *out << given.name; }

class EndedBySignal : public testing::TestWithParam<Case> {};

TEST_P(EndedBySignal, LeavesWhatWasThere) {
  if (GetParam().name == std::string("bag") && graspmap({"info", "none.bag"}).exit_code == 1)
    GTEST_SKIP() << "built without ROS 1";
  GetParam().make_inputs();
  EXPECT_GE(tell_all_moments(GetParam().words), 1);
}

INSTANTIATE_TEST_SUITE_P(
    Commands, EndedBySignal,
    testing::Values(
        Case{"score", make_terrain, {"score", "t.pcd", "-o", "o.pcd", "--quiet"}},
        Case{"simulate_site", [] {}, {"simulate", "site", "--edge-length", "0.02", "-o", "o"}},
        Case{"simulate_scan",
             make_mesh,
             {"simulate", "scan", "site/mesh.ply", "--frames", "4", "-o", "o.db", "--quiet"}},
        Case{"convert", make_scan, {"convert", "s.db", "-o", "o", "--colmap", "o2"}},
        Case{"refine",
             make_scan,
             {"refine", "s.db", "-o", "o.tum", "--report", "o.txt", "--write-database", "o.db",
              "--quiet"}},
        Case{"fuse", make_scan, {"fuse", "s.db", "-o", "o.ply", "--quiet"}},
        Case{"mesh", make_small_terrain, {"mesh", "terrain.pcd", "-o", "o.ply", "--quiet"}},
        Case{"texture",
             make_scan,
             {"texture", "site/mesh.ply", "--scan", "s.db", "--poses", "ground-truth", "-o",
              "o.obj", "--quiet"}},
        Case{"render", make_mesh, {"render", "site/mesh.ply", "-o", "o.png", "--quiet"}},
        Case{"report", make_scan, {"report", ".", "-o", "o.html", "--quiet", "--no-3d"}},
        Case{"bag", make_bag, {"convert", "rig.bag", "-o", "o", "--quiet"}}),
    [](const auto& one) { return one.param.name; });

// A partial tile store is valid and can be resumed.
TEST(EndedBySignal, AStoreOfTilesIsGoneOnWith) {
  make_terrain();
  const Words words = {"score", "t.pcd", "-o", "o.tiles", "--tile-size", "0.1", "--quiet"};
  const Clock::time_point start = Clock::now();
  ASSERT_TRUE(succeeded(graspmap(words)));
  const Clock::duration undisturbed = Clock::now() - start;
  ASSERT_TRUE(succeeded(graspmap({"convert", "o.tiles", "-o", "undisturbed.pcd", "--quiet"})));
  fs::remove_all(scratch("o.tiles"));
  fs::remove(scratch("o.tiles.json"));
  for (const double moment : {0.4, 0.5, 0.6, 0.8}) {
    const ProgramResult result = run_and_tell(words, {moment, {SIGTERM}}, undisturbed);
    EXPECT_TRUE(result.exit_code == 128 + SIGTERM || result.exit_code == 0) << result.exit_code;
    for (const auto& [name, content] : all_files())
      EXPECT_EQ(name.find(".partial"), std::string::npos) << name;
  }
  ASSERT_TRUE(succeeded(graspmap(words)));
  ASSERT_TRUE(succeeded(graspmap({"convert", "o.tiles", "-o", "told.pcd", "--quiet"})));
  EXPECT_TRUE(graspmap_test::content("told.pcd") == graspmap_test::content("undisturbed.pcd"));
}

// Signals are ignored like under nohup and in a shell's background jobs.
TEST(EndedBySignal, AnIgnoredSignalStaysIgnored) {
  make_terrain();
  const std::string program = (graspmap_test::build_folder() / "graspmap").string();
  RunningProgram running({"/bin/sh", "-c", "trap '' INT HUP; exec \"$0\" \"$@\"", program, "score",
                          "t.pcd", "-o", "o.pcd", "--quiet"},
                         {.folder = scratch("")}, true);
  while (!is_claimed() && !running.has_ended()) std::this_thread::sleep_for(1ms);
  kill(running.process(), SIGINT);
  kill(running.process(), SIGHUP);
  EXPECT_TRUE(succeeded(running.wait()));
  EXPECT_TRUE(fs::exists(scratch("o.pcd")));
}

// Signals use a pipe; a command without one does not start.
TEST(Signals, NoFileLeftToOpenForThem) {
  const std::string program = (graspmap_test::build_folder() / "graspmap").string();
  const ProgramResult result = graspmap_test::run_program(
      {"/bin/sh", "-c", "exec 3>&-; ulimit -n 4; exec \"$0\" \"$@\"", program, "info", "none.pcd"},
      {.folder = scratch("")});
  EXPECT_EQ(result.exit_code, 1);
  // Sanitizers need files, too, and print more.
  EXPECT_THAT(result.standard_error, testing::HasSubstr("Too many open files\n"));
}

}  // namespace signals_test
