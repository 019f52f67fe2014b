// Reads and writes gripper files: YAML maps of dimensions and optional sections `fingers`,
// `engagement`, `ranges`, `ensemble` and `urdf`; see data/README.md.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "libgtd/gripper/gripper.h"

namespace libgtd {

// Reads and checks a gripper; `overrides` (key, value) replace values of the file. Missing values
// are taken from the URDF that the file names (gripper_urdf.h). Throws Error naming the file and
// the field for a key that is unknown or missing, and for a value out of range.
Gripper read_gripper(const std::filesystem::path& path,
                     const std::vector<std::pair<std::string, std::string>>& overrides = {});

// Parses the text of a gripper file, called `file` in errors. A URDF path is relative to the folder
// of `file`. Throws like read_gripper.
Gripper parse_gripper(const std::string& yaml, const std::string& file,
                      const std::vector<std::pair<std::string, std::string>>& overrides = {});

// Returns the text of a gripper file, without the section `urdf`.
std::string to_yaml(const Gripper& gripper);

// Reads the gripper `name`: a gripper in the toolkit's data (libmap::find_data_file), or a file.
// Throws like read_gripper.
Gripper find_gripper(const std::string& name,
                     const std::vector<std::pair<std::string, std::string>>& overrides = {});

// Returns the paths of the gripper file and, if the file names a URDF, of this URDF.
std::vector<std::filesystem::path> gripper_files(const std::filesystem::path& path);

}  // namespace libgtd
