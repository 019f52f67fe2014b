// Gripper files: a YAML map of measures and optional sections `fingers`, `engagement`, `ranges`,
// `ensemble` and `urdf`; see data/README.md.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "libgtd/gripper/gripper.h"

namespace libgtd {

// Reads and checks a gripper; `overrides` (key, value) replace what the file says. Throws Error
// naming the file and the field: an unknown key, a missing one, a value outside its bound. What the
// file does not say is taken from its URDF, if it names one (gripper_urdf.h).
Gripper read_gripper(const std::filesystem::path& path,
                     const std::vector<std::pair<std::string, std::string>>& overrides = {});

// The same of the text of such a file, called `file` in errors; its folder is that of the URDF.
Gripper parse_gripper(const std::string& yaml, const std::string& file,
                      const std::vector<std::pair<std::string, std::string>>& overrides = {});

// The gripper as the text of a file, without the section `urdf`.
std::string to_yaml(const Gripper& gripper);

// The gripper of this name in the toolkit's data (libmap::find_data_file), or of a file.
Gripper find_gripper(const std::string& name,
                     const std::vector<std::pair<std::string, std::string>>& overrides = {});

// The file, and the URDF that it names.
std::vector<std::filesystem::path> gripper_files(const std::filesystem::path& path);

}  // namespace libgtd
