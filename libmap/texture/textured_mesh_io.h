// Textured meshes from and to files.
//
//   .obj   MODEL.obj, MODEL.mtl and a picture per page, MODEL_0.png ...: doubles written, float32
//   read .glb   glTF 2.0 in one file, pictures within, unlit (KHR_materials_unlit): float32; y up
//   by its
//          standard, this project z: writing and reading turn it about x
//
// Vertex normals are kept; vertex colors and fields are not. float32 holds 24 bits (mesh_io.h says
// what that means far from the origin).
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

// Files that a model with one page has beside its own; none for .glb.
std::vector<std::filesystem::path> companions_of_model(const std::filesystem::path& model,
                                                       const TexturedMeshWriteOptions& options);

// One file of a model: writer(path) writes it, to a temporary path or its own.
struct ModelFile {
  std::filesystem::path path;
  std::function<void(const std::filesystem::path& temporary)> write;
};

// MODEL_0.png and so on, beside MODEL.obj.
std::filesystem::path texture_page_path(const std::filesystem::path& model, std::size_t page,
                                        ImageFormat format);

// The files of a model, its own last: put in place in this order, it never stands there without
// what it names. The model must outlive the writers. Throws Error: an extension that is neither
// .obj nor .glb, a model that does not fit together (TexturedMesh::check), one of no triangles, or
// whose .glb would be larger than 4 GB.
std::vector<ModelFile> textured_mesh_files(const std::filesystem::path& path,
                                           const TexturedMesh& model,
                                           const TexturedMeshWriteOptions& options = {});

// Throws Error unless the extension is .obj or .glb.
void require_textured_format(const std::filesystem::path& path);
bool is_textured_format(const std::filesystem::path& path);

// An .obj or .glb of any maker with its textures (PNG or JPEG, in the file or beside it); without
// pages where it has none. Corners equal in place and normal become one vertex. Throws Error naming
// the file: it cannot be read, is not of its format, holds no triangle, or names a picture that
// cannot be read.
TexturedMesh read_textured_mesh(const std::filesystem::path& path);

}  // namespace libmap
