// Writes a site as a folder that simulators load directly ("world").
//
//   world.sdf                 Gazebo, CoppeliaSim
//   world.xml                 MuJoCo
//   world.urdf                Bullet, PyBullet, Isaac
//   meshes/MODEL.glb          visual mesh, with its texture or its vertex colors
//   meshes/MODEL_visual_*     the same as OBJ, MTL and PNG, one mesh per page of the texture
//   meshes/MODEL_score_*.obj  squares of a map, one mesh per color
//   meshes/MODEL_collision.obj
//   meshes/MODEL_field.bin    height field: rows and columns (int32), then heights (float32)
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "libmap/core/result_table.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/world/world_scene.h"

namespace libmap {

// Returns the names of the folder's files.
std::vector<std::string> world_file_names();

struct WorldReport {
  std::size_t visual_triangles = 0;
  std::size_t collision_triangles = 0;
  // No point of either mesh is farther than this from the other.
  double collision_deviation_m = 0.0;
  std::size_t field_nodes = 0;
  double field_deviation_m = 0.0;  // of HeightField
  std::size_t missing_cells = 0;
  std::size_t convex_pieces = 0;
  double piece_deviation_m = 0.0;   // of their outer faces from the visual mesh
  std::size_t collision_bytes = 0;  // of collision meshes and height fields
  std::size_t score_points = 0;     // of the map, on the surface
};
void describe(ResultTable& table, const WorldReport& report);

// The points of a map and colors of the points.
struct WorldScores {
  std::vector<Eigen::Vector3d> points;
  std::vector<Color> colors;
  double size_m = 0.0;  // of a square
};

struct WorldModelInput {
  std::string name;
  TexturedMesh visual;
  // The surface below the height field: the surface of `visual` and the surroundings.
  TriangleMesh surface;
};

// Makes the collision shapes of a model, and writes the meshes to `folder`, unless that is empty.
// Output bytes do not depend on the number of threads. Throws Error: no triangle, or none that
// faces up.
WorldModel write_world_model(const std::filesystem::path& folder, const WorldModelInput& input,
                             const WorldScores& scores, const WorldOptions& options,
                             WorldReport& report);

// Writes the descriptions. Throws Error for a name that simulators forbid.
void write_world(const std::filesystem::path& folder, const WorldScene& scene);

}  // namespace libmap
