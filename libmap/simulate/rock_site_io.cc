#include "libmap/simulate/rock_site_io.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <functional>

#include "libmap/core/error.h"
#include "libmap/core/file_output.h"
#include "libmap/core/text.h"
#include "libmap/core/yaml_document.h"
#include "libmap/simulate/solid_noise.h"

namespace libmap {

namespace {

constexpr std::size_t max_entries = 10'000;

// The keys that the node gives.
std::vector<std::string> set_from_node(const ParameterTable& table, const YAML::Node& node) {
  if (!node.IsMap()) throw Error("not a map of keys and values");
  return set_from_yaml(table, YAML::Dump(node), {});
}

bool is_given(const std::vector<std::string>& keys, const std::string& key) {
  return std::find(keys.begin(), keys.end(), key) != keys.end();
}

void require(const std::vector<std::string>& keys, const std::string& key) {
  if (!is_given(keys, key)) throw Error("is missing", {.field = key});
}

SceneShape parse_bump(const YAML::Node& node) {
  SceneShape shape;
  shape.geometry = Bump{};
  const std::vector<std::string> keys = set_from_node(shape_parameters(shape), node);
  require(keys, "height_m");
  require(keys, "radius_m");
  return shape;
}

struct ParsedRock {
  SiteRock rock;
  bool has_place = false;
  bool has_yaw = false;
};

ParsedRock parse_rock(const YAML::Node& node, std::uint64_t default_seed) {
  SiteRock given;
  given.seed = default_seed;
  const std::vector<std::string> keys = set_from_node(rock_parameters(given), node);
  require(keys, "height_m");
  if (is_given(keys, "x_m") || is_given(keys, "y_m")) {
    require(keys, "x_m");
    require(keys, "y_m");
  }
  SiteRock rock = draw_rock(given.shape, given.height_m, given.seed);
  set_from_node(rock_parameters(rock), node);
  return {std::move(rock), is_given(keys, "x_m"), is_given(keys, "yaw_deg")};
}

void parse_list(const YAML::Node& root, const std::string& key,
                const std::function<void(const YAML::Node&)>& parse) {
  const YAML::Node list = root[key];
  if (!list || list.IsNull()) return;
  if (!list.IsSequence()) throw Error("not a list", {.field = key});
  if (list.size() > max_entries)
    throw Error("too many entries", {.field = key,
                                     .value = std::to_string(list.size()),
                                     .bound = "at most " + std::to_string(max_entries)});
  for (std::size_t n = 0; n < list.size(); ++n) {
    try {
      parse(list[n]);
    } catch (const Error& error) {
      throw at_node(error, key + "[" + std::to_string(n) + "]", list[n]);
    }
  }
}

void parse_part(const YAML::Node& root, const std::string& key, const ParameterTable& table) {
  const YAML::Node node = root[key];
  if (!node || node.IsNull()) return;
  try {
    set_from_node(table, node);
  } catch (const Error& error) {
    throw at_node(error, key, node);
  }
}

RockSite parse_root(const YAML::Node& root, std::optional<std::uint64_t> seed) {
  if (!root.IsMap()) throw Error("a site is a map with keys such as 'rocks'");
  check_keys(root, {"seed", "ground", "layout", "field_points", "bumps", "rocks"});
  RockSite site;
  ParameterTable own;
  own.add("seed", site.seed, not_negative, "seed");
  if (const YAML::Node node = root["seed"]) {
    if (!node.IsScalar()) throw Error("not a single number", {.field = "seed"});
    own.set("seed", node.Scalar());
  }
  if (seed) site.seed = *seed;
  parse_part(root, "ground", ground_parameters(site.ground));
  parse_part(root, "layout", layout_parameters(site.layout));
  parse_part(root, "field_points", field_point_parameters(site.field_points));
  parse_list(root, "bumps",
             [&](const YAML::Node& node) { site.bumps.push_back(parse_bump(node)); });
  std::vector<RockToPlace> to_place;
  parse_list(root, "rocks", [&](const YAML::Node& node) {
    // Short enough to be read in a file.
    const std::uint64_t rock_seed = mix_bits(site.seed, 1000 + site.rocks.size()) % 1'000'000;
    ParsedRock parsed = parse_rock(node, rock_seed);
    if (!parsed.has_place) to_place.push_back({site.rocks.size(), parsed.has_yaw});
    site.rocks.push_back(std::move(parsed.rock));
  });
  place_rocks(site, to_place);
  site.check();
  return site;
}

void emit(YAML::Emitter& yaml, const ParameterTable& table) {
  yaml << YAML::Flow << YAML::BeginMap;
  for (const Parameter& parameter : table.parameters()) {
    if (parameter.key == "name" && parameter.get().empty()) continue;
    yaml << YAML::Key << parameter.key << YAML::Value;
    if (parameter.key == "name") yaml << YAML::DoubleQuoted;
    yaml << parameter.get();
  }
  yaml << YAML::EndMap;
}

}  // namespace

RockSite parse_site(const std::string& text, const std::string& file,
                    std::optional<std::uint64_t> seed) {
  RockSite site;
  read_yaml(text, file, [&](const YAML::Node& root) { site = parse_root(root, seed); });
  return site;
}

RockSite load_site(const std::filesystem::path& path, std::optional<std::uint64_t> seed) {
  return parse_site(read_whole_file(path, max_yaml_bytes), path.string(), seed);
}

std::string to_yaml(const RockSite& site) {
  RockSite copy = site;
  YAML::Emitter yaml;
  yaml << YAML::BeginMap;
  yaml << YAML::Key << "seed" << YAML::Value << std::to_string(site.seed);
  yaml << YAML::Key << "ground" << YAML::Value;
  emit(yaml, ground_parameters(copy.ground));
  yaml << YAML::Key << "layout" << YAML::Value;
  emit(yaml, layout_parameters(copy.layout));
  yaml << YAML::Key << "field_points" << YAML::Value;
  emit(yaml, field_point_parameters(copy.field_points));
  yaml << YAML::Key << "bumps" << YAML::Value << YAML::BeginSeq;
  for (SceneShape& bump : copy.bumps) emit(yaml, shape_parameters(bump));
  yaml << YAML::EndSeq;
  yaml << YAML::Key << "rocks" << YAML::Value << YAML::BeginSeq;
  for (SiteRock& rock : copy.rocks) emit(yaml, rock_parameters(rock));
  yaml << YAML::EndSeq << YAML::EndMap;
  return std::string(yaml.c_str()) + "\n";
}

}  // namespace libmap
