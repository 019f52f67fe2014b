// `graspmap COMMAND ...` starts the program of that command with the rest of the line.
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include "libmap/core/text.h"
#include "tools/support/commands.h"
#include "tools/support/standard_output.h"
#include "tools/support/version_text.h"

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
