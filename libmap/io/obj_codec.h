// Decodes Wavefront OBJ and its material libraries (MTL).
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "libmap/core/triangle_mesh.h"
#include "libmap/io/assimp_codec.h"

namespace libmap {

// Returns the mesh with positions in double precision. Polygons are split into triangle fans. Each
// `v` line (position) that a face uses becomes a vertex, in the order of first use; its normal is
// the mean `vn` of its corners. Vertices with equal position, color and normal are merged. Normals
// are kept if all corners have them, colors if all `v` lines have them. Throws Error naming the
// line for an invalid number, an index out of range, or a face with fewer than three corners.
TriangleMesh decode_obj(std::string_view text);

// Returns the mesh as decode_obj does, with its texture coordinates and the images of its materials
// (map_Kd). read_library(name) must return the text of the material library `name` (mtllib), or an
// empty text if it is missing; then its materials have no images. A triangle without three texture
// coordinates has the page no_page. Throws Error as decode_obj does.
DecodedModel decode_obj_model(
    std::string_view text, const std::function<std::string(const std::string& name)>& read_library);

}  // namespace libmap
