// OBJ, STL and GLB through assimp.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "libmap/core/triangle_mesh.h"
#include "libmap/io/geometry_file.h"

namespace libmap {

// `format` is "obj", "stl" or "glb". Equal corners become one vertex. Throws Error (without
// the file's name) with assimp's own reason.
TriangleMesh decode_by_assimp(const std::string& bytes, const std::string& format);

// A picture of a file: its bytes where they lie within, else its path as the file names it.
struct TexturePicture {
  std::string bytes;
  std::string path;
};

// A mesh whose pages are still files: page_of_triangle counts `pictures`.
struct DecodedModel {
  TexturedMesh model;
  std::vector<TexturePicture> pictures;
};

// The .obj (with its materials) or .glb at `path`. Throws as decode_by_assimp does.
DecodedModel decode_model_by_assimp(const std::filesystem::path& path, const std::string& format);

// `format` is "stl" or "glb". Throws Error.
std::string encode_by_assimp(const TriangleMesh& mesh, const std::string& format, bool ascii);

// A piece of a model that has one page: a texture coordinate a vertex, as in TexturedMesh, none
// without a page.
struct ModelPart {
  TriangleMesh mesh;
  std::vector<Eigen::Vector2f> texture_coordinates;
  std::int32_t page = no_page;
};

// A picture as the bytes of a file; `format` is "png" or "jpg".
struct EncodedPicture {
  std::string bytes;
  std::string format;
};

// .glb with the pictures within, unlit (KHR_materials_unlit). Throws Error.
void write_model_by_assimp(const std::filesystem::path& path, std::vector<ModelPart> parts,
                           std::vector<EncodedPicture> pictures);

}  // namespace libmap
