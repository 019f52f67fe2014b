// Noise that fills space: the same value at the same point and seed on every machine.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "libmap/core/random_stream.h"

namespace libmap {

// Gradient noise on the unit lattice, -1 to 1, zero at lattice points, twice differentiable
// (Perlin 2002). Coordinates must stay within +-2^30. Its slope stays below 3.5 (3.23 in 3 million
// draws).
double gradient_noise(const Eigen::Vector3d& point, std::uint64_t seed);

// Octaves of gradient noise, each of twice the frequency and half the height of the one before,
// scaled to -1 to 1.
double fractal_noise(const Eigen::Vector3d& point, std::uint64_t seed, int octaves);

// Cellular noise (Worley 1996): one random feature point in each unit cell.
struct CellNoise {
  double distance = 0.0;   // to the nearest feature point
  std::uint64_t cell = 0;  // random bits of that point's cell
};
// Of the eight cells nearest to `point`: exact where `distance` is below 0.5.
CellNoise cell_noise(const Eigen::Vector3d& point, std::uint64_t seed);

}  // namespace libmap
