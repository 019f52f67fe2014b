// `graspmap COMMAND ...` starts the program of the command with the remaining arguments.
#include <unistd.h>

#include <CGAL/version.h>
#include <OpenMesh/Core/System/config.h>
#include <assimp/version.h>
#include <ceres/version.h>
#include <embree3/rtcore_config.h>
#include <oneapi/tbb/version.h>
#include <pcl/pcl_config.h>
#include <spdlog/version.h>
#include <sqlite3.h>
#include <vtkVersionMacros.h>
#include <CLI/Version.hpp>
#include <Eigen/Core>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <opencv2/core/version.hpp>
#include <string>
#include <vector>

#include "commit.h"  // of the build folder
#include "libmap/core/text.h"
#include "tools/support/commands.h"
#include "tools/support/process_end.h"

namespace {

namespace fs = std::filesystem;

using graspmap_tools::CommandEntry;
using graspmap_tools::commands;

void print_help() {
  std::cout << "graspmap " GRASPMAP_VERSION
               ": graspability maps for robots that climb with spined grippers\n\n"
               "Usage: graspmap COMMAND INPUT... -o OUTPUT [options]\n";
  std::string_view group;
  for (const CommandEntry& command : commands) {
    if (command.group != group) std::cout << "\n" << command.group << ":\n";
    group = command.group;
    std::string name(command.name);
    name.resize(12, ' ');
    std::cout << "  " << name << command.summary << "\n";
  }
  std::cout << "\ngraspmap COMMAND --help shows each option with its unit and default.\n"
               "Exit codes: 0 done, 1 failed, 2 wrong usage, 3 bad input.\n";
}

int unknown_command(const std::string& name) {
  std::vector<std::string> names;
  for (const CommandEntry& command : commands) names.emplace_back(command.name);
  std::cerr << "graspmap: error: unknown command " << name << libmap::did_you_mean(name, names)
            << "\n";
  return 2;
}

// Path of a command's program: next to this program in the build folder, else in ../libexec.
fs::path find_program(const std::string& command) {
  std::error_code code;
  const fs::path folder = fs::read_symlink("/proc/self/exe", code).parent_path();
  for (const char* folder_path : {"libexec/graspmap", "../libexec/graspmap"}) {
    fs::path program = folder / folder_path / ("graspmap-" + command);
    if (fs::exists(program)) return program;
  }
  return folder / "libexec/graspmap" / ("graspmap-" + command);
}

#define GRASPMAP_TEXT_OF(macro) #macro
#define GRASPMAP_TEXT(macro) GRASPMAP_TEXT_OF(macro)

std::string dotted(int major, int minor, int patch) {
  return std::to_string(major) + "." + std::to_string(minor) + "." + std::to_string(patch);
}

// "graspmap VERSION", then one line each for the commit, the compiler and every library with its
// version at build time.
std::string version_text() {
  std::string text = "graspmap " GRASPMAP_VERSION "\ncommit: " GRASPMAP_COMMIT
                     "\ncompiler: " GRASPMAP_COMPILER "\n";
  const auto add = [&](const char* library, const std::string& version) {
    text += std::string(library) + ": " + version + "\n";
  };
  add("PCL", dotted(PCL_MAJOR_VERSION, PCL_MINOR_VERSION, PCL_REVISION_VERSION));
  add("CGAL", GRASPMAP_TEXT(CGAL_VERSION));
  add("OpenMesh", dotted(OM_GET_VER, OM_GET_MAJ, OM_GET_MIN));
  add("Ceres", CERES_VERSION_STRING);
  add("OpenCV", CV_VERSION);
  add("assimp", GRASPMAP_ASSIMP_VERSION);
  add("VTK", VTK_VERSION);
  add("Embree", RTC_VERSION_STRING);
  add("Eigen", dotted(EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION));
  add("oneTBB", dotted(TBB_VERSION_MAJOR, TBB_VERSION_MINOR, TBB_VERSION_PATCH));
  add("SQLite", SQLITE_VERSION);
  add("CLI11", CLI11_VERSION);
  add("spdlog", dotted(SPDLOG_VER_MAJOR, SPDLOG_VER_MINOR, SPDLOG_VER_PATCH));
  add("nlohmann-json", dotted(NLOHMANN_JSON_VERSION_MAJOR, NLOHMANN_JSON_VERSION_MINOR,
                              NLOHMANN_JSON_VERSION_PATCH));
  return text;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string first = argc > 1 ? argv[1] : "";
  if (first == "--version") {
    std::cout << version_text();
    return graspmap_tools::exit_code_of_printing("graspmap");
  }
  if (first.empty() || first == "--help" || first == "-h" || first == "help") {
    print_help();
    return graspmap_tools::exit_code_of_printing("graspmap");
  }
  if (graspmap_tools::summary_of(first).empty()) return unknown_command(first);
  const fs::path program = find_program(first);
  execv(program.c_str(), argv + 1);
  std::cerr << "graspmap " << first << ": error: cannot start " << program.string() << ": "
            << std::strerror(errno)
            << (errno == ENOENT ? "; scripts/build builds all commands" : "") << "\n";
  return 1;
}
