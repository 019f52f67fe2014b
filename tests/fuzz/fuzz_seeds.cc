// fuzz_seeds FOLDER: well-formed inputs of every fuzz target, a folder each. Prints the targets,
// one a line, and what they read.
#include <iostream>

#include "tests/fuzz/fuzz_targets.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: fuzz_seeds FOLDER\n";
    return 2;
  }
  for (const graspmap_fuzz::FuzzTarget& target : graspmap_fuzz::fuzz_targets()) {
    graspmap_fuzz::write_seeds(target, std::filesystem::path(argv[1]) / target.name);
    std::cout << target.name << '\t' << target.reads << '\n';
  }
  return 0;
}
