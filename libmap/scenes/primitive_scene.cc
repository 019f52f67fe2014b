#include "libmap/scenes/primitive_scene.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "libmap/core/error.h"
#include "libmap/core/text.h"
#include "libmap/core/yaml_document.h"

namespace libmap {

namespace {

constexpr Range size_range{0.0, 1e4, true, false};
constexpr Range position_range{-1e6, 1e6};
constexpr Range angle_range{-360.0, 360.0};

struct ParameterAdder {
  ParameterTable& table;

  void operator()(Sphere& sphere) const {
    table.add("radius_m", sphere.radius_m, size_range, "radius of the shape, m");
  }
  void operator()(Capsule& capsule) const {
    table.add("radius_m", capsule.radius_m, size_range, "radius of the capsule, m");
    table.add("length_m", capsule.length_m, size_range,
              "length of the capsule along x including the round ends, m");
  }
  void operator()(Cone& cone) const {
    table.add("radius_m", cone.radius_m, size_range, "radius of the base, m");
    table.add("height_m", cone.height_m, size_range, "height of the apex above the base, m");
  }
  void operator()(Cylinder& cylinder) const {
    table.add("radius_m", cylinder.radius_m, size_range, "radius of the shape, m");
    table.add("height_m", cylinder.height_m, size_range, "height of the top above the base, m");
  }
  void operator()(Box& box) const {
    table.add("size_x_m", box.size_x_m, size_range, "length of the shape along x, m");
    table.add("size_y_m", box.size_y_m, size_range, "length of the shape along y, m");
    table.add("size_z_m", box.size_z_m, size_range, "height of the top above the base, m");
  }
  void operator()(Plane& plane) const {
    table.add("size_x_m", plane.size_x_m, size_range, "length of the shape along x, m");
    table.add("size_y_m", plane.size_y_m, size_range, "length of the shape along y, m");
  }
  void operator()(Bump& bump) const {
    table.add("height_m", bump.height_m, Range{-1e4, 1e4}, "height of a bump, m; < 0: a hollow");
    table.add("radius_m", bump.radius_m, size_range, "radius of the shape, m");
    table.add(
        "profile", bump.profile,
        {{"cosine", BumpProfile::cosine}, {"gaussian", BumpProfile::gaussian}},
        "bump profile; cosine: cos^2 up to the radius; gaussian: radius is 3 standard deviations");
  }
};

Error shape_error(std::size_t i, const SceneShape& shape, const Error& error) {
  return Error(error.reason() + " (" + shape_kind(shape) + ")",
               error.in_field("shapes[" + std::to_string(i) + "]", ".").context());
}

void check_shape(const SceneShape& shape) {
  if (const auto* capsule = std::get_if<Capsule>(&shape.geometry)) {
    if (capsule->length_m < 2.0 * capsule->radius_m)
      throw Error("less than the diameter", {.field = "length_m",
                                             .value = to_text(capsule->length_m),
                                             .bound = ">= " + to_text(2.0 * capsule->radius_m)});
  }
  if (std::holds_alternative<Plane>(shape.geometry)) {
    const double up = shape.placement.pose().linear()(2, 2);
    if (up < 1e-6)
      throw Error(
          "the plane does not face up; use a box for a vertical or overhanging face",
          {.field = "roll_deg, pitch_deg",
           .value = to_text(shape.placement.roll_deg) + ", " + to_text(shape.placement.pitch_deg),
           .bound = "a tilt of less than 90 degrees"});
  }
}

}  // namespace

Pose Placement::pose() const {
  return make_pose_from_rpy({x_m, y_m, z_m}, {roll_deg, pitch_deg, yaw_deg});
}

const std::vector<std::string>& shape_kinds() {
  static const std::vector<std::string> kinds = {"sphere", "capsule", "cone", "cylinder",
                                                 "box",    "plane",   "bump"};
  return kinds;
}

const std::string& shape_kind(const SceneShape& shape) {
  return shape_kinds()[shape.geometry.index()];
}

ShapeGeometry make_shape_geometry(const std::string& kind) {
  static const std::array<ShapeGeometry, 7> geometries = {Sphere{}, Capsule{}, Cone{}, Cylinder{},
                                                          Box{},    Plane{},   Bump{}};
  for (const ShapeGeometry& geometry : geometries)
    if (shape_kinds()[geometry.index()] == kind) return geometry;
  std::string bound = "one of";
  for (const std::string& known : shape_kinds()) bound += " " + known;
  throw Error("unknown shape" + did_you_mean(kind, shape_kinds()),
              {.field = "shape", .value = kind, .bound = bound});
}

ParameterTable shape_parameters(SceneShape& shape) {
  ParameterTable table;
  table.add("name", shape.name, "name of the shape");
  std::visit(ParameterAdder{table}, shape.geometry);
  Placement& placement = shape.placement;
  table.add("x_m", placement.x_m, position_range, "x of the shape's origin in the scene, m");
  table.add("y_m", placement.y_m, position_range, "y of the shape's origin in the scene, m");
  table.add("z_m", placement.z_m, position_range, "z of the shape's origin in the scene, m");
  table.add("roll_deg", placement.roll_deg, angle_range,
            "first rotation of the shape, about the scene's x axis, degrees");
  table.add("pitch_deg", placement.pitch_deg, angle_range,
            "second rotation of the shape, about the scene's y axis, degrees");
  table.add("yaw_deg", placement.yaw_deg, angle_range,
            "third rotation of the shape, about the scene's z axis, degrees");
  return table;
}

void PrimitiveScene::check() const {
  bool has_plane = false;
  bool has_bump = false;
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    has_plane = has_plane || std::holds_alternative<Plane>(shapes[i].geometry);
    has_bump = has_bump || std::holds_alternative<Bump>(shapes[i].geometry);
    try {
      check_shape(shapes[i]);
    } catch (const Error& error) {
      throw shape_error(i, shapes[i], error);
    }
  }
  if (shapes.empty()) throw Error("a scene needs at least one shape", {.field = "shapes"});
  if (has_bump && !has_plane) throw Error("bumps require a plane", {.field = "shapes"});
}

namespace {

const std::set<std::string> optional_keys = {"name",     "x_m",       "y_m",     "z_m",
                                             "roll_deg", "pitch_deg", "yaw_deg", "profile"};

std::string scalar_text(const YAML::Node& node, const std::string& field) {
  if (!node.IsScalar()) throw Error("not a single value", {.field = field});
  return node.Scalar();
}

SceneShape parse_shape(const YAML::Node& node) {
  if (!node.IsMap()) throw Error("not a YAML mapping");
  if (!node["shape"]) throw Error("is missing", {.field = "shape"});
  SceneShape shape;
  shape.geometry = make_shape_geometry(scalar_text(node["shape"], "shape"));
  const ParameterTable table = shape_parameters(shape);
  std::vector<std::string> known = table.keys();
  known.emplace_back("shape");
  check_keys(node, known, " of a " + shape_kind(shape));
  for (const auto& entry : node)
    if (const std::string& key = entry.first.Scalar(); key != "shape")
      table.set(key, scalar_text(entry.second, key));
  std::sort(known.begin(), known.end());
  for (const std::string& key : known)
    if (!optional_keys.contains(key) && !node[key])
      throw Error("required for a " + shape_kind(shape), {.field = key});
  return shape;
}

PrimitiveScene parse_root(const YAML::Node& root) {
  if (!root.IsMap()) throw Error("not a YAML mapping; a scene file requires the key 'shapes'");
  check_keys(root, {"shapes"});
  const YAML::Node list = root["shapes"];
  if (!list) throw Error("is missing", {.field = "shapes"});
  if (!list.IsSequence()) throw Error("not a list", {.field = "shapes"});
  PrimitiveScene scene;
  for (std::size_t i = 0; i < list.size(); ++i) {
    try {
      scene.shapes.push_back(parse_shape(list[i]));
    } catch (const Error& error) {
      throw at_node(error, "shapes[" + std::to_string(i) + "]", list[i]);
    }
  }
  scene.check();
  return scene;
}

}  // namespace

PrimitiveScene parse_scene(const std::string& text, const std::string& file) {
  PrimitiveScene scene;
  read_yaml(text, file, [&](const YAML::Node& root) { scene = parse_root(root); });
  return scene;
}

}  // namespace libmap
