#include "libmap/scenes/solid_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace libmap {

namespace {

struct Cell {
  std::int64_t x = 0;
  std::int64_t y = 0;
  std::int64_t z = 0;
};

Cell cell_of(const Eigen::Vector3d& point) {
  return {static_cast<std::int64_t>(std::floor(point.x())),
          static_cast<std::int64_t>(std::floor(point.y())),
          static_cast<std::int64_t>(std::floor(point.z()))};
}

// Random bits of a lattice point and a seed.
std::uint64_t lattice_bits(std::int64_t x, std::int64_t y, std::int64_t z, std::uint64_t seed) {
  std::uint64_t bits = static_cast<std::uint64_t>(x) * 0x9e3779b97f4a7c15U;
  bits ^= static_cast<std::uint64_t>(y) * 0xc2b2ae3d27d4eb4fU;
  bits ^= static_cast<std::uint64_t>(z) * 0x165667b19e3779f9U;
  bits = (bits ^ seed) * 0xff51afd7ed558ccdU;
  bits ^= bits >> 32;
  bits *= 0xc4ceb9fe1a85ec53U;
  return bits ^ (bits >> 29);
}

// Directions to the edge centers of a cube.
constexpr std::array<std::array<double, 3>, 12> directions = {{{1, 1, 0},
                                                               {-1, 1, 0},
                                                               {1, -1, 0},
                                                               {-1, -1, 0},
                                                               {1, 0, 1},
                                                               {-1, 0, 1},
                                                               {1, 0, -1},
                                                               {-1, 0, -1},
                                                               {0, 1, 1},
                                                               {0, -1, 1},
                                                               {0, 1, -1},
                                                               {0, -1, -1}}};

// Scalar product of a random direction and the offset. A table avoids mispredicted branches.
double directional(std::uint64_t bits, double x, double y, double z) {
  const auto& direction = directions[(bits >> 32) % 12];
  return direction[0] * x + direction[1] * y + direction[2] * z;
}

double fade(double t) { return t * t * t * (t * (t * 6.0 - 15.0) + 10.0); }

double mix(double a, double b, double t) { return a + t * (b - a); }

}  // namespace

double gradient_noise(const Eigen::Vector3d& point, std::uint64_t seed) {
  const Cell cell = cell_of(point);
  const double x = point.x() - static_cast<double>(cell.x);
  const double y = point.y() - static_cast<double>(cell.y);
  const double z = point.z() - static_cast<double>(cell.z);
  const auto corner = [&](int i, int j, int k) {
    return directional(lattice_bits(cell.x + i, cell.y + j, cell.z + k, seed), x - i, y - j, z - k);
  };
  const double u = fade(x);
  const double v = fade(y);
  const double low =
      mix(mix(corner(0, 0, 0), corner(1, 0, 0), u), mix(corner(0, 1, 0), corner(1, 1, 0), u), v);
  const double high =
      mix(mix(corner(0, 0, 1), corner(1, 0, 1), u), mix(corner(0, 1, 1), corner(1, 1, 1), u), v);
  return mix(low, high, fade(z));
}

double fractal_noise(const Eigen::Vector3d& point, std::uint64_t seed, int octaves) {
  double sum = 0.0;
  double height = 1.0;
  double total = 0.0;
  Eigen::Vector3d at = point;
  for (int octave = 0; octave < octaves; ++octave) {
    sum += height * gradient_noise(at, seed + static_cast<std::uint64_t>(octave));
    total += height;
    height *= 0.5;
    at *= 2.0;
  }
  return total > 0.0 ? sum / total : 0.0;
}

CellNoise cell_noise(const Eigen::Vector3d& point, std::uint64_t seed) {
  const Cell cell = cell_of(point - Eigen::Vector3d::Constant(0.5));
  CellNoise best;
  double best_squared = std::numeric_limits<double>::infinity();
  for (int n = 0; n < 8; ++n) {
    const std::int64_t i = cell.x + (n & 1);
    const std::int64_t j = cell.y + ((n >> 1) & 1);
    const std::int64_t k = cell.z + (n >> 2);
    const std::uint64_t bits = lattice_bits(i, j, k, seed);
    constexpr double scale = 0x1p-21;
    const Eigen::Vector3d feature(
        static_cast<double>(i) + static_cast<double>(bits & 0x1fffffU) * scale,
        static_cast<double>(j) + static_cast<double>((bits >> 21) & 0x1fffffU) * scale,
        static_cast<double>(k) + static_cast<double>((bits >> 42) & 0x1fffffU) * scale);
    const double squared = (point - feature).squaredNorm();
    if (squared < best_squared) {
      best_squared = squared;
      best.cell = bits * 0x9fb21c651e98df25U;
    }
  }
  best.distance = std::sqrt(best_squared);
  return best;
}

}  // namespace libmap
