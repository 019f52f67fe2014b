// Reader and writer of triangle mesh files. The extension (upper or lower case) selects the format.
//
//          read by         written by      content
//   .ply   ply_codec       ply_codec       doubles, normals, colors, vertex and face fields
//   .vtp   not read        VTK             doubles, normals, colors, vertex and face fields
//   .obj   obj_codec       mesh_io         doubles; normals, colors
//   .off   mesh_io         mesh_io         doubles; geometry only
//   .stl   assimp          assimp          float32; geometry only
//   .glb   assimp          assimp          float32; normals, colors
//   .tif   libmap/raster   not written     a DEM; geometry only
//
// float32 resolves 2 micrometers at 16 m from the origin, but only 3 cm at 500 km (map
// coordinates). Move a mesh far from the origin to a local origin, or use .ply or .vtp, which store
// float64 if float32 would move a coordinate by more than 1e-5 m.
//
// The library assimp reads .stl and .glb as triangle corners. Equal corners are merged into one
// vertex, in the order of first use; vertices without triangles are lost. GLB has y up by
// definition, this project z up: writing and reading rotate by 90 degrees about x.
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

enum class FileKind { cloud, mesh };  // content of a file: points only, or faces too

// Reads a file, or all files of a folder into one mesh with the info of the last file; vertices of
// different files are not merged. Polygons are split into triangle fans with the polygon's face
// fields; lines and points are ignored. Throws Error naming the file if it is unreadable, invalid
// or truncated, or contains no triangle, an index out of range or a vertex that is not finite.
MeshReadResult read_mesh(const std::filesystem::path& path);

// Returns the file itself, or the mesh files of a folder in the order of names, without hidden
// files. Throws Error if the folder contains no mesh file.
std::vector<std::filesystem::path> mesh_tiles(const std::filesystem::path& file_or_folder);

// Writes directly to `path`; for atomic output, pass the temporary path of an OutputFile. Omits
// attributes that the format does not have (see the table). Throws Error for an unknown extension,
// an index out of range or a vertex that is not finite; for .obj, .stl and .glb, also as
// require_single_precision. Throws Error (failed) if the write fails.
void write_mesh(const std::filesystem::path& path, const TriangleMesh& mesh,
                const GeometryWriteOptions& options = {});

// Throws Error unless the extension is a format that write_mesh supports.
void require_mesh_format(const std::filesystem::path& path);

// Throws Error if a coordinate exceeds the range of float32, in which .stl and .glb store it and
// many programs read .obj. The error names `format`, e.g. ".stl".
void require_single_precision(const TriangleMesh& mesh, const std::string& format);

// Returns `mesh` for a file with faces, a .tif, or a folder with a mesh file that has faces; else
// `cloud`. The extension decides, for .ply the header. Throws Error if the extension is unknown or
// the header of a .ply cannot be read.
FileKind file_kind(const std::filesystem::path& path);

}  // namespace libmap
