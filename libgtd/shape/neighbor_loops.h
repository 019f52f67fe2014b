// Inner loops of the curvature and normal fits over the neighbors of a point, compiled for several
// instruction sets. Results are identical: sums run in eight lanes for any register width, and are
// joined in a fixed order. The interface uses plain pointers only: the linker could use an
// inline function that is compiled here for AVX in the whole program.
#pragma once

#include <cstddef>
#include <cstdint>

#include "libmap/core/instruction_set.h"

namespace libgtd {

struct NeighborLoops {
  static constexpr std::size_t lanes = 8;

  // Coordinates of points, one array per axis. Arrays of candidates and neighbors must have room
  // for `lanes` more values than points.
  struct Coordinates {
    double* x = nullptr;
    double* y = nullptr;
    double* z = nullptr;
  };

  // Writes the candidates within `radius` of `center` to `neighbors`, relative to `center` and in
  // units of the radius; zeros follow up to a full set of lanes. Returns the number of neighbors.
  // Candidates beyond `count` must be infinite.
  std::size_t (*select)(const Coordinates& candidates, std::size_t count, const double* center,
                        double radius, const Coordinates& neighbors);
  // Moments for the quadric fit: sums of x, y, z, xx, xy, xz, yy, yz, zz.
  void (*sum_moments)(const Coordinates& neighbors, std::size_t count, double* sums);
  // Sums for the quadric fit, with u, v, w along the columns of `frame` (column-major): u, v, uu,
  // uv, vv, uuu, uuv, uvv, vvv, uuuu, uuuv, uuvv, uvvv, vvvv, w, uw, vw, uuw, uvw, vvw.
  void (*sum_quadric)(const Coordinates& neighbors, std::size_t count, const double* frame,
                      double* sums);
  static constexpr std::size_t moments = 9;
  static constexpr std::size_t quadric_sums = 20;

  // Writes a sort key for each candidate with a squared distance to `center` below `limit`, in the
  // order of the candidates, and returns the number of keys. The high 32 bits are those of the
  // squared distance in single precision, which sort like the distances; the low 32 bits are the
  // index. Candidates beyond `count` must be infinite. All arrays need room for `rank_lanes` more.
  std::size_t (*rank)(const float* x, const float* y, const float* z, std::size_t count,
                      const float* center, float limit, std::uint64_t* keys);
  static constexpr std::size_t rank_lanes = 16;
};

// Returns the loops for an instruction set, which the processor must support.
const NeighborLoops& neighbor_loops_of(libmap::InstructionSet instructions);

}  // namespace libgtd
