#include "libgtd/score/tilted_cells.h"

#if defined(GRASPMAP_X86_LOOPS)
#include <immintrin.h>
#endif

namespace libgtd {

namespace {

constexpr std::size_t lanes = TiltedLoops::lanes;

namespace portable {
#include "libgtd/score/tilted_cells_body.h"
#include "libgtd/score/tilted_count_body.h"
constexpr TiltedLoops all = {find_cells, count_common};
}  // namespace portable

#if defined(GRASPMAP_X86_LOOPS)

#pragma GCC push_options
#pragma GCC target("avx2,popcnt")
namespace avx2 {
// NOLINTNEXTLINE(readability-duplicate-include): compiled again for these instructions
#include "libgtd/score/tilted_cells_body.h"
// NOLINTNEXTLINE(readability-duplicate-include)
#include "libgtd/score/tilted_count_body.h"
constexpr TiltedLoops all = {find_cells, count_common};
}  // namespace avx2
#pragma GCC pop_options

#pragma GCC push_options
#pragma GCC target("popcnt,avx512f,avx512vl,avx512vpopcntdq,prefer-vector-width=512")
namespace avx512 {

std::size_t find_cells(const double* const points[3], std::size_t count,
                       const TiltedLattice& lattice, const TiltedBox& box, int* cells) {
  std::size_t found = 0;
  for (std::size_t k = 0; k < count; k += lanes) {
    const __m512d x =
        _mm512_sub_pd(_mm512_loadu_pd(points[0] + k), _mm512_set1_pd(lattice.origin[0]));
    const __m512d y =
        _mm512_sub_pd(_mm512_loadu_pd(points[1] + k), _mm512_set1_pd(lattice.origin[1]));
    const __m512d z =
        _mm512_sub_pd(_mm512_loadu_pd(points[2] + k), _mm512_set1_pd(lattice.origin[2]));
    __m256i cell = _mm256_setzero_si256();
    __mmask8 is_inside = 0xff;
    for (int a = 0; a < 3; ++a) {
      const double* axis = lattice.axes[a];
      const __m512d place =
          _mm512_add_pd(_mm512_add_pd(_mm512_add_pd(_mm512_mul_pd(_mm512_set1_pd(axis[0]), x),
                                                    _mm512_mul_pd(_mm512_set1_pd(axis[1]), y)),
                                      _mm512_mul_pd(_mm512_set1_pd(axis[2]), z)),
                        _mm512_set1_pd(0.5));
      is_inside = _mm512_mask_cmp_pd_mask(is_inside, place, _mm512_set1_pd(box.low[a]), _CMP_GE_OQ);
      is_inside = _mm512_mask_cmp_pd_mask(is_inside, place,
                                          _mm512_set1_pd(box.low[a] + box.size[a]), _CMP_LT_OQ);
      const __m256i at = _mm512_maskz_cvt_roundpd_epi32(is_inside, place,
                                                        _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC);
      cell = _mm256_add_epi32(
          cell, _mm256_mullo_epi32(_mm256_sub_epi32(at, _mm256_set1_epi32(box.low[a])),
                                   _mm256_set1_epi32(box.stride[a])));
    }
    _mm256_mask_compressstoreu_epi32(cells + found, is_inside, cell);
    found += static_cast<std::size_t>(__builtin_popcount(is_inside));
  }
  return found;
}

// NOLINTNEXTLINE(readability-duplicate-include)
#include "libgtd/score/tilted_count_body.h"
constexpr TiltedLoops all = {find_cells, count_common};

}  // namespace avx512
#pragma GCC pop_options

#endif

}  // namespace

const TiltedLoops& tilted_loops_of([[maybe_unused]] InstructionSet instructions) {
#if defined(GRASPMAP_X86_LOOPS)
  if (instructions == InstructionSet::avx512) return avx512::all;
  if (instructions == InstructionSet::avx2) return avx2::all;
#endif
  return portable::all;
}

}  // namespace libgtd
