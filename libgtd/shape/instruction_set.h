// The instruction sets of libmap/core/instruction_set.h. No inline functions, as there.
#pragma once

#include "libmap/core/instruction_set.h"

namespace libgtd {

using libmap::best_instruction_set;
using libmap::has_instruction_set;
using libmap::InstructionSet;

}  // namespace libgtd
