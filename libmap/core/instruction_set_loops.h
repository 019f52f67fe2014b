// Compiles a file of inner loops once per instruction set. Before including this header, define
// GRASPMAP_LOOPS as the path of that file. The file defines functions and, at its end, the table
// `all` of these functions. It can use GRASPMAP_REGISTER, the vector registers' size in bytes.
// Include this header in an anonymous namespace of a source that is not part of a unity build. The
// file must not use inline functions of other sources: the linker could keep only their AVX code.

#define GRASPMAP_REGISTER 16
namespace portable {
#include GRASPMAP_LOOPS
}  // namespace portable
#undef GRASPMAP_REGISTER

#if defined(GRASPMAP_X86_LOOPS)

#pragma GCC push_options
#pragma GCC target("avx2,popcnt")
#define GRASPMAP_REGISTER 32
namespace avx2 {
#include GRASPMAP_LOOPS
}  // namespace avx2
#undef GRASPMAP_REGISTER
#pragma GCC pop_options

#pragma GCC push_options
#pragma GCC target("avx2,popcnt,avx512f,avx512bw,avx512vl,avx512vpopcntdq,prefer-vector-width=512")
#define GRASPMAP_REGISTER 64
namespace avx512 {
#include GRASPMAP_LOOPS
}  // namespace avx512
#undef GRASPMAP_REGISTER
#pragma GCC pop_options

#endif

// Returns the table `all` for an instruction set.
constexpr auto& all_of([[maybe_unused]] libmap::InstructionSet instructions) {
#if defined(GRASPMAP_X86_LOOPS)
  if (instructions == libmap::InstructionSet::avx512) return avx512::all;
  if (instructions == libmap::InstructionSet::avx2) return avx2::all;
#endif
  return portable::all;
}
