// What the writers of textured meshes share. Inner part of libmap/mesh.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "libmap/core/textured_mesh.h"
#include "libmap/texture/textured_mesh_io.h"

namespace libmap {

struct TextureCorner {
  std::uint32_t vertex = 0;
  Eigen::Vector2f coordinate = Eigen::Vector2f::Zero();
};

// Corners of one vertex and texture coordinate as one, in the order of their first use.
struct UnitedCorners {
  std::vector<TextureCorner> corners;
  std::vector<std::array<std::uint32_t, 3>> of_triangle;
};
UnitedCorners unite_corners(const TexturedMesh& model);

// A page as the bytes of a picture.
std::string encode_page(const ColorImage& page, const TexturedMeshWriteOptions& options);

}  // namespace libmap
