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
  libmap::ParameterTable measures;
  libmap::ParameterTable all;
  bind(measures, gripper);
  bind(all, gripper);
  bind(all, fingers);
  try {
    const std::vector<std::string> given = libmap::set_from_yaml(all, yaml, file);
    const bool has_fingers = std::any_of(given.begin(), given.end(), [](const std::string& key) {
      return key.starts_with("fingers.");
    });
    require_all_keys(has_fingers ? all : measures, given);
    for (const auto& [key, value] : overrides) (has_fingers ? all : measures).set(key, value);
    if (has_fingers) gripper.fingers = fingers;
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
