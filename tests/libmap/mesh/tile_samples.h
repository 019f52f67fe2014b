// Meshes cut into folders of pieces.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "libmap/io/mesh_io.h"
#include "libmap/mesh/mesh_parts.h"
#include "libmap/tiles/xy_tile.h"

namespace graspmap_test {

// Writes one file per square with the triangles whose centers are in it. Returns the sorted paths.
inline std::vector<std::filesystem::path> write_tiles(const libmap::TriangleMesh& mesh,
                                                      double tile_m,
                                                      const std::filesystem::path& folder) {
  std::map<std::filesystem::path, std::vector<bool>> parts;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Eigen::Vector2d center = center_of(mesh, mesh.triangles[t]).head<2>();
    const std::string name = tile_file_name(libmap::xy_tile_at(center, tile_m), ".ply");
    std::vector<bool>& marks = parts[folder / name];
    marks.resize(mesh.triangles.size());
    marks[t] = true;
  }
  std::vector<std::filesystem::path> files;
  for (const auto& [file, marks] : parts) {
    libmap::write_mesh(file, libmap::select_triangles(mesh, marks));
    files.push_back(file);
  }
  return files;
}

}  // namespace graspmap_test
