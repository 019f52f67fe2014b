// A program of this project that runs during the test.
#pragma once

#include <sys/types.h>

#include <memory>
#include <string>
#include <vector>

#include "tests/support/run_program.h"

namespace graspmap_test {

class RunningProgram {
 public:
  // Starts words[0] with the other words as arguments and empty standard input; with `own_group` as
  // the leader of a new process group. Throws std::runtime_error if it cannot be started.
  explicit RunningProgram(const std::vector<std::string>& words,
                          const ProgramSurroundings& surroundings = {}, bool own_group = false);
  // Kills the program if it still runs.
  ~RunningProgram();
  RunningProgram(const RunningProgram&) = delete;
  RunningProgram& operator=(const RunningProgram&) = delete;

  // Returns the process id; valid until wait() is called.
  pid_t process() const;
  // Returns true if the program has ended.
  bool has_ended() const;
  ProgramResult wait();  // waits for the end of the program

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace graspmap_test
