#include "libmap/simulate/primitive_scene_io.h"

#include <yaml-cpp/yaml.h>

#include <set>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/text.h"
#include "libmap/core/yaml_document.h"

namespace libmap {

namespace {

const std::set<std::string> optional_keys = {"name",     "x_m",       "y_m",     "z_m",
                                             "roll_deg", "pitch_deg", "yaw_deg", "profile"};

std::string scalar_text(const YAML::Node& node, const std::string& field) {
  if (!node.IsScalar()) throw Error("not a single value", {.field = field});
  return node.Scalar();
}

// The entry's keys, each once, with their scalar values, in order.
std::vector<std::pair<std::string, std::string>> entries_of(const YAML::Node& node) {
  if (!node.IsMap()) throw Error("not a map of keys and values");
  std::vector<std::pair<std::string, std::string>> entries;
  std::set<std::string> seen;
  for (const auto& entry : node) {
    const std::string key = scalar_text(entry.first, "key");
    if (!seen.insert(key).second) throw Error("is a duplicate", {.field = key});
    entries.emplace_back(key, scalar_text(entry.second, key));
  }
  return entries;
}

SceneShape parse_shape(const YAML::Node& node) {
  const auto entries = entries_of(node);
  SceneShape shape;
  std::set<std::string> missing = {"shape"};
  for (const auto& [key, text] : entries) {
    if (key != "shape") continue;
    shape.geometry = make_shape_geometry(text);
    missing.clear();
  }
  if (!missing.empty()) throw Error("is missing", {.field = "shape"});
  const ParameterTable table = shape_parameters(shape);
  std::vector<std::string> known = table.keys();
  known.emplace_back("shape");
  for (const std::string& key : table.keys())
    if (!optional_keys.contains(key)) missing.insert(key);
  for (const auto& [key, text] : entries) {
    if (key == "shape") continue;
    if (table.find(key) == nullptr)
      throw Error("unknown key of a " + shape_kind(shape) + did_you_mean(key, known),
                  {.field = key});
    table.set(key, text);
    missing.erase(key);
  }
  if (!missing.empty())
    throw Error("a " + shape_kind(shape) + " needs it", {.field = *missing.begin()});
  return shape;
}

Error with_place(const Error& error, std::size_t i, const YAML::Node& node) {
  ErrorContext context = error.context();
  std::string place = "shapes[" + std::to_string(i) + "]";
  if (!context.field.empty()) place += "." + context.field;
  if (!node.Mark().is_null()) place += " (line " + std::to_string(node.Mark().line + 1) + ")";
  context.field = place;
  return Error(error.reason(), context);
}

PrimitiveScene parse_root(const YAML::Node& root) {
  if (!root.IsMap()) throw Error("a scene is a map with the key 'shapes'");
  for (const auto& entry : root) {
    const std::string key = scalar_text(entry.first, "key");
    if (key != "shapes") throw Error("unknown key" + did_you_mean(key, {"shapes"}), {.field = key});
  }
  if (root.size() > 1) throw Error("is a duplicate", {.field = "shapes"});
  const YAML::Node list = root["shapes"];
  if (!list) throw Error("is missing", {.field = "shapes"});
  if (!list.IsSequence()) throw Error("not a list", {.field = "shapes"});
  PrimitiveScene scene;
  for (std::size_t i = 0; i < list.size(); ++i) {
    try {
      scene.shapes.push_back(parse_shape(list[i]));
    } catch (const Error& error) {
      throw with_place(error, i, list[i]);
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
