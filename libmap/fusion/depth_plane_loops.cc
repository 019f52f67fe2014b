#include "libmap/fusion/depth_plane_loops.h"

#if defined(GRASPMAP_X86_LOOPS)
#include <immintrin.h>
#endif

namespace libmap {

namespace {
#define GRASPMAP_LOOPS "libmap/fusion/depth_plane_loops_body.h"
#include "libmap/core/instruction_set_loops.h"
}  // namespace

const DepthPlaneLoops& depth_plane_loops_of(InstructionSet instructions) {
  return all_of(instructions);
}

}  // namespace libmap
