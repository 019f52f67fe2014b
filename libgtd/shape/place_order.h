// Points in one place, to the bit: what their neighbors say of one holds for all of them.
#pragma once

#include <Eigen/Core>
#include <array>
#include <bit>
#include <cstdint>

namespace libgtd {

// A zero of the other sign is another place: sums of differences may tell them apart.
inline std::array<std::uint64_t, 3> place_bits(const Eigen::Vector3d& place) {
  return {std::bit_cast<std::uint64_t>(place.x()), std::bit_cast<std::uint64_t>(place.y()),
          std::bit_cast<std::uint64_t>(place.z())};
}

inline bool is_same_place(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return place_bits(a) == place_bits(b);
}

// Some order, in which points in one place follow each other.
inline bool is_place_before(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return place_bits(a) < place_bits(b);
}

}  // namespace libgtd
