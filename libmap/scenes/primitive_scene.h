// Describes test scenes of primitive shapes (spheres, boxes, ...), and reads them from YAML.
#pragma once

#include <Eigen/Core>
#include <string>
#include <variant>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/pose.h"

namespace libmap {

// A sphere centered on the shape's origin. All sizes of shapes, except a bump's height, are > 0.
struct Sphere {
  double radius_m = 0.0;
  bool operator==(const Sphere&) const = default;
};
// A capsule along the x axis, centered on the shape's origin; `length_m` includes both round ends.
struct Capsule {
  double radius_m = 0.0;
  double length_m = 0.0;
  bool operator==(const Capsule&) const = default;
};
// A cone along the z axis. The base, at z = 0, is centered on the shape's origin.
struct Cone {
  double radius_m = 0.0;
  double height_m = 0.0;
  bool operator==(const Cone&) const = default;
};
// A cylinder along the z axis. The base, at z = 0, is centered on the shape's origin.
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
// A rectangle centered on the shape's origin, with the outside at +z. It must face up in the scene.
struct Plane {
  double size_x_m = 0.0;
  double size_y_m = 0.0;
  bool operator==(const Plane&) const = default;
};
// Profile of a bump, i.e. height at the distance r from its center; h and R are height and radius.
// cosine: h cos^2(pi r / (2 R)) up to r = R, then 0. gaussian: h exp(-r^2 / (2 (R / 3)^2)).
enum class BumpProfile { cosine, gaussian };
// A smooth elevation of the ground, or a hollow if `height_m` is negative. Its center is the
// projection of the bump's position onto the ground plane. Heights of several bumps are added.
struct Bump {
  double height_m = 0.0;
  double radius_m = 0.0;
  BumpProfile profile = BumpProfile::cosine;
  bool operator==(const Bump&) const = default;
};

using ShapeGeometry = std::variant<Sphere, Capsule, Cone, Cylinder, Box, Plane, Bump>;

// Position and angles of a shape in the scene, in the convention of make_pose_from_rpy (pose.h).
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
  // shorter than its diameter, a plane does not face up, or the scene has a bump but no plane.
  void check() const;
};

// "sphere", "capsule", "cone", "cylinder", "box", "plane", "bump", in the order of ShapeGeometry.
const std::vector<std::string>& shape_kinds();
const std::string& shape_kind(const SceneShape& shape);  // name of the shape's kind
// Returns a shape with default sizes. Throws Error for an unknown kind, naming the nearest one.
ShapeGeometry make_shape_geometry(const std::string& kind);
// Returns the parameters of a shape (sizes, placement, name) by key. The table refers to `shape`.
ParameterTable shape_parameters(SceneShape& shape);

// Exact properties of a point on the surface of a scene.
struct SurfaceTruth {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // m
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();   // outward, unit length
  double curvature_min = 0.0;  // smaller principal curvature, 1/m; > 0 where convex
  double curvature_max = 0.0;  // larger principal curvature, 1/m
  // Height above the first plane without its bumps, along its normal, m; without a plane, z.
  double height = 0.0;
  // Index in PrimitiveScene::shapes; on the ground within bumps, the bump of the largest |height|.
  int shape = 0;
};

// Parses a scene in YAML:
//
//   shapes:
//     - {shape: plane, size_x_m: 3, size_y_m: 3}
//     - {shape: sphere, name: a hemisphere, radius_m: 0.25, x_m: -1, y_m: -1}
//
// Each entry requires `shape` and all sizes of this kind. Optional are `name`, x_m, y_m, z_m,
// roll_deg, pitch_deg, yaw_deg (default 0), and `profile` of a bump (default cosine). Throws Error
// naming `file`, entry, key, value and bound; for unknown keys and shapes, also the nearest one.
PrimitiveScene parse_scene(const std::string& text, const std::string& file);

}  // namespace libmap
