// Reads and writes STL and GLB by the library assimp.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "libmap/core/triangle_mesh.h"
#include "libmap/io/geometry_file.h"

namespace libmap {

// Decodes the content of a file; `format` is "stl" or "glb". Triangle corners with equal position,
// normal and color become one vertex. Throws Error (without the file's name) with assimp's reason.
TriangleMesh decode_by_assimp(const std::string& bytes, const std::string& format);

// Texture image of a model, embedded in the model's file or in a file of its own.
struct TextureImage {
  std::string bytes;  // file content of an embedded image; else empty
  std::string path;   // as in the model's file; empty for an embedded image
};

// A mesh whose texture pages are not decoded yet: page_of_triangle contains indices of `images`.
struct DecodedModel {
  TexturedMesh model;
  std::vector<TextureImage> images;
};

// Reads the .glb at `path`. Throws as decode_by_assimp does.
DecodedModel decode_glb_model(const std::filesystem::path& path);

// Returns the content of a file with the mesh; `format` is "stl" or "glb", `ascii` selects text
// STL. Throws Error if the mesh has no triangles; Error (failed) if assimp fails.
std::string encode_by_assimp(const TriangleMesh& mesh, const std::string& format, bool ascii);

// Part of a model with one texture page.
struct ModelPart {
  TriangleMesh mesh;
  std::vector<Eigen::Vector2f> texture_coordinates;  // one per vertex; top left is 0, 0; or empty
  std::int32_t page = no_page;                       // index of the texture image
};

// Texture image as the bytes of a file; `format` is "png" or "jpg".
struct EncodedImage {
  std::string bytes;
  std::string format;
};

// Writes the parts to a .glb with embedded images and unlit materials (KHR_materials_unlit). Throws
// Error (failed) if the file cannot be written.
void write_model_by_assimp(const std::filesystem::path& path, std::vector<ModelPart> parts,
                           std::vector<EncodedImage> images);

}  // namespace libmap
