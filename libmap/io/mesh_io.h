// Triangle meshes from and to files. The extension, in any case, says the format.
//
//          read by         written by      kept
//   .ply   ply_codec       ply_codec       doubles, normals, colors, vertex and face fields
//   .vtp   not read        VTK             doubles, normals, colors, vertex and face fields
//   .obj   obj_codec       this file       doubles; normals, colors
//   .off   this file       this file       doubles; geometry alone
//   .stl   assimp          assimp          float32; geometry alone
//   .glb   assimp          assimp          float32; normals, colors
//   .tif   libmap/raster   not written     a DEM; geometry alone
//
// float32 holds 24 bits: at 16 m from the origin a step is 2 micrometers, at 500 km (map
// coordinates) 3 cm. Move such a mesh to a local origin, or use .ply or .vtp, which store float64
// where float32 would move some coordinate by more than 1e-5 m.
//
// assimp yields corners, not vertices: corners equal in every number are made
// one vertex again, in the order of their first use, and vertices of no triangle are lost. GLB has
// y up by its standard, this project z: writing and reading turn it about x.
#pragma once

#include <filesystem>
#include <vector>

#include "libmap/core/triangle_mesh.h"
#include "libmap/io/geometry_file.h"

namespace libmap {

struct MeshReadResult {
  TriangleMesh mesh;
  GeometryFileInfo info;
};

enum class FileKind { cloud, mesh };  // what a file holds: points alone, or faces too

// Of a folder all pieces together, vertices on seams once a piece, and the last one's info.
// Polygons of more than three corners are cut into fans of triangles, each with the polygon's face
// fields; lines and points are passed over. Throws Error naming the file: it cannot be read, is not
// of its format, holds no triangle, promises more than it holds, has a corner that is no vertex or
// a vertex that is not finite.
MeshReadResult read_mesh(const std::filesystem::path& path);

// The file itself, or the files of a folder with an extension that meshes are read from, in the
// order of their names; hidden files are passed over. Throws Error: a folder without one.
std::vector<std::filesystem::path> mesh_pieces(const std::filesystem::path& file_or_folder);

// Writes straight to `path`; callers that need the file whole or not at all pass an OutputFile's
// temporary path. What a format cannot keep (the table above) is left out. Throws Error: unknown
// extension, a vertex not finite, an index out of range, a failed write (ErrorKind::failed).
void write_mesh(const std::filesystem::path& path, const TriangleMesh& mesh,
                const GeometryWriteOptions& options = {});

// Throws Error unless meshes are written in the format that the extension names.
void require_mesh_format(const std::filesystem::path& path);

// Throws Error if a vertex is no single-precision number, as which these formats keep or assimp
// reads it: it would come back infinite.
void require_single_precision(const TriangleMesh& mesh, const std::string& format);

// Whether the file holds a mesh (it has faces), or a folder one that does, or a cloud: by its
// extension, and for .ply by its content. Throws Error: an extension of neither, or a file that
// cannot be read.
FileKind file_kind(const std::filesystem::path& path);

}  // namespace libmap
