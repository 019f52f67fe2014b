// Writes a site as a world for robot simulators: a folder that each simulator loads unchanged.
//
//   world.sdf                 Gazebo, CoppeliaSim
//   world.xml                 MuJoCo
//   world.urdf                Bullet, PyBullet, Isaac
//   meshes/MODEL.glb          visual mesh, with its texture or its vertex colors
//   meshes/MODEL_visual_*     the visual mesh as OBJ, MTL and PNG, one mesh per page of the texture
//   meshes/MODEL_score_*.obj  squares that show scores of a map, one mesh per color
//   meshes/MODEL_collision.obj  collision mesh
//   meshes/MODEL_field.bin    height field: rows and columns (int32), then heights (float32)
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/pose.h"
#include "libmap/core/result_table.h"
#include "libmap/core/triangle_mesh.h"
#include "libmap/scan/rig_io.h"
#include "libmap/world/collision_balls.h"
#include "libmap/world/height_field.h"

namespace libmap {

struct WorldOptions {
  double collision_error_m = 0.0014;  // > 0: maximum distance between collision and visual mesh
  HeightFieldOptions field{};
  double ball_radius_m = 0.05;    // > 0: maximum radius of balls (CollisionBallOptions)
  std::string gravity = "earth";  // m/s2 downwards, or earth, moon, mars
  double friction = 0.8;          // >= 0: Coulomb's coefficient of friction
  double restitution = 0.0;       // 0 to 1: coefficient of restitution
  double sensor_noise_m = 0.0;    // >= 0: standard deviation of depth of the rig's cameras
};
void bind(ParameterTable& table, WorldOptions& options);

// Returns gravity in m/s2 for a number >= 0 and < 1e6, or earth, moon, mars; else throws Error.
double gravity_of(const std::string& text);

// Throws Error naming `field` for a name that SDF, MJCF or URDF forbids: empty, "world", "__X__"
// for any X, or with "::" or a control character.
void require_world_name(const std::string& name, const std::string& field);

struct WorldReport {
  std::size_t visual_triangles = 0;
  std::size_t collision_triangles = 0;
  // Maximum distance between collision mesh and visual mesh, in both directions.
  double collision_deviation_m = 0.0;
  std::size_t field_nodes = 0;      // nodes of the height fields
  double field_deviation_m = 0.0;   // maximum of HeightField::deviation_m
  std::size_t missing_cells = 0;    // cells of the height fields that balls replace
  std::size_t balls = 0;            // balls that replace cells
  std::size_t collision_bytes = 0;  // size of collision meshes and height fields
  std::size_t score_points = 0;     // number of map points on the surface
};
void describe(ResultTable& table, const WorldReport& report);

// A mesh that is displayed but does not collide.
struct WorldVisual {
  std::string file;            // .obj in the folder of meshes
  std::string texture;         // image in the same folder; empty: none
  Color color{160, 160, 160};  // color without texture
};

// A site, or one tile of a site.
struct WorldModel {
  std::string name;
  std::vector<WorldVisual> visuals;  // the surface, then the squares of a map's scores
  HeightField field;                 // is_missing is empty; balls replace missing cells
  std::vector<CollisionBall> balls;  // balls that replace cells of the field
};

// A location for the gripper, in the frame of the world.
struct WorldFoothold {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();   // m
  Eigen::Vector3d approach = Eigen::Vector3d::UnitZ();  // unit length, away from the surface
  Color color{};
};

struct WorldRig {
  CameraRig rig;
  Pose world_from_robot = Pose::Identity();
};

struct WorldScene {
  std::string name;
  std::vector<std::string> notes;  // comments at the beginning of each file
  WorldOptions options;
  std::vector<WorldModel> models;
  std::optional<WorldRig> rig;
  std::vector<WorldFoothold> footholds;
};

// Returns the contents of world.sdf, world.xml and world.urdf by file name.
std::map<std::string, std::string> world_texts(const WorldScene& scene);

// Returns the names of the files and the folder that a world contains.
std::vector<std::string> world_file_names();

// Points of a map with one color each, which are shown as squares on the surface.
struct WorldScores {
  std::vector<Eigen::Vector3d> points;
  std::vector<Color> colors;
  double size_m = 0.0;  // side length of a square
};

struct WorldModelInput {
  std::string name;
  TexturedMesh visual;  // visual mesh
  // The surface of `visual` and of its surroundings within twice ball_radius_m.
  TriangleMesh surface;
};

// Makes the collision shapes of a model, writes its meshes to `folder` (none if `folder` is empty),
// and adds its numbers to `report`. Bytes do not depend on the number of threads. Throws Error if
// an option is out of range, no triangle faces up, or the height field has more than 2^26 nodes.
WorldModel write_world_model(const std::filesystem::path& folder, const WorldModelInput& input,
                             const WorldScores& scores, const WorldOptions& options,
                             WorldReport& report);

// Writes the files of world_texts to `folder`; only checks names if `folder` is empty. Throws Error
// for a name that simulators forbid, that two models share, or that is reserved (rig, footholds).
void write_world(const std::filesystem::path& folder, const WorldScene& scene);

}  // namespace libmap
