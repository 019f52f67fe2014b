// Compiles inner loops once per instruction set. GRASPMAP_LOOPS: path of a file that defines
// functions and, at its end, `all`, a table of them. GRASPMAP_REGISTER: size of the vector
// registers, bytes. Include this in an anonymous namespace of a source that is compiled alone.
// The file must not use inline functions of other sources: the linker could keep only AVX copies.

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
