// Finds the nearest descriptors between two sets, for several instruction sets. All instruction
// sets compute the same bits, because each sum is in one lane. Only plain pointers are used, as in
// depth_plane_loops.h.
#pragma once

#include "libmap/core/instruction_set.h"

namespace libmap {

struct MatchLoops {
  static constexpr int group = 4;   // descriptors of a per step; a_count is a multiple of `group`
  static constexpr int lanes = 32;  // b_count, with padding, is a multiple of `lanes`

  // Descriptors of both sets, which have `size` values each. b is transposed: value k of descriptor
  // n is b[k * b_count + n]. bias_of_b is 0 for a descriptor, -4 for padding.
  struct Input {
    const float* a;
    const float* b;
    const float* bias_of_b;
    int size;
    int a_count;
    int b_count;
  };
  // For each descriptor of a: largest and second largest product with descriptors of b, and the
  // index of the largest. For each descriptor of b: largest product, -2 before the call, and the
  // index of the descriptor of a. The first index counts for equal products.
  struct Output {
    float* first_of_a;
    float* second_of_a;
    int* nearest_of_a;
    float* first_of_b;
    int* nearest_of_b;
  };
  void (*find_nearest)(const Input& input, const Output& output);
};

// Returns the loops for an instruction set, which the processor must have.
const MatchLoops& match_loops_of(InstructionSet instructions);

}  // namespace libmap
