// Macros for speed-critical functions: GCC also compiles them for AVX2, and the program selects a
// version at startup. Results are the same, because no operations are fused (-ffp-contract=off).
#pragma once

#if defined(GRASPMAP_X86_LOOPS) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define GRASPMAP_CLONED __attribute__((target_clones("avx2", "default"), optimize("O3")))
// For loops with a conditional value: the unused value may raise floating-point exceptions.
#define GRASPMAP_CLONED_CHOICE \
  __attribute__((target_clones("avx2", "default"), optimize("O3", "no-trapping-math")))
#else
#define GRASPMAP_CLONED
#define GRASPMAP_CLONED_CHOICE
#endif
