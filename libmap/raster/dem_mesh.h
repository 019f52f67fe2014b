// A digital elevation model as a surface.
#pragma once

#include <filesystem>

#include "libmap/core/triangle_mesh.h"

namespace libmap {

// Vertices are the centers of pixels that have a height, row by row; four neighbors make two
// triangles, split along the diagonal with the smaller step of height, three make one. Normals
// point up. Throws Error as DemReader, and if there is not enough memory.
TriangleMesh read_dem_mesh(const std::filesystem::path& path);

}  // namespace libmap
