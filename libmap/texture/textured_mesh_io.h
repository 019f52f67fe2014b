// Reads and writes textured meshes.
//
// .obj: MODEL.obj, MODEL.mtl and one image per page, MODEL_0.png ...; coordinates are doubles.
// .glb: glTF 2.0 in one file with its images, unlit (KHR_materials_unlit), float32. Up is y in glTF
// and z in this project, so writing and reading rotate the mesh about x.
//
// Vertex normals are kept; vertex colors and fields are not. float32 has 24 bits of precision; for
// meshes far from the origin see mesh_io.h.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <vector>

#include "libmap/camera/image_codec.h"
#include "libmap/core/triangle_mesh.h"

namespace libmap {

struct TexturedMeshWriteOptions {
  ImageFormat image_format = ImageFormat::png;
  int jpeg_quality = 92;  // 1 to 100
};

// Returns the additional files of a model with one page (image and material); empty for .glb.
std::vector<std::filesystem::path> additional_model_files(const std::filesystem::path& model,
                                                          const TexturedMeshWriteOptions& options);

// One file of a model. `write` writes it to the given path, which may be temporary.
struct ModelFile {
  std::filesystem::path path;
  std::function<void(const std::filesystem::path& temporary)> write;
};

// Returns the path of a page's image beside the model, e.g. MODEL_0.png for MODEL.obj.
std::filesystem::path texture_page_path(const std::filesystem::path& model, std::size_t page,
                                        ImageFormat format);

// Returns the files of a model in the order in which they must be committed: the model file is
// last, after all files that it references. `model` must outlive the writers. Throws Error if the
// extension is neither .obj nor .glb, the model is inconsistent (TexturedMesh::check) or has no
// triangles, or float32 cannot represent coordinates. Writing throws Error for a .glb above 4 GB.
std::vector<ModelFile> textured_mesh_files(const std::filesystem::path& path,
                                           const TexturedMesh& model,
                                           const TexturedMeshWriteOptions& options = {});

// Throws Error if is_textured_format(path) is false.
void require_textured_format(const std::filesystem::path& path);
// Returns true if the extension is .obj or .glb.
bool is_textured_format(const std::filesystem::path& path);

// Reads an .obj or .glb of any program, and its textures (PNG or JPEG, embedded or in separate
// files). The result has no pages if the file has no textures. Corners of equal position and normal
// are merged into one vertex. Throws Error naming the file if it cannot be read or parsed, contains
// no triangle, or references an unreadable image.
TexturedMesh read_textured_mesh(const std::filesystem::path& path);

}  // namespace libmap
