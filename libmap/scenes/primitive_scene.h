// Describes test scenes of primitive shapes (spheres, boxes, ...), and reads them from YAML.
#pragma once

#include <Eigen/Core>
#include <string>
#include <variant>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/pose.h"

namespace libmap {

// A sphere, centered on the shape's origin. All sizes except the height of a bump are > 0.
struct Sphere {
  double radius_m = 0.0;
  bool operator==(const Sphere&) const = default;
};
// A capsule along the x axis, centered on the shape's origin; `length_m` includes the round ends.
struct Capsule {
  double radius_m = 0.0;
  double length_m = 0.0;
  bool operator==(const Capsule&) const = default;
};
// A cone. The base is centered on the shape's origin; the apex is on the z axis.
struct Cone {
  double radius_m = 0.0;
  double height_m = 0.0;
  bool operator==(const Cone&) const = default;
};
// A cylinder along the z axis. The base is centered on the shape's origin.
struct Cylinder {
  double radius_m = 0.0;
  double height_m = 0.0;
  bool operator==(const Cylinder&) const = default;
};
// A box. The base, at z = 0, is centered on the shape's origin.
struct Box {
  double size_x_m = 0.0;
  double size_y_m = 0.0;
  double size_z_m = 0.0;
  bool operator==(const Box&) const = default;
};
// A rectangle centered on the shape's origin with the outside at +z; it must face up.
struct Plane {
  double size_x_m = 0.0;
  double size_y_m = 0.0;
  bool operator==(const Plane&) const = default;
};
// cosine: height * cos^2(pi r / (2 radius)) up to r = radius, 0 beyond.
// gaussian: height * exp(-r^2 / (2 s^2)) with s = radius / 3, everywhere.
enum class BumpProfile { cosine, gaussian };
// A smooth elevation of the ground, or a hollow if `height_m` is negative. r is the distance in the
// ground's plane from the projection of the bump's position. Heights of several bumps are added.
struct Bump {
  double height_m = 0.0;
  double radius_m = 0.0;
  BumpProfile profile = BumpProfile::cosine;
  bool operator==(const Bump&) const = default;
};

using ShapeGeometry = std::variant<Sphere, Capsule, Cone, Cylinder, Box, Plane, Bump>;

// Position and angles of a shape in the scene, with the convention of make_pose_from_rpy (pose.h).
struct Placement {
  double x_m = 0.0;
  double y_m = 0.0;
  double z_m = 0.0;
  double roll_deg = 0.0;
  double pitch_deg = 0.0;
  double yaw_deg = 0.0;
  bool operator==(const Placement&) const = default;
  Pose pose() const;  // scene_from_shape
};

struct SceneShape {
  ShapeGeometry geometry;
  Placement placement;
  std::string name;  // free text; may be empty
  bool operator==(const SceneShape&) const = default;
};

struct PrimitiveScene {
  std::vector<SceneShape> shapes;
  bool operator==(const PrimitiveScene&) const = default;

  // Throws Error naming shape, parameter, value and bound if there is no shape, a capsule is
  // shorter than its diameter, a plane does not face up, or a bump has no plane.
  void check() const;
};

// "sphere", "capsule", "cone", "cylinder", "box", "plane", "bump", in the order of ShapeGeometry.
const std::vector<std::string>& shape_kinds();
const std::string& shape_kind(const SceneShape& shape);
// Returns the shape of a kind with default sizes. Throws Error naming the nearest known kind.
ShapeGeometry make_shape_geometry(const std::string& kind);
// Returns the parameters of a shape: sizes, placement and name. The table refers to `shape`.
ParameterTable shape_parameters(SceneShape& shape);

struct SurfaceTruth {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // m
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();   // outward, unit length
  double curvature_min = 0.0;                          // signed principal curvatures, 1/m
  double curvature_max = 0.0;
  // Height above the first plane without bumps, along its normal, m; z without a plane.
  double height = 0.0;
  // Index in the scene; on the ground within the radius of bumps, the bump with the largest height.
  int shape = 0;
};

// Parses a scene in YAML:
//
//   shapes:
//     - {shape: plane, size_x_m: 3, size_y_m: 3}
//     - {shape: sphere, name: a hemisphere, radius_m: 0.25, x_m: -1, y_m: -1}
//
// Each entry requires `shape` and all sizes of the kind. Optional are `name`, x_m, y_m, z_m,
// roll_deg, pitch_deg, yaw_deg (0) and a bump's `profile` (cosine). Throws Error naming `file`, the
// entry, the key, the value and the bound, and the nearest known name for unknown keys and shapes.
PrimitiveScene parse_scene(const std::string& text, const std::string& file);

}  // namespace libmap
