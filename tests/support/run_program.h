// Runs programs of this project in separate processes.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace graspmap_test {

struct ProgramResult {
  int exit_code = -1;  // 128 + the signal's number if a signal ended it
  std::string standard_output;
  std::string standard_error;
};

struct ProgramSurroundings {
  std::filesystem::path folder{};  // working folder; empty: that of this process
  std::map<std::string, std::string> environment = {};  // added to that of this process
};

// Runs words[0] with the other words as arguments and empty standard input, and waits for its end.
// Throws std::runtime_error if it cannot be started.
ProgramResult run_program(const std::vector<std::string>& words,
                          const ProgramSurroundings& surroundings = {});

}  // namespace graspmap_test
