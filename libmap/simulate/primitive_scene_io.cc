#include "libmap/simulate/primitive_scene_io.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <set>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/yaml_document.h"

namespace libmap {

namespace {

const std::set<std::string> optional_keys = {"name",     "x_m",       "y_m",     "z_m",
                                             "roll_deg", "pitch_deg", "yaw_deg", "profile"};

std::string scalar_text(const YAML::Node& node, const std::string& field) {
  if (!node.IsScalar()) throw Error("not a single value", {.field = field});
  return node.Scalar();
}

SceneShape parse_shape(const YAML::Node& node) {
  if (!node.IsMap()) throw Error("not a map of keys and values");
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
      throw Error("a " + shape_kind(shape) + " needs it", {.field = key});
  return shape;
}

PrimitiveScene parse_root(const YAML::Node& root) {
  if (!root.IsMap()) throw Error("a scene is a map with the key 'shapes'");
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

PrimitiveScene load_scene(const std::filesystem::path& path) {
  return parse_scene(read_whole_file(path, max_yaml_bytes), path.string());
}

}  // namespace libmap
