// Decoder of Wavefront OBJ without materials and textures.
#pragma once

#include <string_view>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

// Returns the mesh with positions in double precision. Polygons are split into triangle fans. The
// corners of one `v` line are one vertex with the mean `vn` of the corners as normal; `v` lines
// with equal position, color and normal are merged. Vertices are in the order of first use; unused
// ones are dropped. Normals and colors are kept only if all corners have them. Throws Error naming
// the line for an invalid number, an index out of range, or a face with less than three corners.
TriangleMesh decode_obj(std::string_view text);

}  // namespace libmap
