// Procedural 3-D noise. For equal point and seed, values are equal on all machines.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "libmap/core/random_stream.h"

namespace libmap {

// Returns gradient noise on the unit lattice (Perlin 2002): -1 to 1, 0 at lattice points, twice
// differentiable, slope below 3.5. Coordinates must be within +-2^30.
double gradient_noise(const Eigen::Vector3d& point, std::uint64_t seed);

// Returns the sum of `octaves` gradient noises, each with twice the frequency and half the
// amplitude of the previous one, scaled to -1 to 1.
double fractal_noise(const Eigen::Vector3d& point, std::uint64_t seed, int octaves);

// Cellular noise (Worley 1996): each unit cell contains one random feature point.
struct CellNoise {
  double distance = 0.0;   // distance to the nearest feature point
  std::uint64_t cell = 0;  // random bits of the cell that contains this feature point
};
// Searches only the eight cells nearest to `point`; exact if the resulting distance is below 0.5.
CellNoise cell_noise(const Eigen::Vector3d& point, std::uint64_t seed);

}  // namespace libmap
