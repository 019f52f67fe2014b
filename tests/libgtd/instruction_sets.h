#pragma once

#include <vector>

#include "libmap/core/instruction_set.h"

namespace graspmap_test {

// Those that the processor has.
inline std::vector<libmap::InstructionSet> instruction_sets() {
  using libmap::InstructionSet;
  std::vector<InstructionSet> all;
  for (const InstructionSet set :
       {InstructionSet::portable, InstructionSet::avx2, InstructionSet::avx512})
    if (libmap::has_instruction_set(set)) all.push_back(set);
  return all;
}

}  // namespace graspmap_test
