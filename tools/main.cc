// `graspmap COMMAND ...` starts the program of that command with the rest of the line.
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include "libmap/core/text.h"
#include "tools/standard_output.h"
#include "tools/version_text.h"

namespace {

namespace fs = std::filesystem;

struct CommandEntry {
  const char* name;
  const char* summary;
};

constexpr CommandEntry commands[] = {
    {"simulate", "scenes, rock sites, scans and robot cameras whose truth is known"},
    {"calibrate", "a camera's intrinsics and distortion by pictures of a chessboard"},
    {"extract", "colour, depth, calibrations, poses and links of a scan as plain files"},
    {"refine", "better poses of a scan: loop closures, pose graph, bundle adjustment, depth"},
    {"fuse", "the depth images of a scan -> one oriented, coloured cloud"},
    {"mesh", "a cloud of points -> a clean surface"},
    {"texture", "a mesh with the colours of a scan's photographs"},
    {"crop", "a map levelled and cut to the test site"},
    {"resample", "a surface -> points evenly over it"},
    {"panorama", "depth images of a camera rig -> one cloud in the robot's frame"},
    {"score", "graspability map of a terrain, tile by tile"},
    {"merge", "tiles of a map into one map"},
    {"lookup", "the map's values at listed locations"},
    {"evaluate", "ROC, AUC and accuracy of looked-up scores against a field test"},
    {"analyze", "how much of a map can be held, where; what differs from another map"},
    {"footholds", "the best places of a map, for a planner of steps"},
    {"render", "a picture of a cloud, a mesh or a map"},
    {"summarize", "several maps in one table, also against an expected map"},
    {"chart", "columns of a table as curves"},
    {"sheet", "several maps or pictures side by side, with one legend"},
    {"mask", "a gripper's mask as text, cloud or picture data"},
    {"bag", "ROS 1 bags in and out, offline"},
    {"spot-check", "height errors at places along the edges of a site"},
    {"compare", "how far one cloud or mesh lies from another, and how much of it it covers"},
    {"report", "one HTML file of a whole run"},
    {"info", "what a scan, a cloud, a mesh, a map or a bag holds"},
    {"convert", "any format to any other"},
};

void print_help() {
  std::cout << "graspmap " GRASPMAP_VERSION
               ": graspability maps for robots that climb with spined grippers\n\n"
               "Usage: graspmap COMMAND INPUT... -o OUTPUT [options]\n\nCommands:\n";
  for (const CommandEntry& command : commands) {
    std::string name = command.name;
    name.resize(12, ' ');
    std::cout << "  " << name << command.summary << "\n";
  }
  std::cout << "\ngraspmap COMMAND --help shows each option with its unit and default.\n"
               "Exit codes: 0 done, 1 failed, 2 wrong usage, 3 bad input.\n";
}

bool is_known(const std::string& name) {
  for (const CommandEntry& command : commands)
    if (name == command.name) return true;
  return false;
}

int unknown_command(const std::string& name) {
  std::vector<std::string> names;
  for (const CommandEntry& command : commands) names.emplace_back(command.name);
  std::cerr << "graspmap: error: unknown command " << name << libmap::did_you_mean(name, names)
            << "\n";
  return 2;
}

// Beside this program in the build folder, in ../libexec when installed.
fs::path find_program(const std::string& command) {
  std::error_code code;
  const fs::path folder = fs::read_symlink("/proc/self/exe", code).parent_path();
  for (const char* place : {"libexec/graspmap", "../libexec/graspmap"}) {
    fs::path program = folder / place / ("graspmap-" + command);
    if (fs::exists(program)) return program;
  }
  return folder / "libexec/graspmap" / ("graspmap-" + command);
}

}  // namespace

int main(int argc, char** argv) {
  const std::string first = argc > 1 ? argv[1] : "";
  if (first == "--version") {
    std::cout << graspmap_tools::version_text();
    return graspmap_tools::exit_code_of_printing("graspmap");
  }
  if (first == "--help" || first == "-h" || first == "help") {
    print_help();
    return graspmap_tools::exit_code_of_printing("graspmap");
  }
  if (first.empty()) {
    std::cerr << "graspmap: error: no command: graspmap --help lists them\n";
    return 2;
  }
  if (!is_known(first)) return unknown_command(first);
  const fs::path program = find_program(first);
  execv(program.c_str(), argv + 1);
  std::cerr << "graspmap " << first << ": error: cannot start " << program.string() << ": "
            << std::strerror(errno)
            << (errno == ENOENT ? "; scripts/build builds all commands" : "") << "\n";
  return 1;
}
