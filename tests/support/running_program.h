// A program of this project that runs beside the test.
#pragma once

#include <sys/types.h>

#include <memory>
#include <string>
#include <vector>

#include "tests/support/run_program.h"

namespace graspmap_test {

class RunningProgram {
 public:
  // Starts words[0] with the other words as its arguments, nothing on its standard input, with
  // `own_group` as the leader of a process group. Throws std::runtime_error if it cannot be
  // started.
  explicit RunningProgram(const std::vector<std::string>& words,
                          const ProgramSurroundings& surroundings = {}, bool own_group = false);
  // Kills it if it still runs.
  ~RunningProgram();
  RunningProgram(const RunningProgram&) = delete;
  RunningProgram& operator=(const RunningProgram&) = delete;

  // Its number, as long as wait() was not called.
  pid_t process() const;
  // Whether it has ended.
  bool has_ended() const;
  ProgramResult wait();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace graspmap_test
