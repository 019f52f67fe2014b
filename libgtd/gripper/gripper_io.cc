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
  libmap::ParameterTable table;
  bind(table, gripper);
  try {
    require_all_keys(table, libmap::set_from_yaml(table, yaml, file));
    for (const auto& [key, value] : overrides) table.set(key, value);
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
