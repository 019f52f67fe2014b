// glTF 2.0 in one binary file, pictures within. Inner part of libmap/mesh.
#pragma once

#include <string>

#include "libmap/core/textured_mesh.h"
#include "libmap/mesh/textured_mesh_io.h"

namespace libmap {

// Positions in float32, turned to y up; triangles of one page are one primitive. Throws Error if
// the file would be larger than 4 GB.
std::string encode_textured_glb(const TexturedMesh& model, const TexturedMeshWriteOptions& options);

}  // namespace libmap
