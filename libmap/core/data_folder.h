// The data that come with graspmap: grippers, scenarios, scenes, sites, camera rigs.
#pragma once

#include <filesystem>
#include <string>

namespace libmap {

// PREFIX/share/graspmap of an installed library, else `data` of the source tree.
std::filesystem::path data_folder();

// A path if it has a '/' or ends in .yaml, else data_folder()/KIND/NAME.yaml, e.g.
// ("grippers", "scar-e"). Throws Error naming the nearest known name.
std::filesystem::path find_data_file(const std::string& kind, const std::string& name);

}  // namespace libmap
