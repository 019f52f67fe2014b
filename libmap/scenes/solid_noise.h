// Computes procedural 3-D noise, which has equal values on all machines for equal point and seed.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "libmap/core/random_stream.h"

namespace libmap {

// Gradient noise on the unit lattice, -1 to 1, 0 at lattice points, twice differentiable (Perlin
// 2002). Coordinates must be within +-2^30. The slope is below 3.5 (3.23 in 3 million samples).
double gradient_noise(const Eigen::Vector3d& point, std::uint64_t seed);

// Sum of octaves of gradient noise, each with twice the frequency and half the amplitude of the
// previous one, scaled to -1 to 1.
double fractal_noise(const Eigen::Vector3d& point, std::uint64_t seed, int octaves);

// Cellular noise (Worley 1996): one random feature point in each unit cell.
struct CellNoise {
  double distance = 0.0;   // distance to the nearest feature point
  std::uint64_t cell = 0;  // random bits of the cell of this point
};
// Searches the eight cells nearest to `point`. The result is exact if `distance` is below 0.5.
CellNoise cell_noise(const Eigen::Vector3d& point, std::uint64_t seed);

}  // namespace libmap
