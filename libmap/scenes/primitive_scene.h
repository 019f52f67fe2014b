// Scenes of primitive shapes as exact geometry: what every later stage is checked against.
//
// A scene is the union of its shapes, seen from outside. Balls, capsules, cones, cylinders and
// boxes are solids; a plane is the top of solid ground that reaches down without end beneath its
// rectangle (its sides are no surface); bumps bend the first plane, the ground, along its normal.
// A point that lies inside another solid is no surface, nor is one where two faces touch.
//
// Principal curvatures are in 1/m and positive where the surface bends away from its outside
// normal: +1/r, +1/r on a ball of radius r, negative in a bowl, 0 on a plane. On an edge, a crease
// or an apex, normal and curvatures are those of one of the faces that meet there.
#pragma once

#include <Eigen/Core>
#include <string>
#include <variant>
#include <vector>

#include "libmap/core/parameters.h"
#include "libmap/core/pose.h"

namespace libmap {

// Centered on its origin.
struct Sphere {
  double radius_m = 0.0;
  bool operator==(const Sphere&) const = default;
};
// Centered on its origin, along its x axis; `length_m` includes the round ends.
struct Capsule {
  double radius_m = 0.0;
  double length_m = 0.0;
  bool operator==(const Capsule&) const = default;
};
// Its base stands on its origin, its apex on its z axis.
struct Cone {
  double radius_m = 0.0;
  double height_m = 0.0;
  bool operator==(const Cone&) const = default;
};
// Its base stands on its origin, its axis is z.
struct Cylinder {
  double radius_m = 0.0;
  double height_m = 0.0;
  bool operator==(const Cylinder&) const = default;
};
// Its base stands on its origin.
struct Box {
  double size_x_m = 0.0;
  double size_y_m = 0.0;
  double size_z_m = 0.0;
  bool operator==(const Box&) const = default;
};
// A rectangle centered on its origin whose outside is +z; it must face up.
struct Plane {
  double size_x_m = 0.0;
  double size_y_m = 0.0;
  bool operator==(const Plane&) const = default;
};
// cosine: height * cos^2(pi r / (2 radius)) up to r = radius, nothing beyond.
// gaussian: height * exp(-r^2 / (2 s^2)) with s = radius / 3, everywhere.
enum class BumpProfile { cosine, gaussian };
// A smooth rise of the ground, or a hollow if `height_m` is negative. r is measured within the
// ground's plane from the foot of the bump's position; heights of several bumps add up.
struct Bump {
  double height_m = 0.0;
  double radius_m = 0.0;
  BumpProfile profile = BumpProfile::cosine;
  bool operator==(const Bump&) const = default;
};

using ShapeGeometry = std::variant<Sphere, Capsule, Cone, Cylinder, Box, Plane, Bump>;

// scene_from_shape, as make_pose_from_rpy takes it.
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

  // Throws Error naming shape, parameter, value and bound.
  void check() const;
};

// "sphere", "capsule", "cone", "cylinder", "box", "plane", "bump", in the order of ShapeGeometry.
const std::vector<std::string>& shape_kinds();
const std::string& shape_kind(const SceneShape& shape);
// Throws Error naming the nearest known kind.
ShapeGeometry make_shape_geometry(const std::string& kind);
// Sizes, placement and name of one shape by key. The table refers to `shape`.
ParameterTable shape_parameters(SceneShape& shape);

struct SurfaceTruth {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // m
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();   // outside, unit length
  double curvature_min = 0.0;                          // 1/m, the smaller one with its sign
  double curvature_max = 0.0;                          // 1/m
  double height = 0.0;  // m above the first plane before any bump, along its normal; z if none
  int shape = 0;        // index in the scene; on the ground within a bump's radius, the bump that
                        // lifts or lowers the ground most there
};

// Scenes as YAML:
//
//   shapes:
//     - {shape: plane, size_x_m: 3, size_y_m: 3}
//     - {shape: sphere, name: a hemisphere, radius_m: 0.25, x_m: -1, y_m: -1}
//
// Each entry has `shape`, all sizes of its kind, and as it needs them `name`, x_m, y_m, z_m,
// roll_deg, pitch_deg, yaw_deg (0) and a bump's `profile` (cosine). Throws Error naming `file`, the
// entry, the key, the value and the bound, and for unknown keys and shapes the nearest known one.
PrimitiveScene parse_scene(const std::string& text, const std::string& file);

}  // namespace libmap
