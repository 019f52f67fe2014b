// Random numbers from streams that are identified by a seed and a key (e.g. a pixel), so that
// results do not depend on the order of calls. Creating a stream is cheap enough for one per pixel.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>

namespace libmap {

// Returns a 64-bit hash of two numbers (the finalizer of SplitMix64, Steele et al. 2014).
inline std::uint64_t mix_bits(std::uint64_t a, std::uint64_t b) {
  std::uint64_t bits = a * 0x9e3779b97f4a7c15U + b + 0x9e3779b97f4a7c15U;
  bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9U;
  bits = (bits ^ (bits >> 27)) * 0x94d049bb133111ebU;
  return bits ^ (bits >> 31);
}

// Returns mix_bits(a, b) scaled to [0, 1).
inline double unit_noise(std::uint64_t a, std::uint64_t b) {
  return static_cast<double>(mix_bits(a, b) >> 11) * 0x1p-53;
}

class RandomStream {
 public:
  RandomStream(std::uint64_t seed, std::uint64_t key) : key_(mix_bits(seed, key)) {}

  // Uniform in [0, 1).
  double uniform() { return unit_noise(++count_, key_); }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  // Uniform whole number in [0, count).
  std::size_t below(std::size_t count) {
    return static_cast<std::size_t>(uniform() * static_cast<double>(count));
  }
  // Normal deviate with mean 0 and standard deviation 1 (Box and Muller 1958).
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
