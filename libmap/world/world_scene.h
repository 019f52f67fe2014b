// Description of a site as a world for simulators: models, the robot's cameras, and footholds.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/point_cloud.h"
#include "libmap/core/pose.h"
#include "libmap/core/result_table.h"
#include "libmap/scan/rig_io.h"
#include "libmap/world/convex_pieces.h"
#include "libmap/world/height_field.h"

namespace libmap {

struct WorldOptions {
  double collision_error_m = 0.0014;  // > 0: between the collision mesh and the visual one
  HeightFieldOptions field{};
  double piece_depth_m = 0.02;    // > 0: maximum depth of the convex pieces
  std::string gravity = "earth";  // m/s2 downwards, or earth, moon, mars
  double friction = 0.8;          // >= 0: Coulomb's coefficient
  double restitution = 0.0;       // 0 to 1
  double sensor_noise_m = 0.0;    // >= 0: standard deviation of the rig's depth
};
void bind(ParameterTable& table, WorldOptions& options);

// Throws Error for a text that is neither a number >= 0 nor a known body.
double gravity_of(const std::string& text);

// Throws Error naming `field` for a name that SDF, MJCF or URDF forbids: empty, "world", with
// "::" or a control character, or between two double underscores.
void require_world_name(const std::string& name, const std::string& field);

// Visible mesh, without collisions.
struct WorldVisual {
  std::string file;     // .obj in the folder of meshes
  std::string texture;  // image beside it; empty: none
  Color color{160, 160, 160};
};

// A site, or one tile of a site.
struct WorldModel {
  std::string name;
  std::vector<WorldVisual> visuals;
  std::vector<WorldVisual> graspability;
  std::string collision;   // .obj in the folder of meshes
  std::string field_file;  // file of MuJoCo's height field
  HeightField field;       // without the cells
  std::vector<ConvexPiece> pieces;
};

struct WorldFoothold {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d approach = Eigen::Vector3d::UnitZ();  // unit length, away from the surface
  Color color{};
};

struct WorldRig {
  CameraRig rig;
  Pose world_from_robot = Pose::Identity();
};

struct WorldScene {
  std::string name;
  std::vector<std::string> notes;  // comments at the head of each file
  WorldOptions options;
  std::vector<WorldModel> models;
  std::optional<WorldRig> rig;
  std::vector<WorldFoothold> footholds;
};

inline constexpr const char* world_mesh_folder = "meshes";
inline constexpr double foothold_radius_m = 0.01;

// Return a mesh file's path relative to the descriptions, and gravity as "x y z", m/s2.
std::string mesh_path(const std::string& file);
std::string gravity_text(const WorldOptions& options);

// Return the descriptions of the world; mesh paths are relative to the folder of the description.
// Gazebo and CoppeliaSim read SDF; MuJoCo MJCF; Bullet, PyBullet and Isaac URDF.
std::string to_sdf(const WorldScene& scene);
std::string to_mjcf(const WorldScene& scene);
std::string to_urdf(const WorldScene& scene);

}  // namespace libmap
