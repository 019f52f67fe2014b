// The loops of bit_count.h for AVX2 and AVX-512; for bit_count.cc alone.
#pragma once

#include "libgtd/score/bit_count.h"

namespace libgtd {

// False on processors of other kinds.
bool has_x86_path(BitPath path);
// Of a path other than `portable`, which the processor has.
const BitLoops& x86_loops(BitPath path);

}  // namespace libgtd
