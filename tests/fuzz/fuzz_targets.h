// Targets for fuzzing: the readers of external data, each as a function of any bytes.
#pragma once

#include <filesystem>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

namespace graspmap_fuzz {

// A reader as a fuzz target. `run` reads bytes as the format `reads` and returns true if they are
// accepted. libmap::Error is the correct result for invalid bytes; any other exception, a crash, a
// hang or a report of a sanitizer is a finding.
struct FuzzTarget {
  const char* name;
  const char* reads;
  bool (*run)(std::string_view bytes);
  std::vector<std::string> (*seeds)();  // valid inputs, with which a fuzzer begins
};

inline void PrintTo(const FuzzTarget& target, std::ostream* out) { *out << target.name; }

// Returns all targets, ascending by name.
const std::vector<FuzzTarget>& fuzz_targets();
// Returns the target `name`. Throws std::out_of_range if there is none.
const FuzzTarget& fuzz_target(std::string_view name);

// Creates `folder` and writes one file per seed into it.
void write_seeds(const FuzzTarget& target, const std::filesystem::path& folder);

}  // namespace graspmap_fuzz
