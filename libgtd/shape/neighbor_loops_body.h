// The functions of neighbor_loops.h but for their instruction set; for neighbor_loops.cc alone,
// which includes this once for each.

using Lanes [[gnu::vector_size(NeighborLoops::lanes * sizeof(double))]] = double;

// Without asking for alignment. Not returned: how vectors are depends on the instruction set.
inline void load_lanes(const double* values, Lanes& loaded) {
  __builtin_memcpy(&loaded, values, sizeof(Lanes));
}

inline void load_places(const NeighborLoops::Places& places, std::size_t at, Lanes& x, Lanes& y,
                        Lanes& z) {
  load_lanes(places.x + at, x);
  load_lanes(places.y + at, y);
  load_lanes(places.z + at, z);
}

template <std::size_t count>
inline void join_lanes(const Lanes (&sums)[count], double* joined) {
  for (std::size_t i = 0; i < count; ++i) {
    const Lanes& s = sums[i];
    joined[i] = ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
  }
}

void sum_moments(const NeighborLoops::Places& neighbors, std::size_t count, double* sums) {
  Lanes s[NeighborLoops::moments] = {};
  for (std::size_t k = 0; k < count; k += NeighborLoops::lanes) {
    Lanes x, y, z;
    load_places(neighbors, k, x, y, z);
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

void sum_quadric(const NeighborLoops::Places& neighbors, std::size_t count, const double* frame,
                 double* sums) {
  Lanes s[NeighborLoops::quadric_sums] = {};
  for (std::size_t k = 0; k < count; k += NeighborLoops::lanes) {
    Lanes x, y, z;
    load_places(neighbors, k, x, y, z);
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
