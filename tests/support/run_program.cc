#include "tests/support/run_program.h"

#include "tests/support/running_program.h"

namespace graspmap_test {

ProgramResult run_program(const std::vector<std::string>& words,
                          const ProgramSurroundings& surroundings) {
  return RunningProgram(words, surroundings).wait();
}

}  // namespace graspmap_test
