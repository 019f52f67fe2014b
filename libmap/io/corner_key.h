// Merges face corners that are equal bit for bit into one vertex.
#pragma once

#include <Eigen/Core>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <unordered_map>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

// Key of a corner: the bits of its position (float64), normal (float32) and color.
using Corner = std::array<std::uint32_t, 6 + 3 + 1>;

struct CornerHash {
  std::size_t operator()(const Corner& corner) const {
    // FNV-1a on 32-bit words.
    std::uint64_t hash = 14695981039346656037ULL;
    for (const std::uint32_t word : corner) hash = (hash ^ word) * 1099511628211ULL;
    return static_cast<std::size_t>(hash ^ (hash >> 32));
  }
};

inline Corner corner_of(const Eigen::Vector3d& position, const Eigen::Vector3f& normal,
                        const Color& color) {
  Corner corner{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    // Adding 0 makes -0 equal to 0.
    const auto word = std::bit_cast<std::uint64_t>(position[static_cast<int>(axis)] + 0.0);
    corner[2 * axis] = static_cast<std::uint32_t>(word);
    corner[2 * axis + 1] = static_cast<std::uint32_t>(word >> 32);
    corner[6 + axis] = std::bit_cast<std::uint32_t>(normal[static_cast<int>(axis)] + 0.0F);
    corner[9] = corner[9] << 8 | color[axis];
  }
  return corner;
}

class CornerWelder {
 public:
  // Adds a corner to the mesh, with its normal and its color if they are not nullptr. Returns the
  // index of the vertex of an equal earlier corner, or of a new vertex.
  std::uint32_t vertex(const Eigen::Vector3d& position, const Eigen::Vector3f* normal,
                       const Color* color, TriangleMesh& mesh) {
    const Corner corner =
        corner_of(position, normal != nullptr ? *normal : Eigen::Vector3f(Eigen::Vector3f::Zero()),
                  color != nullptr ? *color : Color{});
    const auto [found, is_new] =
        known_.try_emplace(corner, static_cast<std::uint32_t>(mesh.vertices.size()));
    if (is_new) {
      mesh.vertices.push_back(position);
      if (normal != nullptr) mesh.vertex_normals.push_back(*normal);
      if (color != nullptr) mesh.vertex_colors.push_back(*color);
    }
    return found->second;
  }

 private:
  std::unordered_map<Corner, std::uint32_t, CornerHash> known_;
};

}  // namespace libmap
