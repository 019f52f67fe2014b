// The innermost loops over the neighbors of a point, each for several instruction sets, with the
// same bits from each: sums run in eight lanes, whatever the width of the registers, and are joined
// in one order. Plain pointers alone: sources that are compiled for more than the base instruction
// set must see no type whose inline functions other sources compile too.
#pragma once

#include <cstddef>
#include <cstdint>

#include "libmap/core/instruction_set.h"

namespace libgtd {

struct NeighborLoops {
  static constexpr std::size_t lanes = 8;

  // Coordinates of places, each axis one after the other. Candidates are read, and neighbors
  // written, up to a full set of lanes beyond their number.
  struct Places {
    double* x = nullptr;
    double* y = nullptr;
    double* z = nullptr;
  };

  // The candidates within `radius` of `center`, relative to it and in units of the radius; zeros
  // follow up to a full set of lanes. Returns their number. Candidates beyond `count` are infinite.
  std::size_t (*select)(const Places& candidates, std::size_t count, const double* center,
                        double radius, const Places& neighbors);
  // Of the quadric fit: sums of x, y, z, xx, xy, xz, yy, yz, zz.
  void (*sum_moments)(const Places& neighbors, std::size_t count, double* sums);
  // With u, v, w along the columns of `frame` (column by column): sums of u, v, uu, uv, vv, uuu,
  // uuv, uvv, vvv, uuuu, uuuv, uuvv, uvvv, vvvv, w, uw, vw, uuw, uvw, vvw.
  void (*sum_quadric)(const Places& neighbors, std::size_t count, const double* frame,
                      double* sums);
  static constexpr std::size_t moments = 9;
  static constexpr std::size_t quadric_sums = 20;

  // In single precision: a key for each candidate that is nearer to `center` than the square root
  // of `limit`, in the candidates' order: the bits of its squared distance above, which order as
  // the distances do, and its number below. Candidates beyond `count` are infinite; reads and
  // writes up to 16 beyond the last. Returns the number of keys.
  std::size_t (*rank)(const float* x, const float* y, const float* z, std::size_t count,
                      const float* center, float limit, std::uint64_t* keys);
  static constexpr std::size_t rank_lanes = 16;
};

// Of instructions that the processor has.
const NeighborLoops& neighbor_loops_of(libmap::InstructionSet instructions);

}  // namespace libgtd
