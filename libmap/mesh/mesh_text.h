// Mesh formats that are plain text, written with the shortest numbers that read back the same.
#pragma once

#include <ostream>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

// Wavefront OBJ: v (with r g b from 0 to 1 where there are colours), vn, f.
void write_obj(const TriangleMesh& mesh, std::ostream& out);

// Object File Format: geometry alone.
void write_off(const TriangleMesh& mesh, std::ostream& out);

}  // namespace libmap
