// Random numbers that depend on what they are for and not on who draws them first: a stream of its
// own for each seed and key, cheap enough for one a pixel.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include "libmap/simulate/solid_noise.h"

namespace libmap {

class RandomStream {
 public:
  RandomStream(std::uint64_t seed, std::uint64_t key) : key_(mix_bits(seed, key)) {}

  // In [0, 1).
  double uniform() { return unit_noise(++count_, key_); }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  // Mean 0, standard deviation 1 (Box and Muller 1958).
  double normal() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
    const double angle = 2.0 * std::numbers::pi * uniform();
    spare_ = radius * std::sin(angle);
    has_spare_ = true;
    return radius * std::cos(angle);
  }

 private:
  std::uint64_t key_;
  std::uint64_t count_ = 0;
  double spare_ = 0.0;
  bool has_spare_ = false;
};

}  // namespace libmap
