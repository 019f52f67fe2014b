// Bodies of the functions of matching_loops.h, compiled once per instruction set by
// matching_loops.cc.

using Words [[gnu::vector_size(GRASPMAP_REGISTER)]] = std::uint64_t;
using Numbers [[gnu::vector_size(GRASPMAP_REGISTER)]] = std::uint32_t;

// add_bits adds the number of set bits of each word, or of each byte (at most 8), to `counts`.
// After at most max_added calls, widen must convert byte counts to word counts.
#if GRASPMAP_REGISTER == 64

constexpr std::size_t max_added = std::size_t{1} << 32;
inline void add_bits(const Words& v, Words& counts) {
  counts += Words(_mm512_popcnt_epi64(__m512i(v)));
}
inline void widen(Words&) {}

#elif GRASPMAP_REGISTER == 32

// Table of nibbles (Mula, Kurz, Lemire 2018, section 3.1).
constexpr std::size_t max_added = 31;
inline void add_bits(const Words& v, Words& counts) {
  const __m256i table = _mm256_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4,  //
                                         0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4);
  constexpr std::uint64_t nibble = 0x0f0f0f0f0f0f0f0fU;
  counts += Words(_mm256_shuffle_epi8(table, __m256i(v & nibble)));
  counts += Words(_mm256_shuffle_epi8(table, __m256i((v >> 4) & nibble)));
}
inline void widen(Words& counts) {
  counts = Words(_mm256_sad_epu8(__m256i(counts), _mm256_setzero_si256()));
}

#else

// Counts pairs of bits, then nibbles (Warren, Hacker's Delight, 5-1).
constexpr std::size_t max_added = 31;
inline void add_bits(const Words& v, Words& counts) {
  const Words pairs = v - ((v >> 1) & 0x5555555555555555U);
  const Words nibbles = (pairs & 0x3333333333333333U) + ((pairs >> 2) & 0x3333333333333333U);
  counts += (nibbles + (nibbles >> 4)) & 0x0f0f0f0f0f0f0f0fU;
}
inline void widen(Words& counts) {
  constexpr std::uint64_t even = 0x00ff00ff00ff00ffU;
  counts = (((counts & even) + ((counts >> 8) & even)) * 0x0001000100010001U) >> 48;
}

#endif

// Counts `group` pivots at once, which share the loads of the mask.
template <std::size_t group>
inline void count_group(const std::uint16_t* window, const std::uint32_t* origins,
                        const MaskChunk* chunks, const std::uint32_t* offsets,
                        std::size_t chunk_count, std::uint32_t* counts) {
  constexpr std::size_t parts = sizeof(MaskChunk) / sizeof(Words);
  Words totals[group] = {};
  for (std::size_t c = 0; c < chunk_count;) {
    const std::size_t left = chunk_count - c;
    const std::size_t end = c + (left < max_added / parts ? left : max_added / parts);
    Words sums[group] = {};
    for (; c < end; ++c)
      for (std::size_t at = 0; at < MaskChunk::columns; at += MaskChunk::columns / parts) {
        Words mask, bits;
        __builtin_memcpy(&mask, chunks[c].bits + at, sizeof(Words));
#pragma GCC unroll 8
        for (std::size_t g = 0; g < group; ++g) {
          __builtin_memcpy(&bits, window + origins[g] + offsets[c] + at, sizeof(Words));
          add_bits(bits & mask, sums[g]);
        }
      }
    for (std::size_t g = 0; g < group; ++g) {
      widen(sums[g]);
      totals[g] += sums[g];
    }
  }
  for (std::size_t g = 0; g < group; ++g) {
    std::uint64_t sum = 0;
    for (int w = 0; w < GRASPMAP_REGISTER / 8; ++w) sum += totals[g][w];
    counts[g] = static_cast<std::uint32_t>(sum);
  }
}

void count(const std::uint16_t* window, const std::uint32_t* origins, std::size_t origin_count,
           const MaskChunk* chunks, const std::uint32_t* offsets, std::size_t chunk_count,
           std::uint32_t* counts) {
  constexpr std::size_t group = GRASPMAP_REGISTER / 8;
  std::size_t n = 0;
  for (; n + group <= origin_count; n += group)
    count_group<group>(window, origins + n, chunks, offsets, chunk_count, counts + n);
  for (; n + 2 <= origin_count; n += 2)
    count_group<2>(window, origins + n, chunks, offsets, chunk_count, counts + n);
  for (; n < origin_count; ++n)
    count_group<1>(window, origins + n, chunks, offsets, chunk_count, counts + n);
}

void lower(std::uint16_t* planes, std::size_t plane_count, std::size_t columns, unsigned distance) {
  for (std::size_t p = 0; p + 1 < plane_count; ++p) {
    std::uint16_t* const here = planes + p * columns;
    const std::uint16_t* const above = here + columns;
    for (std::size_t n = 0; n < columns; ++n)
      here[n] = static_cast<std::uint16_t>((here[n] >> distance) | (above[n] << (16 - distance)));
  }
  std::uint16_t* const top = planes + (plane_count - 1) * columns;
  for (std::size_t n = 0; n < columns; ++n) top[n] = static_cast<std::uint16_t>(top[n] >> distance);
}

void slide(std::uint16_t* sums, const std::uint16_t* entering, const std::uint16_t* leaving,
           std::size_t count) {
  for (std::size_t n = 0; n < count; ++n)
    sums[n] = static_cast<std::uint16_t>(sums[n] + entering[n] - leaving[n]);
}

// Sums of pairs of neighbors.
inline Numbers pairs_of(const Numbers& sums) { return (sums & 0xffff) + (sums >> 16); }

void add_runs(const std::uint16_t* sums, const std::uint32_t* starts, std::size_t start_count,
              std::size_t length, std::uint32_t* totals) {
  constexpr std::size_t step = sizeof(Numbers) / sizeof(std::uint16_t);
  std::uint16_t kept[step] = {};  // values of the last register
  for (std::size_t y = 0; y < length % step; ++y) kept[y] = 0xffff;
  Numbers last, loaded;
  __builtin_memcpy(&last, kept, sizeof(Numbers));
  for (std::size_t n = 0; n < start_count; ++n) {
    const std::uint16_t* run = sums + starts[n];
    Numbers total = {};
    for (std::size_t k = 0; k < length / step; ++k, run += step) {
      __builtin_memcpy(&loaded, run, sizeof(Numbers));
      total += pairs_of(loaded);
    }
    __builtin_memcpy(&loaded, run, sizeof(Numbers));
    total += pairs_of(loaded & last);
    std::uint32_t sum = 0;
    for (int k = 0; k < GRASPMAP_REGISTER / 4; ++k) sum += total[k];
    totals[n] = sum;
  }
}

constexpr std::size_t width = GRASPMAP_REGISTER / sizeof(double);
using Lanes [[gnu::vector_size(width * sizeof(double))]] = double;
using Marks [[gnu::vector_size(width * sizeof(double))]] = long;

inline Lanes floor_of(const Lanes& values) {
#if GRASPMAP_REGISTER == 64
  return Lanes(_mm512_floor_pd(__m512d(values)));
#elif GRASPMAP_REGISTER == 32
  return Lanes(_mm256_floor_pd(__m256d(values)));
#else
  Lanes floors;
#pragma GCC unroll 8
  for (std::size_t n = 0; n < width; ++n) {
    const double cut = static_cast<int>(values[n]);
    floors[n] = cut > values[n] ? cut - 1.0 : cut;
  }
  return floors;
#endif
}

std::size_t find_cells(const double* const points[3], std::size_t count,
                       const TiltedLattice& lattice, const TiltedBox& box, int* cells) {
  std::size_t found = 0;
  for (std::size_t k = 0; k < count; k += width) {
    Lanes offset[3];
#pragma GCC unroll 3
    for (int a = 0; a < 3; ++a) {
      Lanes loaded;
      __builtin_memcpy(&loaded, points[a] + k, sizeof(Lanes));
      offset[a] = loaded - lattice.origin[a];
    }
    Lanes cell = {};  // integers
    Marks is_inside = {};
    is_inside -= 1;
#pragma GCC unroll 3
    for (int a = 0; a < 3; ++a) {
      const double* axis = lattice.axes[a];
      const Lanes cell_position =
          axis[0] * offset[0] + axis[1] * offset[1] + axis[2] * offset[2] + 0.5;
      const double begin = box.low[a];
      const double end = begin + box.size[a];
      is_inside &= (cell_position >= begin) & (cell_position < end);  // false for NaN
      cell += (floor_of(is_inside ? cell_position : Lanes{}) - begin) * box.stride[a];
    }
#if GRASPMAP_REGISTER == 64
    const __mmask8 inside = _mm512_test_epi64_mask(__m512i(is_inside), __m512i(is_inside));
    _mm256_mask_compressstoreu_epi32(cells + found, inside,
                                     _mm512_maskz_cvttpd_epi32(inside, __m512d(cell)));
    found += static_cast<std::size_t>(__builtin_popcount(inside));
#else
#pragma GCC unroll 8
    for (std::size_t n = 0; n < width; ++n) {
      cells[found] = static_cast<int>(cell[n]);
      found += is_inside[n] != 0 ? 1 : 0;
    }
#endif
  }
  return found;
}

std::uint32_t count_common(const std::uint64_t* a, const std::uint64_t* b, std::size_t words) {
  std::uint64_t count = 0;
  for (std::size_t n = 0; n < words; ++n)
    count += static_cast<std::uint64_t>(__builtin_popcountll(a[n] & b[n]));
  return static_cast<std::uint32_t>(count);
}

constexpr MatchingLoops all = {count, lower, slide, add_runs, find_cells, count_common};
