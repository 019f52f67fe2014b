// The instruction sets that the innermost loops are written for. No inline functions: this is seen
// by sources that are compiled for more than the base instruction set.
#pragma once

namespace libmap {

// avx2: with POPCNT. avx512: F, BW, VL and VPOPCNTDQ.
enum class InstructionSet { portable, avx2, avx512 };

// Whether this processor has it and loops for it were built; `portable` always.
bool has_instruction_set(InstructionSet set);
InstructionSet best_instruction_set();  // the fastest of those that it has

}  // namespace libmap
