// Selects the instruction set (AVX2, AVX-512) of speed-critical inner loops. Contains no inline
// functions, because sources that are compiled for more than the base instruction set include it.
#pragma once

namespace libmap {

// portable: the compiler's base set. avx2: AVX2, POPCNT. avx512: also AVX-512 F, BW, VL, VPOPCNTDQ.
enum class InstructionSet { portable, avx2, avx512 };

// True if this processor supports `set` and graspmap contains code for it; true for `portable`.
bool has_instruction_set(InstructionSet set);
InstructionSet best_instruction_set();  // the fastest supported set

}  // namespace libmap
