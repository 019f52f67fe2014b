// All outputs of this process that are in the making: several are put in place as one step, and a
// process that is told to end leaves none behind.
#pragma once

#include <filesystem>
#include <mutex>
#include <vector>

#include "libmap/core/file_output.h"

namespace libmap {

// Syncs all `outputs`, then puts them in place in their order. abandon_unfinished_outputs() takes
// effect before or after all of it. Throws Error (failed) as OutputFile::commit() does.
void commit_together(std::vector<OutputFile>& outputs);

// While one lives, abandon_unfinished_outputs() waits: for outputs that belong together and are put
// in place one after the other.
class OutputsInStep {
 public:
  OutputsInStep();

 private:
  std::unique_lock<std::recursive_mutex> lock_;
};

// Removes the temporary files and folders of all outputs. Threads that make, commit or drop an
// output wait from then on and for ever: call it right before the process ends.
void abandon_unfinished_outputs();

// Whether a file or folder bears the name of one in the making. A run that was killed leaves such.
bool is_named_unfinished(const std::filesystem::path& path);

// What OutputFile and OutputFolder tell of themselves, in an OutputsInStep.
void add_unfinished_output(const std::filesystem::path& temporary);
void drop_unfinished_output(const std::filesystem::path& temporary);

}  // namespace libmap
