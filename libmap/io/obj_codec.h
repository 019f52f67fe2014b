// Wavefront OBJ without materials and textures.
#pragma once

#include <string_view>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

// Positions in double precision. Polygons are cut into fans. The corners of one `v` line are one
// vertex, whose normal is the mean of their `vn`; `v` lines with equal position, color and normal
// are one vertex too. Vertices are in the order of their first use; unused ones are left out.
// Normals and colors only if all corners have them. Throws Error naming the line: a number that is
// none, an index beyond the list that it refers to, a face with less than three corners.
TriangleMesh decode_obj(std::string_view text);

}  // namespace libmap
