// The functions of tilted_cells.h but for their instruction set; for tilted_cells.cc alone.

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
    Lanes cell = {};  // whole numbers
    Marks is_inside = {};
    is_inside -= 1;
#pragma GCC unroll 3
    for (int a = 0; a < 3; ++a) {
      const double* axis = lattice.axes[a];
      const Lanes place = axis[0] * offset[0] + axis[1] * offset[1] + axis[2] * offset[2] + 0.5;
      const double begin = box.low[a];
      const double end = begin + box.size[a];
      is_inside &= (place >= begin) & (place < end);  // false for what is not a number
      cell += (floor_of(is_inside ? place : Lanes{}) - begin) * box.stride[a];
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

constexpr TiltedLoops all = {find_cells, count_common};
