#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace graspmap_test {

// Of all entries of `folder`, sorted.
std::vector<std::string> names_in(const std::filesystem::path& folder);

}  // namespace graspmap_test
