// In-memory encoder of VTP, ParaView's polygonal data, by VTK. Normals are point normals, colors a
// uint8 x 3 array "rgb", scalar fields arrays of the field's type. The viewpoint
// (cloud_from_sensor) is a field array "viewpoint" (tx ty tz in m, qw qx qy qz).
#pragma once

#include <ostream>

#include "libmap/io/columns.h"

namespace libmap {

// Writes a file to `out`. Without triangles, every point is a vertex cell, so that ParaView shows
// it. VTK cannot parse NaN and infinity as text: content with such values is written as binary
// instead of ascii. Throws Error (failed) if VTK fails.
void encode_vtp(const GeometryContent& content, FileEncoding encoding, std::ostream& out);

}  // namespace libmap
