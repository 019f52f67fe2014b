// The readers that take bytes from outside, each as a function that swallows any bytes.
#pragma once

#include <filesystem>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

namespace graspmap_fuzz {

// Reads `bytes` as the target's format and says whether they were accepted. A libmap::Error is the
// right answer to broken bytes; any other exception, a crash, a hang or a sanitizer's report is a
// finding.
struct FuzzTarget {
  const char* name;
  const char* reads;
  bool (*run)(std::string_view bytes);
  std::vector<std::string> (*seeds)();  // well-formed inputs, from which a fuzzer begins
};

inline void PrintTo(const FuzzTarget& target, std::ostream* out) { *out << target.name; }

// By name.
const std::vector<FuzzTarget>& fuzz_targets();
// Throws std::out_of_range if there is none of that name.
const FuzzTarget& fuzz_target(std::string_view name);

// A file a seed in `folder`, which is made.
void write_seeds(const FuzzTarget& target, const std::filesystem::path& folder);

}  // namespace graspmap_fuzz
