// Marks a loop that GCC compiles for AVX2 too and chooses when the program starts. The results are
// the same: no operation is fused (-ffp-contract=off).
#pragma once

#if defined(GRASPMAP_X86_LOOPS) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define GRASPMAP_CLONED __attribute__((target_clones("avx2", "default"), optimize("O3")))
// Of loops that choose: the numbers that are not chosen may trap.
#define GRASPMAP_CLONED_CHOICE \
  __attribute__((target_clones("avx2", "default"), optimize("O3", "no-trapping-math")))
#else
#define GRASPMAP_CLONED
#define GRASPMAP_CLONED_CHOICE
#endif
