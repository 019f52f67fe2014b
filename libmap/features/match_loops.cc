#include "libmap/features/match_loops.h"

namespace libmap {

namespace {
#define GRASPMAP_LOOPS "libmap/features/match_loops_body.h"
#include "libmap/core/instruction_set_loops.h"
}  // namespace

const MatchLoops& match_loops_of(InstructionSet instructions) { return all_of(instructions); }

}  // namespace libmap
