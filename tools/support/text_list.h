// Several texts in one option.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace graspmap_tools {

// "a| b||c" at '|' -> a, b, "", c; nothing for an empty text.
std::vector<std::string> split_texts(std::string_view text);

}  // namespace graspmap_tools
