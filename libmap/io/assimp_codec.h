// Reads and writes STL and GLB by assimp.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "libmap/core/triangle_mesh.h"
#include "libmap/io/geometry_file.h"

namespace libmap {

// Decodes a mesh; `format` is "stl" or "glb". Equal corners become one vertex. Throws Error
// (without the file's name) with assimp's reason.
TriangleMesh decode_by_assimp(const std::string& bytes, const std::string& format);

// Texture image of a model: bytes of an embedded image, else the path as stored in the file.
struct TextureImage {
  std::string bytes;
  std::string path;
};

// A mesh with undecoded texture pages: page_of_triangle contains indices of `images`.
struct DecodedModel {
  TexturedMesh model;
  std::vector<TextureImage> images;
};

// Reads the .glb at `path`. Throws as decode_by_assimp does.
DecodedModel decode_glb_model(const std::filesystem::path& path);

// Encodes a mesh; `format` is "stl" or "glb". Throws Error if the mesh has no triangles, or if
// assimp fails.
std::string encode_by_assimp(const TriangleMesh& mesh, const std::string& format, bool ascii);

// Part of a model with one texture page. It has one texture coordinate per vertex, as in
// TexturedMesh, or none without a page.
struct ModelPart {
  TriangleMesh mesh;
  std::vector<Eigen::Vector2f> texture_coordinates;
  std::int32_t page = no_page;
};

// Texture image as the bytes of a file; `format` is "png" or "jpg".
struct EncodedImage {
  std::string bytes;
  std::string format;
};

// Writes a .glb with embedded images and unlit materials (KHR_materials_unlit). Throws Error
// (failed).
void write_model_by_assimp(const std::filesystem::path& path, std::vector<ModelPart> parts,
                           std::vector<EncodedImage> images);

}  // namespace libmap
