#include "libmap/core/instruction_set.h"

#include <initializer_list>

namespace libmap {

bool has_instruction_set([[maybe_unused]] InstructionSet set) {
#if defined(GRASPMAP_X86_LOOPS)
  if (set == InstructionSet::avx2)
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("popcnt");
  if (set == InstructionSet::avx512)
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
           __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512vpopcntdq");
#endif
  return set == InstructionSet::portable;
}

InstructionSet best_instruction_set() {
  for (const InstructionSet set : {InstructionSet::avx512, InstructionSet::avx2})
    if (has_instruction_set(set)) return set;
  return InstructionSet::portable;
}

}  // namespace libmap
