// VTP, ParaView's polygonal data, through VTK, in memory. Points of a cloud are vertex cells, so
// that ParaView shows them. Normals are the point normals, colours a uint8 x 3 array "rgb", scalar
// fields arrays of their own type; arrays of n numbers read as NAME_0 .. NAME_n-1. The viewpoint is
// a field array "viewpoint" (tx ty tz qw qx qy qz). Triangle strips and polygons of more than three
// corners are cut into triangles.
#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "libmap/cloud/columns.h"

namespace libmap {

// What is written; the pointers may be null. Without triangles every point is a vertex cell.
struct VtpContent {
  const ColumnSet* vertices = nullptr;
  const std::vector<Triangle>* triangles = nullptr;
  const ColumnSet* faces = nullptr;  // one row a triangle
  const Pose* viewpoint = nullptr;   // not written if it is the identity
};

// The counts and the arrays' names and types, without the data where VTK allows it.
GeometryFileInfo vtp_info(const std::string& bytes);

// Throws Error (without the file's name) with VTK's own reason; VTK itself prints nothing.
GeometryColumns decode_vtp(const std::string& bytes);

// VTK cannot read NaN and infinity as text: data that hold some are written as binary.
void encode_vtp(const VtpContent& content, FileEncoding encoding, std::ostream& out);

}  // namespace libmap
