// graspmap simulate WHAT: simulates terrains and recordings with ground truth.
#include "tools/support/subcommands.h"

#include <iostream>
#include <string>
#include <vector>

#include "libmap/core/text.h"
#include "tools/support/process_end.h"

namespace {

struct Entry {
  const char* name;
  const char* summary;
  int (*run)(int argc, char** argv);
};

constexpr Entry entries[] = {
    {"cameras", "depth images of a robot's cameras on a mesh", graspmap_tools::simulate_cameras},
    {"scan", "a scan of a mesh as a scan database", graspmap_tools::simulate_scan},
    {"scene", "a scene of primitive shapes as cloud or mesh", graspmap_tools::simulate_scene},
    {"site", "rocks, slopes or a climbing wall: true mesh and test locations",
     graspmap_tools::simulate_site},
    {"terrain", "rocky ground of any size as a folder of clouds", graspmap_tools::simulate_terrain},
};

void print_help() {
  std::cout << "Terrains and recordings with ground truth.\n\n"
               "Usage: graspmap simulate WHAT ... -o OUTPUT [options]\n\nWHAT:\n";
  for (const Entry& entry : entries) {
    std::string name = entry.name;
    name.resize(12, ' ');
    std::cout << "  " << name << entry.summary << "\n";
  }
  std::cout << "\ngraspmap simulate WHAT --help shows each option with its unit and default.\n";
}

}  // namespace

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "";
  if (what == "--help" || what == "-h") {
    print_help();
    return graspmap_tools::exit_code_of_printing("graspmap simulate");
  }
  std::vector<std::string> names;
  for (const Entry& entry : entries) {
    if (what == entry.name) return entry.run(argc - 1, argv + 1);
    names.emplace_back(entry.name);
  }
  std::cerr << "graspmap simulate: error: "
            << (what.empty() ? "WHAT is missing"
                             : "unknown " + what + libmap::did_you_mean(what, names))
            << "; graspmap simulate --help lists all\n";
  return 2;
}
