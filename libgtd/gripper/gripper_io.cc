#include "libgtd/gripper/gripper_io.h"

#include <algorithm>

#include "libgtd/gripper/gripper_urdf.h"
#include "libmap/core/data_folder.h"
#include "libmap/core/error.h"
#include "libmap/core/file_output.h"

namespace libgtd {

namespace {

// A measure that a file left out is still 0 and would be reported as a bad value: say what it is.
void require_all_keys(const libmap::ParameterTable& table, const std::vector<std::string>& given) {
  for (const std::string& key : table.keys())
    if (std::find(given.begin(), given.end(), key) == given.end())
      throw libmap::Error("missing", {.field = key});
}

// The keys of all sections.
struct GripperKeys {
  Gripper gripper;
  GripperFingers fingers;
  HoldModel hold_model;
  UrdfMapping urdf;

  libmap::ParameterTable all() {
    libmap::ParameterTable table;
    bind(table, gripper);
    bind(table, fingers);
    bind(table, hold_model);
    bind(table, urdf);
    return table;
  }
};

bool has_section(const std::vector<std::string>& given, const std::string& section) {
  return std::any_of(given.begin(), given.end(),
                     [&](const std::string& key) { return key.starts_with(section + "."); });
}

std::filesystem::path urdf_path(const UrdfMapping& urdf, const std::string& gripper_file) {
  return std::filesystem::path(gripper_file).parent_path() / urdf.file;
}

// What the file does not say and its URDF does. Keys of fingers only if the file has some.
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
    for (const auto& [key, value] : measures_of_urdf(xml, mapping)) {
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
    if (has_section(given, "hold_model")) bind(present, keys.hold_model);
    require_all_keys(present, given);
    for (const auto& [key, value] : overrides) present.set(key, value);
    if (has_section(given, "fingers")) gripper.fingers = keys.fingers;
    if (has_section(given, "hold_model")) gripper.hold_model = keys.hold_model;
    gripper.check();
  } catch (const libmap::Error& error) {
    throw error.in_file(file);
  }
  return gripper;
}

Gripper read_gripper(const std::filesystem::path& path,
                     const std::vector<std::pair<std::string, std::string>>& overrides) {
  return parse_gripper(libmap::read_whole_file(path, std::uint64_t{1} << 20), path.string(),
                       overrides);
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
