#include "libgtd/score/matching_loops.h"

#if defined(GRASPMAP_X86_LOOPS)
#include <immintrin.h>
#endif

namespace libgtd {

namespace {
#define GRASPMAP_LOOPS "libgtd/score/matching_loops_body.h"
#include "libmap/core/instruction_set_loops.h"
}  // namespace

const MatchingLoops& matching_loops_of(libmap::InstructionSet instructions) {
  return all_of(instructions);
}

}  // namespace libgtd
