#include "libgtd/gripper/gripper_io.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include "libgtd/gripper/gripper_urdf.h"
#include "libmap/core/data_folder.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"

namespace libgtd {

namespace {

// A value missing in a file is still 0 and would be reported as out of range. Reports it as missing
// instead.
void require_all_keys(const libmap::ParameterTable& table, const std::vector<std::string>& given) {
  for (const std::string& key : table.keys())
    if (std::find(given.begin(), given.end(), key) == given.end())
      throw libmap::Error("missing", {.field = key});
}

// Keys of all sections.
struct GripperKeys {
  Gripper gripper;
  GripperFingers fingers;
  std::array<std::string, uncertain_parameters> ranges;
  std::string sets;
  UrdfMapping urdf;

  libmap::ParameterTable all() {
    libmap::ParameterTable table;
    bind(table, gripper);
    bind(table, fingers);
    bind(table, urdf);
    bind_engagement(table);
    return table;
  }

  void bind_engagement(libmap::ParameterTable& table) {
    bind(table, gripper.engagement);
    for (std::size_t n = 0; n < uncertain_parameters; ++n)
      table.add("ranges." + uncertain_parameter_names()[n], ranges[n],
                "bounds LOW, HIGH of the prior distribution of the parameter");
    table.add("ensemble.sets", sets,
              "fitted parameter sets, one per line: weight, spine_force_limit_n, closing_force_n, "
              "friction, asperity_min_deg, asperity_max_deg, engagement_rate");
  }
};

std::optional<ParameterRange> parse_range(const std::string& name, const std::string& text) {
  if (text.empty()) return std::nullopt;
  const std::vector<std::string> parts = libmap::split_list(text);
  const auto low = libmap::parse_double(parts.front());
  const auto high = libmap::parse_double(parts.back());
  const bool is_angle = name.ends_with("_deg");
  if (parts.size() == 2 && low && high && *low <= *high && (is_angle ? *low >= 0.0 : *low > 0.0) &&
      (!is_angle || *high <= 90.0))
    return ParameterRange{*low, *high};
  throw libmap::Error("not a range", {.field = "ranges." + name,
                                      .value = text,
                                      .bound = is_angle ? "LOW, HIGH with 0 <= LOW <= HIGH <= 90"
                                                        : "LOW, HIGH with 0 < LOW <= HIGH"});
}

std::vector<ParameterSet> parse_sets(const std::string& text) {
  std::vector<ParameterSet> sets;
  std::istringstream lines(text);
  double sum = 0.0;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream cells(line);
    ParameterSet set;
    cells >> set.weight;
    for (double& value : set.values) cells >> value;
    const bool is_whole = !cells.fail() && (cells >> std::ws).eof();
    if (!is_whole || !(set.weight >= 0.0))
      throw libmap::Error(
          "not a parameter set",
          {.field = "ensemble.sets",
           .value = line,
           .bound = "a weight >= 0, then spine_force_limit_n, closing_force_n, friction, "
                    "asperity_min_deg, asperity_max_deg, engagement_rate"});
    sum += set.weight;
    sets.push_back(set);
  }
  if (!sets.empty() && !(sum > 0.0))
    throw libmap::Error("contains no set with a positive weight", {.field = "ensemble.sets"});
  for (ParameterSet& set : sets) set.weight /= sum;
  return sets;
}

bool has_section(const std::vector<std::string>& given, const std::string& section) {
  return std::any_of(given.begin(), given.end(),
                     [&](const std::string& key) { return key.starts_with(section + "."); });
}

std::filesystem::path urdf_path(const UrdfMapping& urdf, const std::string& gripper_file) {
  return std::filesystem::path(gripper_file).parent_path() / urdf.file;
}

// Adds values that are missing in the file from its URDF. Keys "fingers.KEY" are added only if the
// file has this section.
void add_measures_of_urdf(const libmap::ParameterTable& table, const UrdfMapping& mapping,
                          const std::string& file, std::vector<std::string>& given) {
  libmap::ParameterTable section;
  UrdfMapping copy = mapping;
  bind(section, copy);
  require_all_keys(section, given);
  const std::filesystem::path path = urdf_path(mapping, file);
  const std::string xml = libmap::read_whole_file(path, std::uint64_t{1} << 24);
  const bool has_fingers = has_section(given, "fingers");
  try {
    for (const auto& [key, value] : read_urdf_dimensions(xml, mapping)) {
      if (std::find(given.begin(), given.end(), key) != given.end()) continue;
      if (key.starts_with("fingers.") && !has_fingers) continue;
      table.set(key, value);
      given.push_back(key);
    }
  } catch (const libmap::Error& error) {
    throw error.in_file(path.string());
  }
}

}  // namespace

Gripper parse_gripper(const std::string& yaml, const std::string& file,
                      const std::vector<std::pair<std::string, std::string>>& overrides) {
  GripperKeys keys;
  const libmap::ParameterTable all = keys.all();
  Gripper& gripper = keys.gripper;
  try {
    std::vector<std::string> given = libmap::set_from_yaml(all, yaml, file);
    for (const auto& [key, value] : overrides) given.push_back(key);
    if (has_section(given, "urdf")) add_measures_of_urdf(all, keys.urdf, file, given);
    libmap::ParameterTable present;
    bind(present, gripper);
    if (has_section(given, "fingers")) bind(present, keys.fingers);
    require_all_keys(present, given);
    keys.bind_engagement(present);
    for (const auto& [key, value] : overrides) present.set(key, value);
    if (has_section(given, "fingers")) gripper.fingers = keys.fingers;
    for (std::size_t n = 0; n < uncertain_parameters; ++n)
      gripper.ranges[n] = parse_range(uncertain_parameter_names()[n], keys.ranges[n]);
    gripper.ensemble = parse_sets(keys.sets);
    gripper.check();
    for (const ParameterSet& set : gripper.ensemble)
      if (gripper.fingers) with_parameters(gripper, set.values).check();
  } catch (const libmap::Error& error) {
    if (error.context().field.starts_with("hold_model"))
      throw libmap::Error("is obsolete: forces need no fit; remove the section",
                          {.file = file, .field = "hold_model"});
    throw error.in_file(file);
  }
  return gripper;
}

Gripper read_gripper(const std::filesystem::path& path,
                     const std::vector<std::pair<std::string, std::string>>& overrides) {
  return parse_gripper(libmap::read_whole_file(path, std::uint64_t{1} << 20), path.string(),
                       overrides);
}

std::string to_yaml(const Gripper& gripper) {
  GripperKeys keys;
  keys.gripper = gripper;
  libmap::ParameterTable measures;
  bind(measures, keys.gripper);
  std::string text = libmap::to_yaml(measures);
  const auto add_section = [&](const std::string& name, const libmap::ParameterTable& table) {
    text += name + ":\n";
    for (const auto& [key, value] : table.values())
      text += "  " + key.substr(name.size() + 1) + ": " + value + "\n";
  };
  libmap::ParameterTable section;
  if (gripper.fingers) {
    keys.fingers = *gripper.fingers;
    bind(section, keys.fingers);
    add_section("fingers", section);
  }
  section = {};
  bind(section, keys.gripper.engagement);
  add_section("engagement", section);
  text += "ranges:\n";
  for (std::size_t n = 0; n < uncertain_parameters; ++n)
    if (const auto& range = gripper.ranges[n])
      text += "  " + uncertain_parameter_names()[n] + ": " + libmap::to_text(range->low) + ", " +
              libmap::to_text(range->high) + "\n";
  if (gripper.ensemble.empty()) return text;
  text += "ensemble:  # weight";
  for (const std::string& name : uncertain_parameter_names()) text += ", " + name;
  text += "\n  sets: |\n";
  for (const ParameterSet& set : gripper.ensemble) {
    text += "    " + libmap::to_text(set.weight);
    for (const double value : set.values)
      text += " " + libmap::to_text(std::round(1e4 * value) / 1e4);
    text += "\n";
  }
  return text;
}

std::vector<std::filesystem::path> gripper_files(const std::filesystem::path& path) {
  GripperKeys keys;
  const std::string yaml = libmap::read_whole_file(path, std::uint64_t{1} << 20);
  libmap::set_from_yaml(keys.all(), yaml, path.string());
  std::vector<std::filesystem::path> files = {path};
  if (!keys.urdf.file.empty()) files.push_back(urdf_path(keys.urdf, path.string()));
  return files;
}

Gripper find_gripper(const std::string& name,
                     const std::vector<std::pair<std::string, std::string>>& overrides) {
  return read_gripper(libmap::find_data_file("grippers", name), overrides);
}

}  // namespace libgtd
