// Writes VTP, ParaView's polygonal data, through VTK, in memory. Points of a cloud are vertex
// cells, so that ParaView shows them. Normals are the point normals, colors a uint8 x 3 array
// "rgb", scalar fields arrays of their own type. The viewpoint is a field array "viewpoint" (tx ty
// tz qw qx qy qz).
#pragma once

#include <ostream>
#include <vector>

#include "libmap/io/columns.h"

namespace libmap {

// What is written; the pointers may be null. Without triangles every point is a vertex cell.
struct VtpContent {
  const ColumnSet* vertices = nullptr;
  const std::vector<Triangle>* triangles = nullptr;
  const ColumnSet* faces = nullptr;  // one row per triangle
  const Pose* viewpoint = nullptr;   // not written if it is the identity
};

// VTK cannot read NaN and infinity as text: data that hold some are written as binary.
void encode_vtp(const VtpContent& content, FileEncoding encoding, std::ostream& out);

}  // namespace libmap
