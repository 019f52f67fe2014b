// Mesh formats that are plain text, in doubles: written with the shortest numbers that read back
// the same. (assimp writes OBJ in float32 and renumbers its vertices, does not write OFF, and ends
// the program on some broken OFF files.)
#pragma once

#include <ostream>
#include <string_view>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

// Wavefront OBJ: v (with r g b from 0 to 1 where there are colors), vn, f.
void write_obj(const TriangleMesh& mesh, std::ostream& out);

// Object File Format: geometry alone.
void write_off(const TriangleMesh& mesh, std::ostream& out);

// Reads OFF, and COFF and NOFF without their colors and normals. Polygons are cut into fans.
// Throws Error (without the file's name): more rows promised than there are lines, a vertex that is
// not finite, a face with less than three corners or with a corner that is no vertex.
TriangleMesh read_off(std::string_view text);

}  // namespace libmap
