// Writes VTP, ParaView's polygonal data, through VTK, in memory. Points of a cloud are vertex
// cells, so that ParaView shows them. Normals are the point normals, colors a uint8 x 3 array
// "rgb", scalar fields arrays of their own type. The viewpoint is a field array "viewpoint" (tx ty
// tz qw qx qy qz).
#pragma once

#include <ostream>

#include "libmap/io/columns.h"

namespace libmap {

// Without triangles every point is a vertex cell. VTK cannot read NaN and infinity as text: data
// that hold some are written as binary.
void encode_vtp(const GeometryContent& content, FileEncoding encoding, std::ostream& out);

}  // namespace libmap
