// In-memory encoder of VTP, ParaView's polygonal data, by VTK. Points of a cloud are vertex cells,
// so that ParaView shows them. Normals are point normals, colors a uint8 x 3 array "rgb", scalar
// fields arrays of the field's type. The viewpoint is a field array "viewpoint" (tx ty tz qw qx qy
// qz).
#pragma once

#include <ostream>

#include "libmap/io/columns.h"

namespace libmap {

// Without triangles, every point is a vertex cell. VTK cannot parse NaN and infinity: arrays that
// contain such values are written as binary. Throws Error (failed) if VTK fails.
void encode_vtp(const GeometryContent& content, FileEncoding encoding, std::ostream& out);

}  // namespace libmap
