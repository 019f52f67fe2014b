// Bodies of the functions of neighbor_loops.h, compiled once per instruction set by
// neighbor_loops.cc.

using Register [[gnu::vector_size(GRASPMAP_REGISTER)]] = double;

using Lanes [[gnu::vector_size(NeighborLoops::lanes * sizeof(double))]] = double;

template <typename Vector>
inline void load_coordinates(const NeighborLoops::Coordinates& coordinates, std::size_t at, Vector& x, Vector& y,
                        Vector& z) {
  __builtin_memcpy(&x, coordinates.x + at, sizeof(Vector));
  __builtin_memcpy(&y, coordinates.y + at, sizeof(Vector));
  __builtin_memcpy(&z, coordinates.z + at, sizeof(Vector));
}

std::size_t select(const NeighborLoops::Coordinates& candidates, std::size_t count, const double* center,
                   double radius, const NeighborLoops::Coordinates& neighbors) {
  constexpr std::size_t width = GRASPMAP_REGISTER / sizeof(double);
  const double inverse = 1 / radius;
  const double limit = radius * radius;
  std::size_t selected = 0;
  for (std::size_t k = 0; k < count; k += width) {
    Register x, y, z;
    load_coordinates(candidates, k, x, y, z);
    x -= center[0];
    y -= center[1];
    z -= center[2];
    const auto within = x * x + y * y + z * z <= limit;
    x *= inverse;
    y *= inverse;
    z *= inverse;
#if GRASPMAP_REGISTER == 64
    const __mmask8 mask = _mm512_test_epi64_mask(__m512i(within), __m512i(within));
    _mm512_storeu_pd(neighbors.x + selected, _mm512_maskz_compress_pd(mask, __m512d(x)));
    _mm512_storeu_pd(neighbors.y + selected, _mm512_maskz_compress_pd(mask, __m512d(y)));
    _mm512_storeu_pd(neighbors.z + selected, _mm512_maskz_compress_pd(mask, __m512d(z)));
    selected += static_cast<std::size_t>(__builtin_popcount(mask));
#else
#pragma GCC unroll 4
    for (std::size_t n = 0; n < width; ++n) {
      neighbors.x[selected] = x[n];
      neighbors.y[selected] = y[n];
      neighbors.z[selected] = z[n];
      selected += within[n] != 0 ? 1 : 0;
    }
#endif
  }
  for (std::size_t k = selected; k < selected + NeighborLoops::lanes; ++k)
    neighbors.x[k] = neighbors.y[k] = neighbors.z[k] = 0;
  return selected;
}

template <std::size_t count>
inline void join_lanes(const Lanes (&sums)[count], double* joined) {
  for (std::size_t i = 0; i < count; ++i) {
    const Lanes& s = sums[i];
    joined[i] = ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
  }
}

void sum_moments(const NeighborLoops::Coordinates& neighbors, std::size_t count, double* sums) {
  Lanes s[NeighborLoops::moments] = {};
  for (std::size_t k = 0; k < count; k += NeighborLoops::lanes) {
    Lanes x, y, z;
    load_coordinates(neighbors, k, x, y, z);
    s[0] += x;
    s[1] += y;
    s[2] += z;
    s[3] += x * x;
    s[4] += x * y;
    s[5] += x * z;
    s[6] += y * y;
    s[7] += y * z;
    s[8] += z * z;
  }
  join_lanes(s, sums);
}

void sum_quadric(const NeighborLoops::Coordinates& neighbors, std::size_t count, const double* frame,
                 double* sums) {
  Lanes s[NeighborLoops::quadric_sums] = {};
  for (std::size_t k = 0; k < count; k += NeighborLoops::lanes) {
    Lanes x, y, z;
    load_coordinates(neighbors, k, x, y, z);
    const Lanes u = x * frame[0] + y * frame[1] + z * frame[2];
    const Lanes v = x * frame[3] + y * frame[4] + z * frame[5];
    const Lanes w = x * frame[6] + y * frame[7] + z * frame[8];
    const Lanes uu = u * u, uv = u * v, vv = v * v;
    s[0] += u;
    s[1] += v;
    s[2] += uu;
    s[3] += uv;
    s[4] += vv;
    s[5] += uu * u;
    s[6] += uu * v;
    s[7] += u * vv;
    s[8] += vv * v;
    s[9] += uu * uu;
    s[10] += uu * uv;
    s[11] += uu * vv;
    s[12] += uv * vv;
    s[13] += vv * vv;
    s[14] += w;
    s[15] += u * w;
    s[16] += v * w;
    s[17] += uu * w;
    s[18] += uv * w;
    s[19] += vv * w;
  }
  join_lanes(s, sums);
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
#if GRASPMAP_REGISTER == 64
    const __m512 loaded = _mm512_loadu_ps(squares);
    const __m512i numbers = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    const __mmask16 near = _mm512_cmp_ps_mask(loaded, _mm512_set1_ps(limit), _CMP_LT_OQ);
    std::uint32_t bits[at_once], kept[at_once];
    _mm512_storeu_si512(bits, _mm512_maskz_compress_epi32(near, _mm512_castps_si512(loaded)));
    _mm512_storeu_si512(kept, _mm512_maskz_compress_epi32(near, numbers));
    for (std::size_t n = 0; n < at_once; ++n)
      keys[ranked + n] = std::uint64_t{bits[n]} << 32 | (first + kept[n]);
    ranked += static_cast<std::size_t>(__builtin_popcount(near));
#else
    for (std::size_t n = 0; n < at_once; ++n) {
      std::uint32_t bits = 0;
      __builtin_memcpy(&bits, &squares[n], sizeof(bits));
      keys[ranked] = std::uint64_t{bits} << 32 | (first + n);
      ranked += squares[n] < limit ? 1 : 0;
    }
#endif
  }
  return ranked;
}

constexpr NeighborLoops all = {select, sum_moments, sum_quadric, rank};
