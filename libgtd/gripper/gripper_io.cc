#include "libgtd/gripper/gripper_io.h"

#include <algorithm>

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

}  // namespace

Gripper parse_gripper(const std::string& yaml, const std::string& file,
                      const std::vector<std::pair<std::string, std::string>>& overrides) {
  Gripper gripper;
  GripperFingers fingers;
  HoldModel hold_model;
  libmap::ParameterTable all;
  bind(all, gripper);
  bind(all, fingers);
  bind(all, hold_model);
  try {
    std::vector<std::string> given = libmap::set_from_yaml(all, yaml, file);
    for (const auto& [key, value] : overrides) given.push_back(key);
    const auto has = [&](const std::string& section) {
      return std::any_of(given.begin(), given.end(),
                         [&](const std::string& key) { return key.starts_with(section); });
    };
    libmap::ParameterTable present;
    bind(present, gripper);
    if (has("fingers.")) bind(present, fingers);
    if (has("hold_model.")) bind(present, hold_model);
    require_all_keys(present, given);
    for (const auto& [key, value] : overrides) present.set(key, value);
    if (has("fingers.")) gripper.fingers = fingers;
    if (has("hold_model.")) gripper.hold_model = hold_model;
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

Gripper find_gripper(const std::string& name,
                     const std::vector<std::pair<std::string, std::string>>& overrides) {
  return read_gripper(libmap::find_data_file("grippers", name), overrides);
}

}  // namespace libgtd
