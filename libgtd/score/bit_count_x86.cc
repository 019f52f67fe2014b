#include "libgtd/score/bit_count_x86.h"

#if defined(GRASPMAP_X86_LOOPS)

#include <immintrin.h>

#include "libgtd/score/bit_count_loops.h"

// Each function carries its instruction set, so that the file as a whole is compiled for the base.
#define GRASPMAP_AVX2 __attribute__((target("avx2,popcnt")))
#define GRASPMAP_AVX512                                                      \
  __attribute__((                                                            \
      target("avx2,popcnt,avx512f,avx512bw,avx512vl,avx512vpopcntdq,prefer-" \
             "vector-width=512")))

namespace libgtd {

namespace {

namespace avx512 {

// GCC 12 warns of its own reductions, casts and plain extracts (GCC bug 105593), not of this one.
template <int Part>
GRASPMAP_AVX512 inline __m256i half(__m512i v) {
  return _mm512_maskz_extracti64x4_epi64(0xff, v, Part);
}

GRASPMAP_AVX512 inline std::uint32_t sum_of_64s(__m512i v) {
  const __m256i four = _mm256_add_epi64(half<0>(v), half<1>(v));
  const __m128i two =
      _mm_add_epi64(_mm256_castsi256_si128(four), _mm256_extracti128_si256(four, 1));
  return static_cast<std::uint32_t>(_mm_cvtsi128_si64(two) + _mm_extract_epi64(two, 1));
}

GRASPMAP_AVX512 inline std::uint32_t sum_of_32s(__m512i v) {
  const __m256i eight = _mm256_add_epi32(half<0>(v), half<1>(v));
  const __m128i four =
      _mm_add_epi32(_mm256_castsi256_si128(eight), _mm256_extracti128_si256(eight, 1));
  const __m128i two = _mm_add_epi32(four, _mm_unpackhi_epi64(four, four));
  return static_cast<std::uint32_t>(_mm_cvtsi128_si32(two) + _mm_extract_epi32(two, 1));
}

// For `Group` pivots at once, which share the loads of the mask.
template <int Group>
GRASPMAP_AVX512 void count_group(const std::uint16_t* window, const std::uint32_t* origins,
                                 const MaskChunk* chunks, const std::uint32_t* offsets,
                                 std::size_t chunk_count, std::uint32_t* counts) {
  const std::uint16_t* at[Group];
  __m512i sums[Group];
  for (int g = 0; g < Group; ++g) {
    at[g] = window + origins[g];
    sums[g] = _mm512_setzero_si512();
  }
  for (std::size_t c = 0; c < chunk_count; ++c) {
    const __m512i mask = _mm512_load_si512(chunks[c].bits);
    for (int g = 0; g < Group; ++g) {
      const __m512i bits = _mm512_loadu_si512(at[g] + offsets[c]);
      sums[g] = _mm512_add_epi64(sums[g], _mm512_popcnt_epi64(_mm512_and_si512(bits, mask)));
    }
  }
  for (int g = 0; g < Group; ++g) counts[g] = sum_of_64s(sums[g]);
}

GRASPMAP_AVX512 void count(const std::uint16_t* window, const std::uint32_t* origins,
                           std::size_t origin_count, const MaskChunk* chunks,
                           const std::uint32_t* offsets, std::size_t chunk_count,
                           std::uint32_t* counts) {
  std::size_t n = 0;
  for (; n + 8 <= origin_count; n += 8)
    count_group<8>(window, origins + n, chunks, offsets, chunk_count, counts + n);
  for (; n + 2 <= origin_count; n += 2)
    count_group<2>(window, origins + n, chunks, offsets, chunk_count, counts + n);
  for (; n < origin_count; ++n)
    count_group<1>(window, origins + n, chunks, offsets, chunk_count, counts + n);
}

GRASPMAP_AVX512 void lower(std::uint16_t* planes, std::size_t plane_count, std::size_t columns,
                           unsigned distance) {
  loops::lower(planes, plane_count, columns, distance);
}

GRASPMAP_AVX512 void slide(std::uint16_t* sums, const std::uint16_t* entering,
                           const std::uint16_t* leaving, std::size_t count) {
  loops::slide(sums, entering, leaving, count);
}

GRASPMAP_AVX512 void add_runs(const std::uint16_t* sums, const std::uint32_t* places,
                              std::size_t place_count, std::size_t length, std::uint32_t* totals) {
  const std::size_t whole = length / 32;
  const auto rest = static_cast<__mmask32>((std::uint64_t{1} << (length % 32)) - 1);
  const __m512i even = _mm512_set1_epi32(0xffff);
  for (std::size_t n = 0; n < place_count; ++n) {
    const std::uint16_t* run = sums + places[n];
    __m512i total = _mm512_setzero_si512();
    for (std::size_t w = 0; w <= whole; ++w, run += 32) {
      const __m512i pairs =
          w < whole ? _mm512_loadu_si512(run) : _mm512_maskz_loadu_epi16(rest, run);
      total = _mm512_add_epi32(total, _mm512_add_epi32(_mm512_and_si512(pairs, even),
                                                       _mm512_maskz_srli_epi32(0xffff, pairs, 16)));
    }
    totals[n] = sum_of_32s(total);
  }
}

constexpr BitLoops all = {count, lower, slide, add_runs};

}  // namespace avx512

namespace avx2 {

// Population counts of bytes by a table of nibbles (Mula, Kurz, Lemire 2018, section 3.1).
GRASPMAP_AVX2 inline __m256i count_bytes(__m256i bits) {
  const __m256i table = _mm256_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4,  //
                                         0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4);
  const __m256i nibble = _mm256_set1_epi8(0x0f);
  const __m256i low = _mm256_and_si256(bits, nibble);
  const __m256i high = _mm256_and_si256(_mm256_srli_epi16(bits, 4), nibble);
  return _mm256_add_epi8(_mm256_shuffle_epi8(table, low), _mm256_shuffle_epi8(table, high));
}

template <int Group>
GRASPMAP_AVX2 void count_group(const std::uint16_t* window, const std::uint32_t* origins,
                               const MaskChunk* chunks, const std::uint32_t* offsets,
                               std::size_t chunk_count, std::uint32_t* counts) {
  constexpr std::size_t most_chunks = 15;  // two times at most 8 in each byte
  const __m256i zero = _mm256_setzero_si256();
  const std::uint16_t* at[Group];
  __m256i sums[Group];
  for (int g = 0; g < Group; ++g) {
    at[g] = window + origins[g];
    sums[g] = zero;
  }
  for (std::size_t first = 0; first < chunk_count; first += most_chunks) {
    const std::size_t last = first + most_chunks < chunk_count ? first + most_chunks : chunk_count;
    __m256i bytes[Group];
    for (int g = 0; g < Group; ++g) bytes[g] = zero;
    for (std::size_t c = first; c < last; ++c)
      for (int half = 0; half < 2; ++half) {
        const __m256i mask =
            _mm256_load_si256(reinterpret_cast<const __m256i*>(chunks[c].bits) + half);
        for (int g = 0; g < Group; ++g) {
          const __m256i bits =
              _mm256_loadu_si256(reinterpret_cast<const __m256i*>(at[g] + offsets[c]) + half);
          bytes[g] = _mm256_add_epi8(bytes[g], count_bytes(_mm256_and_si256(bits, mask)));
        }
      }
    for (int g = 0; g < Group; ++g)
      sums[g] = _mm256_add_epi64(sums[g], _mm256_sad_epu8(bytes[g], zero));
  }
  for (int g = 0; g < Group; ++g) {
    const __m128i halves =
        _mm_add_epi64(_mm256_castsi256_si128(sums[g]), _mm256_extracti128_si256(sums[g], 1));
    counts[g] =
        static_cast<std::uint32_t>(_mm_cvtsi128_si64(halves) + _mm_extract_epi64(halves, 1));
  }
}

GRASPMAP_AVX2 void count(const std::uint16_t* window, const std::uint32_t* origins,
                         std::size_t origin_count, const MaskChunk* chunks,
                         const std::uint32_t* offsets, std::size_t chunk_count,
                         std::uint32_t* counts) {
  std::size_t n = 0;
  for (; n + 4 <= origin_count; n += 4)
    count_group<4>(window, origins + n, chunks, offsets, chunk_count, counts + n);
  for (; n < origin_count; ++n)
    count_group<1>(window, origins + n, chunks, offsets, chunk_count, counts + n);
}

GRASPMAP_AVX2 void lower(std::uint16_t* planes, std::size_t plane_count, std::size_t columns,
                         unsigned distance) {
  loops::lower(planes, plane_count, columns, distance);
}

GRASPMAP_AVX2 void slide(std::uint16_t* sums, const std::uint16_t* entering,
                         const std::uint16_t* leaving, std::size_t count) {
  loops::slide(sums, entering, leaving, count);
}

GRASPMAP_AVX2 void add_runs(const std::uint16_t* sums, const std::uint32_t* places,
                            std::size_t place_count, std::size_t length, std::uint32_t* totals) {
  loops::add_runs(sums, places, place_count, length, totals);
}

constexpr BitLoops all = {count, lower, slide, add_runs};

}  // namespace avx2

}  // namespace

const BitLoops& x86_loops(InstructionSet instructions) {
  return instructions == InstructionSet::avx512 ? avx512::all : avx2::all;
}

}  // namespace libgtd

#else

namespace libgtd {

const BitLoops& x86_loops(InstructionSet) { return loops_of(InstructionSet::portable); }

}  // namespace libgtd

#endif
