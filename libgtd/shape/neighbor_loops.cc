#include "libgtd/shape/neighbor_loops.h"

#if defined(GRASPMAP_X86_LOOPS)
#include <immintrin.h>
#endif

namespace libgtd {

namespace {

std::size_t select(const NeighborLoops::Places& candidates, std::size_t count, const double* center,
                   double radius, const NeighborLoops::Places& neighbors) {
  const double inverse = 1 / radius;
  const double limit = radius * radius;
  std::size_t selected = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const double x = candidates.x[k] - center[0];
    const double y = candidates.y[k] - center[1];
    const double z = candidates.z[k] - center[2];
    neighbors.x[selected] = x * inverse;
    neighbors.y[selected] = y * inverse;
    neighbors.z[selected] = z * inverse;
    selected += x * x + y * y + z * z <= limit ? 1 : 0;
  }
  for (std::size_t k = selected; k < selected + NeighborLoops::lanes; ++k)
    neighbors.x[k] = neighbors.y[k] = neighbors.z[k] = 0;
  return selected;
}

std::size_t rank(const float* x, const float* y, const float* z, std::size_t count,
                 const float* center, float limit, std::uint64_t* keys) {
  constexpr std::size_t at_once = NeighborLoops::rank_lanes;
  std::size_t ranked = 0;
  for (std::size_t first = 0; first < count; first += at_once) {
    float squares[at_once];
    for (std::size_t n = 0; n < at_once; ++n) {
      const float dx = center[0] - x[first + n], dy = center[1] - y[first + n],
                  dz = center[2] - z[first + n];
      squares[n] = dx * dx + dy * dy + dz * dz;
    }
    for (std::size_t n = 0; n < at_once; ++n) {
      std::uint32_t bits = 0;
      __builtin_memcpy(&bits, &squares[n], sizeof(bits));
      keys[ranked] = std::uint64_t{bits} << 32 | (first + n);
      ranked += squares[n] < limit ? 1 : 0;
    }
  }
  return ranked;
}

namespace portable {
#include "libgtd/shape/neighbor_loops_body.h"
constexpr NeighborLoops all = {select, sum_moments, sum_quadric, rank};
}  // namespace portable

#if defined(GRASPMAP_X86_LOOPS)

#pragma GCC push_options
#pragma GCC target("avx2")
namespace avx2 {
// NOLINTNEXTLINE(readability-duplicate-include): compiled again for these instructions
#include "libgtd/shape/neighbor_loops_body.h"
constexpr NeighborLoops all = {select, sum_moments, sum_quadric, rank};
}  // namespace avx2
#pragma GCC pop_options

#pragma GCC push_options
#pragma GCC target("avx512f,prefer-vector-width=512")
namespace avx512 {
// NOLINTNEXTLINE(readability-duplicate-include)
#include "libgtd/shape/neighbor_loops_body.h"

std::size_t select(const NeighborLoops::Places& candidates, std::size_t count, const double* center,
                   double radius, const NeighborLoops::Places& neighbors) {
  const __m512d inverse = _mm512_set1_pd(1 / radius), limit = _mm512_set1_pd(radius * radius);
  const __m512d cx = _mm512_set1_pd(center[0]), cy = _mm512_set1_pd(center[1]),
                cz = _mm512_set1_pd(center[2]);
  std::size_t selected = 0;
  const auto keep = [&](double* to, __mmask8 within, __m512d offset) {
    _mm512_storeu_pd(to + selected,
                     _mm512_maskz_compress_pd(within, _mm512_mul_pd(offset, inverse)));
  };
  for (std::size_t k = 0; k < count; k += NeighborLoops::lanes) {
    const __m512d x = _mm512_sub_pd(_mm512_loadu_pd(candidates.x + k), cx);
    const __m512d y = _mm512_sub_pd(_mm512_loadu_pd(candidates.y + k), cy);
    const __m512d z = _mm512_sub_pd(_mm512_loadu_pd(candidates.z + k), cz);
    const __m512d squares =
        _mm512_add_pd(_mm512_add_pd(_mm512_mul_pd(x, x), _mm512_mul_pd(y, y)), _mm512_mul_pd(z, z));
    const __mmask8 within = _mm512_cmp_pd_mask(squares, limit, _CMP_LE_OQ);
    keep(neighbors.x, within, x);
    keep(neighbors.y, within, y);
    keep(neighbors.z, within, z);
    selected += static_cast<std::size_t>(__builtin_popcount(within));
  }
  _mm512_storeu_pd(neighbors.x + selected, _mm512_setzero_pd());
  _mm512_storeu_pd(neighbors.y + selected, _mm512_setzero_pd());
  _mm512_storeu_pd(neighbors.z + selected, _mm512_setzero_pd());
  return selected;
}

std::size_t rank(const float* x, const float* y, const float* z, std::size_t count,
                 const float* center, float limit, std::uint64_t* keys) {
  const __m512 cx = _mm512_set1_ps(center[0]), cy = _mm512_set1_ps(center[1]),
               cz = _mm512_set1_ps(center[2]);
  const __m512 nearest_out = _mm512_set1_ps(limit);
  const __m512i step = _mm512_set1_epi32(static_cast<int>(NeighborLoops::rank_lanes));
  __m512i number = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  std::size_t ranked = 0;
  for (std::size_t n = 0; n < count; n += NeighborLoops::rank_lanes) {
    const __m512 dx = _mm512_sub_ps(cx, _mm512_loadu_ps(x + n));
    const __m512 dy = _mm512_sub_ps(cy, _mm512_loadu_ps(y + n));
    const __m512 dz = _mm512_sub_ps(cz, _mm512_loadu_ps(z + n));
    const __m512 squares = _mm512_add_ps(
        _mm512_add_ps(_mm512_mul_ps(dx, dx), _mm512_mul_ps(dy, dy)), _mm512_mul_ps(dz, dz));
    const __mmask16 within = _mm512_cmp_ps_mask(squares, nearest_out, _CMP_LT_OQ);
    const __m512i bits = _mm512_maskz_compress_epi32(within, _mm512_castps_si512(squares));
    const __m512i low = _mm512_maskz_compress_epi32(within, number);
    const auto join = [&](__m256i upper, __m256i lower) {
      return _mm512_or_si512(
          _mm512_maskz_slli_epi64(0xff, _mm512_maskz_cvtepu32_epi64(0xff, upper), 32),
          _mm512_maskz_cvtepu32_epi64(0xff, lower));
    };
    _mm512_storeu_si512(keys + ranked, join(_mm512_maskz_extracti64x4_epi64(0xff, bits, 0),
                                            _mm512_maskz_extracti64x4_epi64(0xff, low, 0)));
    _mm512_storeu_si512(keys + ranked + 8, join(_mm512_maskz_extracti64x4_epi64(0xff, bits, 1),
                                                _mm512_maskz_extracti64x4_epi64(0xff, low, 1)));
    ranked += static_cast<std::size_t>(__builtin_popcount(within));
    number = _mm512_add_epi32(number, step);
  }
  return ranked;
}

constexpr NeighborLoops all = {select, sum_moments, sum_quadric, rank};
}  // namespace avx512
#pragma GCC pop_options

#endif

}  // namespace

const NeighborLoops& neighbor_loops_of([[maybe_unused]] InstructionSet instructions) {
#if defined(GRASPMAP_X86_LOOPS)
  if (instructions == InstructionSet::avx512) return avx512::all;
  if (instructions == InstructionSet::avx2) return avx2::all;
#endif
  return portable::all;
}

}  // namespace libgtd
