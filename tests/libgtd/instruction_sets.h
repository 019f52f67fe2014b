#pragma once

#include <vector>

#include "libmap/core/instruction_set.h"

namespace graspmap_test {

// Returns the instruction sets that the processor supports.
inline std::vector<libmap::InstructionSet> instruction_sets() {
  using libmap::InstructionSet;
  std::vector<libmap::InstructionSet> all;
  for (const libmap::InstructionSet set :
       {libmap::InstructionSet::portable, libmap::InstructionSet::avx2,
        libmap::InstructionSet::avx512})
    if (libmap::has_instruction_set(set)) all.push_back(set);
  return all;
}

}  // namespace graspmap_test
