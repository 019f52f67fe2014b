// Decodes Wavefront OBJ and its material libraries (MTL).
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "libmap/core/triangle_mesh.h"
#include "libmap/io/assimp_codec.h"

namespace libmap {

// Returns the mesh with positions in double precision. Polygons are split into triangle fans. The
// corners of one `v` line are one vertex with the mean `vn` of the corners as normal; `v` lines
// with equal position, color and normal are merged. Vertices are in the order of first use; unused
// ones are dropped. Normals and colors are kept only if all corners have them. Throws Error naming
// the line for an invalid number, an index out of range, or a face with fewer than three corners.
TriangleMesh decode_obj(std::string_view text);

// Returns the mesh as decode_obj does, with its texture coordinates and the images of its
// materials (map_Kd). `read_library` returns the text of a material library (mtllib), or an empty
// text if there is none; its materials have no images then. A triangle without three texture
// coordinates has no page. Throws Error as decode_obj does.
DecodedModel decode_obj_model(
    std::string_view text, const std::function<std::string(const std::string& name)>& read_library);

}  // namespace libmap
