// OBJ, STL and GLB through assimp, in memory.
#pragma once

#include <string>

#include "libmap/cloud/geometry_file.h"
#include "libmap/core/triangle_mesh.h"

namespace libmap {

// `format` is "obj", "stl" or "glb". Equal corners become one vertex. Throws Error (without
// the file's name) with assimp's own reason.
TriangleMesh decode_by_assimp(const std::string& bytes, const std::string& format);

// `format` is "stl" or "glb". Throws Error.
std::string encode_by_assimp(const TriangleMesh& mesh, const std::string& format, bool ascii);

}  // namespace libmap
