// Finds the nearest descriptors between two sets a and b, for several instruction sets of the
// processor. The results are identical bits, because each sum is in one vector lane. Only plain
// pointers are used, for the reason in depth_plane_loops.h.
#pragma once

#include "libmap/core/instruction_set.h"

namespace libmap {

struct MatchLoops {
  static constexpr int group = 4;   // Input::a_count is a multiple of `group`
  static constexpr int lanes = 32;  // Input::b_count, with padding, is a multiple of `lanes`

  // Descriptors, unit vectors of `size` values. Value k of descriptor n is a[n * size + k] and
  // b[k * b_count + n]. bias_of_b is 0 for a descriptor, -4 for padding.
  struct Input {
    const float* a;
    const float* b;
    const float* bias_of_b;
    int size;
    int a_count;
    int b_count;
  };
  // One element per descriptor. Of equal products, the first index is returned.
  struct Output {
    float* first_of_a;   // largest scalar product of the descriptor of a with descriptors of b
    float* second_of_a;  // second largest scalar product
    int* nearest_of_a;   // index in b of the largest scalar product
    float* first_of_b;   // largest scalar product with descriptors of a; set to -2 before the call
    int* nearest_of_b;   // index in a of this product; set to -1 before the call
  };
  void (*find_nearest)(const Input& input, const Output& output);
};

// Returns the loops for an instruction set, which the processor must support.
const MatchLoops& match_loops_of(InstructionSet instructions);

}  // namespace libmap
