// The loops of bit_count.h for AVX2 and AVX-512; for bit_count.cc alone.
#pragma once

#include "libgtd/score/bit_count.h"

namespace libgtd {

// Of instructions other than `portable`, which the processor has.
const BitLoops& x86_loops(InstructionSet instructions);

}  // namespace libgtd
