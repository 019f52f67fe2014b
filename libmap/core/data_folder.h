// Location of the data shipped with graspmap: grippers, scenarios, scenes, sites, camera rigs.
#pragma once

#include <filesystem>
#include <string>

namespace libmap {

// Returns PREFIX/share/graspmap for an installed library, else the source tree's folder `data`.
std::filesystem::path data_folder();

// Returns `name` if it contains '/' or ends in .yaml, else data_folder()/KIND/NAME.yaml, e.g. for
// ("grippers", "scar-e"). Throws Error if the file is missing, with the nearest known name.
std::filesystem::path find_data_file(const std::string& kind, const std::string& name);

}  // namespace libmap
