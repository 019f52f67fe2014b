#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace graspmap_test {

// Returns the sorted names of all entries of `folder`.
std::vector<std::string> names_in(const std::filesystem::path& folder);

}  // namespace graspmap_test
